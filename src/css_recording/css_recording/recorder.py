# SPDX-License-Identifier: Apache-2.0
"""The recorder as a node, for a process of its own or inside a composed flight.

It takes serialised messages and does not decode them. A topic is subscribed when its publishers are known, with the
quality of service that they offer. The topics of the plant come last, when all others are matched: the plant waits
for its listeners before it begins, and so no flight begins before the recorder hears all of it. In a flight the
recorder also says how far it has come, and the plant does not go far ahead of that.

Of a topic of the mission the messages of one writer are recorded; those of others are counted.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path

from diagnostic_msgs.msg import DiagnosticStatus
from rcl_interfaces.msg import ParameterEvent
from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import QoSProfile, qos_profile_parameter_events
from rclpy.serialization import deserialize_message
from rclpy.subscription import Subscription

from css_common.codec import type_name
from css_common.diagnostics import Diagnostics, Health
from css_common.epochs import format_utc
from css_common.mission import Mission
from css_common.qos import LOOP_PUBLISHER, RECORDER, RECORDER_SUBSCRIPTION, matching_qos
from css_common.sole_subscription import SoleSubscription
from css_common.writers import writer_choice
from css_recording.bag_metadata import Topic, absolute
from css_recording.errors import BagError
from css_recording.flight_pacing import FlightPacing
from css_recording.flight_recorder import FlightRecorder, Gap
from css_recording.provenance import INCIDENTS, NOTHING, software_versions
from css_recording.recording_choice import RecordingChoice
from css_recording.ros_topics import message_class_of, recorded_qos
from css_recording.second_buffer import SECOND_NS, BufferLimits
from css_recording.split_bag_writer import SplitBagWriter

PARAMETER_EVENTS = "/parameter_events"
"""Entry of a recording that says what was not as it should be in the flight, one a line, or `none`."""
_MEANING = {
    "repeated": "with the stamp of the one before",
    "back": "with a stamp earlier than the one before",
}
_LOOK_EVERY = 0.02
_DISCOVER_EVERY = 0.2
_WARN_AFTER = 5.0
# Not recorded unless asked for by name: a player has its own clock, and logs are kept by the nodes.
_LEFT_OUT = ("/clock", "/rosout", PARAMETER_EVENTS)


class RecorderNode(Node):
    """Records the topics of a mission, topics by name, or everything that appears.

    Attributes:
        failure: why the recording ended early; empty while all is well.
    """

    def __init__(
        self,
        mission: Mission | None,
        bag: Path,
        topics: Iterable[str] = (),
        *,
        everything: bool = False,
        overwrite: bool = False,
        in_flight: bool = False,
        choice: RecordingChoice | None = None,
        notes: Mapping[str, str] | None = None,
        context: Context | None = None,
        use_global_arguments: bool = True,
    ) -> None:
        """Creates the recording and begins to look for publishers.

        Args:
            mission: its topics are recorded, and its text is kept; None: no mission.
            bag: folder of the recording.
            topics: further topics by name.
            everything: also every topic that appears.
            overwrite: replace a recording that is there.
            in_flight: the mission is being flown and waits for this recorder; only nodes of its graph are recorded.
            choice: what is left out, quality of service, files; default: nothing, the strictest, one.
            notes: further entries of what the recording says of itself.
            context: ROS context.
            use_global_arguments: False in a composed process, where one command line serves many nodes.

        Raises:
            BagError: the recording cannot be created.
        """
        super().__init__(RECORDER, context=context, use_global_arguments=use_global_arguments)
        self.failure = ""
        self._everything = everything
        self._choice = choice or RecordingChoice()
        self._expected: dict[str, type | None] = {}
        self._last: set[str] = set()
        self._discovered: set[str] = set()
        self._mission = mission
        self._in_flight = in_flight
        self._names: dict[str, str] = {}
        self._subscribed: dict[str, Subscription | SoleSubscription] = {}
        self._refused: set[str] = set()
        self._waited = 0.0
        try:
            self._recorder = self._create(mission, bag, overwrite, notes or {})
            for topic in topics:
                self._expected.setdefault(self.resolve_topic_name(topic), None)
        except BagError:
            self.destroy_node()
            raise
        self._watch_parameters()
        self._look_every = _DISCOVER_EVERY if everything else _LOOK_EVERY
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = self.create_timer(self._look_every, self._look, clock=steady)
        self._diagnostics = Diagnostics(self, self.health)
        self._pacing = FlightPacing(self, mission) if in_flight and mission is not None else None

    @property
    def ready(self) -> bool:
        """Every expected topic is subscribed and has a publisher."""
        return not self._missing(self._expected)

    @property
    def never_appeared(self) -> list[str]:
        """Expected topics that nobody has published, or that cannot be recorded."""
        return sorted(topic for topic in self._expected if topic not in self._subscribed)

    @property
    def counts(self) -> dict[str, int]:
        """Messages received of each topic."""
        return self._recorder.counts

    @property
    def message_count(self) -> int:
        """Messages received."""
        return self._recorder.message_count

    @property
    def counters(self) -> Counter[str]:
        """What was not as it should be: gaps, stamps out of order, messages later than the hold-back time."""
        return self._recorder.counters + Counter(late=self._recorder.writer.late_messages)

    @property
    def gaps(self) -> dict[str, Gap]:
        """What is missing of each topic of the mission that misses something."""
        return dict(self._recorder.gaps)

    @property
    def refused(self) -> dict[str, dict[str, int]]:
        """Messages of other writers than the accepted one, by topic and node; they are not recorded."""
        sole = {t: s for t, s in self._subscribed.items() if isinstance(s, SoleSubscription)}
        return {topic: dict(subscription.refused) for topic, subscription in sole.items() if subscription.refused}

    def faults(self) -> list[str]:
        """What is missing or was left out, in one line each."""
        lines = [
            f"{topic}: {gap.missing} messages missing, the first stamped {format_utc(gap.first_ns)}"
            for topic, gap in self.gaps.items()
        ]
        for topic, strangers in self.refused.items():
            lines += [f"{topic}: {count} messages of {node} not recorded" for node, count in strangers.items()]
        counted = self.counters
        lines += [f"{counted[key]} messages {text}" for key, text in _MEANING.items() if counted[key]]
        return lines

    def health(self) -> Health:
        """Level, one line and counters for /diagnostics."""
        counters = {**self.counts, **self.counters}
        stamp_ns = self._recorder.latest_ns
        if self.failure:
            return Health(DiagnosticStatus.ERROR, self.failure, counters, stamp_ns)
        if not self.ready:
            return Health(DiagnosticStatus.WARN, "waiting for publishers", counters, stamp_ns)
        return Health(DiagnosticStatus.OK, "recording", counters, stamp_ns)

    def close(self, incidents: Sequence[str] | None = None) -> None:
        """Finishes the recording; again does nothing.

        A disk that refuses is reported and noted in `failure`.

        Args:
            incidents: what was not as it should be in the flight, beside the recorder's own faults; None when nobody
                knows.
        """
        notes = None if incidents is None else {INCIDENTS: "\n".join((*incidents, *self.faults())) or NOTHING}
        self._guarded(partial(self._recorder.close, notes))

    def stop_listening(self) -> None:
        """Ends the subscriptions to topics; to be called while the executor still has the node."""
        for subscription in self._subscribed.values():
            if isinstance(subscription, SoleSubscription):
                subscription.destroy()

    def _create(self, mission: Mission | None, bag: Path, overwrite: bool, notes: Mapping[str, str]) -> FlightRecorder:
        metadata = {**software_versions(), **notes}
        recorded: list[Topic] = []
        spacing_ns: dict[str, int] = {}
        limits = BufferLimits()
        if mission is not None:
            metadata["mission"] = mission.text()
            limits = BufferLimits(hold_back_ns=max(SECOND_NS // 5, 2 * mission.period_ns))
            for name, output in mission.outputs.items():
                topic = self.resolve_topic_name(name)
                if topic in self._choice.excluded:
                    continue
                self._expected[topic] = output.message_type
                self._names[topic] = name
                if not output.events:
                    spacing_ns[topic] = output.divider * mission.period_ns
                recorded.append(Topic(topic, type_name(output.message_type), (recorded_qos(LOOP_PUBLISHER),)))
            if mission.plant is not None:
                plant = (self.resolve_topic_name(output.topic) for output in mission.plant.outputs)
                self._last = {topic for topic in plant if topic in self._expected}
        events = (recorded_qos(qos_profile_parameter_events),)
        recorded.append(Topic(PARAMETER_EVENTS, type_name(ParameterEvent), events))
        files = self._choice.limits
        writer = SplitBagWriter(bag, recorded, metadata, files=files, overwrite=overwrite, limits=limits)
        return FlightRecorder(writer, spacing_ns)

    def _watch_parameters(self) -> None:
        self.create_subscription(
            ParameterEvent, PARAMETER_EVENTS, self._take_parameter_event, qos_profile_parameter_events, raw=True
        )

    def _take_parameter_event(self, data: bytes) -> None:
        # Values with which nodes start are in the mission; what is recorded is what changed.
        event = deserialize_message(data, ParameterEvent)
        if event.changed_parameters or event.deleted_parameters:
            self._take(PARAMETER_EVENTS, data)

    # Looking for publishers

    def _look(self) -> None:
        if self._everything:
            self._discover()
            self._subscribe_to(self._discovered)
        first = [topic for topic in self._expected if topic not in self._last]
        self._subscribe_to(first)
        if not self._missing(first):
            self._subscribe_to(self._last)
        missing = self._missing(self._expected)
        if not missing and not self._everything:
            self._timer.cancel()
            self.get_logger().info(f"recording {len(self._subscribed)} topics")
            return
        self._waited += self._look_every
        if missing and self._waited >= _WARN_AFTER:
            self._waited = 0.0
            self.get_logger().warning(f"waiting for a publisher of {', '.join(missing)}")

    def _discover(self) -> None:
        for topic, types in self.get_topic_names_and_types():
            known = topic in self._expected or topic in _LEFT_OUT or topic in self._choice.excluded
            if not known and "/_" not in topic and len(types) == 1:
                self._discovered.add(topic)

    def _missing(self, topics: Iterable[str]) -> list[str]:
        return [topic for topic in topics if topic not in self._refused and self._writers_of(topic) == 0]

    def _writers_of(self, topic: str) -> int:
        subscription = self._subscribed.get(topic)
        if subscription is None:
            return 0
        if isinstance(subscription, SoleSubscription):
            return subscription.publisher_count
        return subscription.get_publisher_count()

    def _subscribe_to(self, topics: Iterable[str]) -> None:
        for topic in sorted(topics):
            if topic in self._subscribed or topic in self._refused:
                continue
            publishers = self.get_publishers_info_by_topic(topic)
            if not publishers:
                continue
            try:
                message_type = self._expected.get(topic)
                if message_type is None:
                    message_type = message_class_of(publishers[0].topic_type)
                    qos = tuple(recorded_qos(publisher.qos_profile) for publisher in publishers)
                    self._recorder.add_topic(Topic(absolute(topic), publishers[0].topic_type, qos))
            except BagError as error:
                self._refused.add(topic)
                self.get_logger().warning(f"{topic} is not recorded: {error}")
                continue
            offered = matching_qos(publishers, RECORDER_SUBSCRIPTION.depth)
            self._subscribed[topic] = self._listen(topic, message_type, offered)

    def _listen(self, topic: str, message_type: type, offered: QoSProfile) -> Subscription | SoleSubscription:
        take = partial(self._take, topic)
        asked = self._choice.qos.get(topic)
        if self._mission is None or topic not in self._names:
            # whose topic it is nobody knows, and some have many writers
            return self.create_subscription(message_type, topic, take, asked or offered, raw=True)
        choice = writer_choice(self._mission, self._names[topic], self.get_namespace(), only=self._in_flight or None)
        qos = asked or (RECORDER_SUBSCRIPTION if self._in_flight else offered)  # not what a stranger offers
        hand_over = partial(self._recorder.hand_over, topic)
        return SoleSubscription(self, message_type, topic, take, qos, choice, on_hand_over=hand_over)

    # Messages

    def _take(self, topic: str, data: bytes) -> None:
        if self.failure:
            return
        try:
            stamp_ns = self._recorder.receive(topic, data)
        except BagError as error:
            self._fail(error)
            return
        if self._pacing is not None and stamp_ns is not None:
            self._pacing.note(topic, stamp_ns)

    def _guarded(self, action: Callable[[], None]) -> None:
        try:
            action()
        except BagError as error:
            self._fail(error)

    def _fail(self, error: BagError) -> None:
        if not self.failure:
            self.failure = str(error)
            self.get_logger().error(f"recording ended: {error}")
