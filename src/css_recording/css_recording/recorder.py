# SPDX-License-Identifier: Apache-2.0
"""The recorder as a node, for a process of its own or inside a composed flight.

It takes serialised messages and does not decode them. A topic is subscribed when its publishers are known, with the
quality of service that they offer. The topics of the plant come last, when all others are matched: the plant waits
for its listeners before it begins, and so no flight begins before the recorder hears all of it.
"""

from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path

from diagnostic_msgs.msg import DiagnosticStatus
from rcl_interfaces.msg import ParameterEvent
from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import qos_profile_parameter_events
from rclpy.serialization import deserialize_message
from rclpy.subscription import Subscription

from css_common.codec import type_name
from css_common.diagnostics import Diagnostics, Health
from css_common.mission import Mission
from css_common.qos import LOOP_PUBLISHER, RECORDER_SUBSCRIPTION
from css_recording.bag_metadata import Topic, absolute
from css_recording.errors import BagError
from css_recording.flight_recorder import FlightRecorder
from css_recording.provenance import software_versions
from css_recording.recording_choice import RecordingChoice
from css_recording.ros_topics import matching_qos, message_class_of, recorded_qos
from css_recording.second_buffer import SECOND_NS, BufferLimits
from css_recording.split_bag_writer import SplitBagWriter

PARAMETER_EVENTS = "/parameter_events"
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
        choice: RecordingChoice | None = None,
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
            choice: what is left out, quality of service, files; default: nothing, the strictest, one.
            context: ROS context.
            use_global_arguments: False in a composed process, where one command line serves many nodes.

        Raises:
            BagError: the recording cannot be created.
        """
        super().__init__("recorder", context=context, use_global_arguments=use_global_arguments)
        self.failure = ""
        self._everything = everything
        self._choice = choice or RecordingChoice()
        self._expected: dict[str, type | None] = {}
        self._last: set[str] = set()
        self._discovered: set[str] = set()
        self._subscribed: dict[str, Subscription] = {}
        self._refused: set[str] = set()
        self._waited = 0.0
        try:
            self._recorder = self._create(mission, bag, overwrite)
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
    def counters(self) -> dict[str, int]:
        """What was not as it should be: gaps, stamps out of order, messages later than the hold-back time."""
        return {**self._recorder.counters, "late": self._recorder.writer.late_messages}

    def health(self) -> Health:
        """Level, one line and counters for /diagnostics."""
        counters = {**self.counts, **self.counters}
        stamp_ns = self._recorder.latest_ns
        if self.failure:
            return Health(DiagnosticStatus.ERROR, self.failure, counters, stamp_ns)
        if not self.ready:
            return Health(DiagnosticStatus.WARN, "waiting for publishers", counters, stamp_ns)
        return Health(DiagnosticStatus.OK, "recording", counters, stamp_ns)

    def close(self) -> None:
        """Finishes the recording; again does nothing.

        A disk that refuses is reported and noted in `failure`.
        """
        self._guarded(self._recorder.close)

    def _create(self, mission: Mission | None, bag: Path, overwrite: bool) -> FlightRecorder:
        metadata = software_versions()
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
        return [
            topic
            for topic in topics
            if topic not in self._refused
            and (topic not in self._subscribed or self._subscribed[topic].get_publisher_count() == 0)
        ]

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
            self._subscribed[topic] = self.create_subscription(
                message_type,
                topic,
                partial(self._take, topic),
                self._choice.qos.get(topic) or matching_qos(publishers, RECORDER_SUBSCRIPTION.depth),
                raw=True,
            )

    # Messages

    def _take(self, topic: str, data: bytes) -> None:
        if not self.failure:
            self._guarded(partial(self._recorder.receive, topic, data))

    def _guarded(self, action: Callable[[], None]) -> None:
        try:
            action()
        except BagError as error:
            if not self.failure:
                self.failure = str(error)
                self.get_logger().error(f"recording ended: {error}")
