# SPDX-License-Identifier: Apache-2.0
"""Publishes a recording to live nodes: at a rate, or in lockstep with the nodes that answer it.

What a live node publishes is left to it. Messages go out as the bytes that were recorded, with the stamps that
they have. Lockstep is the reproducible way: all messages of one stamp are published, and the next follow when every
awaited topic has answered that stamp. A playback can be held, stepped and made faster or slower while it lasts.
"""

import time
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from itertools import groupby
from operator import attrgetter
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.executors import Executor
from rclpy.node import Node
from rclpy.publisher import Publisher
from rosgraph_msgs.msg import Clock

from css_common.diagnostics import Diagnostics, Health
from css_common.pace_controls import PaceControls, rosbag2_service
from css_common.qos import LOOP_PUBLISHER
from css_msgs.srv import Seek
from css_recording.bag_reader import BagMessage
from css_recording.errors import BagError
from css_recording.lockstep_answers import LockstepAnswers
from css_recording.merged_bags import Recording
from css_recording.playback import PlaybackError, PlaybackOptions, PlaybackReport
from css_recording.playback_choice import choose
from css_recording.playback_pace import PlaybackPace
from css_recording.ros_topics import message_class_of, publishers_of_others

_SETTLED_AFTER = 2.0
_SETTLE_LIMIT = 10.0
_CONNECT_LIMIT = 5.0
_LOOK_EVERY = 1.0
_SPIN = 0.05


class PlayerNode(Node):
    """Plays a recording.

    Attributes:
        report: what has been played.
        pace: when what is due.
        controls: hold, step, rate; `~/seek` goes to an instant.
    """

    def __init__(
        self,
        reader: Recording,
        options: PlaybackOptions,
        *,
        context: Context | None = None,
        use_global_arguments: bool = True,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        """Prepares playback; `play` does it.

        Args:
            reader: the recording, or several.
            options: how to play it.
            context: ROS context.
            use_global_arguments: False in a process of several nodes, where one command line serves them all.
            now: wall clock [s] that paces the playback.

        Raises:
            BagError: nothing in the recording is what the options ask for.
        """
        super().__init__("player", context=context, use_global_arguments=use_global_arguments)
        self.report = PlaybackReport()
        self._reader = reader
        self._options = options
        self._now = now
        self.pace = PlaybackPace(options.rate, now, paused=options.paused)
        try:
            self._choice = choose(reader, options, self.resolve_topic_name)
            self.controls = PaceControls(self, self.pace, self.pace.grant_message)
            self.create_service(rosbag2_service("Seek") or Seek, "~/seek", self._seek)
        except (BagError, ValueError) as error:
            self.destroy_node()
            raise BagError(str(error)) from error
        self._diagnostics = Diagnostics(self, self.health)
        self._publishers_by_topic: dict[str, Publisher] = {}
        self._answers = LockstepAnswers(self)
        self._clock_publisher = self.create_publisher(Clock, "/clock", 10) if options.clock else None
        self._executor: Executor | None = None
        self._stopped: Callable[[], bool] = lambda: False
        self._listen: Callable[[], None] = lambda: None

    def health(self) -> Health:
        """Level, one line and counters for /diagnostics."""
        counters = {**self.report.published, "stamps": self.report.stamps}
        if self.report.not_installed:
            message = f"types not installed: {', '.join(self.report.not_installed)}"
            return Health(DiagnosticStatus.WARN, message, counters, 0)
        return Health(DiagnosticStatus.OK, "paused" if self.pace.paused else "playing", counters, 0)

    def play(
        self,
        executor: Executor,
        stopped: Callable[[], bool] = lambda: False,
        listen: Callable[[], None] = lambda: None,
    ) -> PlaybackReport:
        """Plays the recording, once or again and again; returns early when `stopped`.

        Args:
            executor: runs this node, and any others of the process.
            stopped: asked again and again.
            listen: called as often, to look for what the user wants.

        Raises:
            PlaybackError: a node that should answer is absent or silent, or nothing is left to play.
            BagError: the recording cannot be read.
        """
        self._executor, self._stopped, self._listen = executor, stopped, listen
        self._settle()
        self._create_publishers()
        self._meet_partners()
        self._publish_all()
        while self._options.loop and self._publishers_by_topic and not self._stopped():
            self._publish_all()
        for publisher in self._publishers_by_topic.values():
            publisher.wait_for_all_acked(Duration(seconds=2))
        self.report.stopped = self._stopped()
        return self.report

    # Before the first message

    def _settle(self) -> None:
        """Waits until no more topics or publishers appear."""
        before: object = None
        quiet_since = began = time.monotonic()
        while not self._stopped() and time.monotonic() - began < _SETTLE_LIMIT:
            now = [(topic.name, len(publishers_of_others(self, topic.name))) for topic in self._choice.topics]
            graph = (now, sorted(self.get_node_names()))
            if graph != before:
                before, quiet_since = graph, time.monotonic()
            if time.monotonic() - quiet_since >= _SETTLED_AFTER:
                return
            self._spin(_SPIN)

    def _create_publishers(self) -> None:
        for topic in self._choice.topics:
            if publishers_of_others(self, topic.name):
                self.report.left_to_live_nodes.append(topic.name)
                self.get_logger().info(f"{topic.name} is left to the node that publishes it")
                continue
            try:
                message_class = message_class_of(topic.type)
            except BagError as error:
                self.report.not_installed.append(topic.name)
                self.get_logger().warning(f"{topic.name} is not played: {error}")
                continue
            # The strongest offer, whatever was recorded: a node that asks for less is matched all the same.
            qos = self._options.qos.get(topic.name, LOOP_PUBLISHER)
            self._publishers_by_topic[topic.name] = self.create_publisher(message_class, topic.name, qos)
            self.report.published[topic.name] = 0
        if not self._publishers_by_topic and not self._stopped():
            raise PlaybackError(f"nothing to play: {self._why_not()}")

    def _why_not(self) -> str:
        reasons = {
            "left to the nodes that publish them": self.report.left_to_live_nodes,
            "of types that are not installed": self.report.not_installed,
        }
        return "; ".join(f"{', '.join(topics)} {reason}" for reason, topics in reasons.items() if topics)

    def _meet_partners(self) -> None:
        for name in self._options.wait_for:
            topic = self.resolve_topic_name(name)
            if topic in self._publishers_by_topic:
                raise PlaybackError(f"no live node publishes {topic}, which the playback is to wait for")
            self._listen_to(topic)
        if self._options.wait_for:
            self._wait(lambda: self._connected() and self._listeners() > 0, "no live node listens to the recording")
            return
        limit = time.monotonic() + _CONNECT_LIMIT
        while not self._connected() and not self._stopped() and time.monotonic() < limit:
            self._spin(_SPIN)
        if not self._listeners():
            self.get_logger().info("no live node listens yet")

    def _listen_to(self, topic: str) -> None:
        """Subscribes to a topic that answers."""
        self._wait(lambda: bool(publishers_of_others(self, topic)), f"no live node publishes {topic}")
        publishers = publishers_of_others(self, topic)
        if not publishers:
            return  # stopped
        subscription = self._answers.listen_to(topic, publishers)
        self._wait(lambda: subscription.get_publisher_count() > 0, f"{topic} cannot be heard")

    def _connected(self) -> bool:
        """Whoever is known to listen is connected."""
        return all(
            publisher.get_subscription_count() >= self.count_subscribers(topic)
            for topic, publisher in self._publishers_by_topic.items()
        )

    def _listeners(self) -> int:
        return sum(publisher.get_subscription_count() for publisher in self._publishers_by_topic.values())

    # Playing

    def _publish_all(self) -> None:
        begin_ns: int | None = self._choice.start_ns
        while begin_ns is not None:
            self._publish_from(begin_ns)
            while self._options.stay and not (self._stopped() or self.pace.seeks):
                self._spin(_SPIN)
            begin_ns = None if self._stopped() else self.pace.take_sought()

    def _seek(self, request: Any, response: Any) -> Any:
        stamp_ns = request.time.sec * 1_000_000_000 + request.time.nanosec
        first_ns, last_ns = self._reader.start_ns, self._reader.end_ns
        response.success = first_ns <= stamp_ns <= last_ns
        if response.success:
            self.pace.seek(stamp_ns)
        elif hasattr(response, "message"):  # rosbag2's has none
            response.message = f"time: {stamp_ns} ns given, expected a stamp from {first_ns} to {last_ns} ns"
        return response

    def _publish_from(self, begin_ns: int) -> None:
        self._answers.forget()
        self.pace.start(begin_ns)
        looked = self._now()
        for stamp_ns, messages in self._by_stamp(begin_ns):
            if not self._await_turn(stamp_ns):
                return
            if self._now() - looked > _LOOK_EVERY:
                looked = self._now()
                self._give_way()
            paced = self._publish_group(stamp_ns, messages)
            if self.pace.seeks:
                return
            self.pace.stamp_is_over()
            if paced and self._answers:
                self._await_answers(stamp_ns)

    def _await_turn(self, stamp_ns: int) -> bool:
        """Waits until the next message, of this stamp, is due; False when the playback is to end instead."""
        self._spin(0.0)  # also when it is late: nodes of this process must get their turn
        while not (self._stopped() or self.pace.seeks):
            wait = self.pace.wait(stamp_ns)
            if wait <= 0.0:
                return True
            self._spin(min(_SPIN, wait))
        return False

    def _by_stamp(self, begin_ns: int) -> Iterator[tuple[int, Iterable[BagMessage]]]:
        played = [*self._publishers_by_topic, *([self._choice.pacing] if self._answers else [])]
        choice = self._choice
        messages = self._reader.messages(set(played), begin_ns, choice.end_ns)
        return groupby(messages, key=attrgetter("stamp_ns"))

    def _publish_group(self, stamp_ns: int, messages: Iterable[BagMessage]) -> bool:
        """Publishes the messages of one stamp; whether the pacing topic was among them."""
        paced = False
        for message in messages:
            publisher = self._publishers_by_topic.get(message.topic)
            if publisher is not None:
                if self.pace.paused and not self._step(stamp_ns):
                    return False
                publisher.publish(message.data)
                self.report.published[message.topic] += 1
            paced = paced or message.topic == self._choice.pacing
        if self._clock_publisher is not None:
            now = Clock()
            now.clock.sec, now.clock.nanosec = divmod(stamp_ns, 1_000_000_000)
            self._clock_publisher.publish(now)
        self.report.stamps += 1
        return paced

    def _step(self, stamp_ns: int) -> bool:
        """Waits, held, until one message is granted or all go on; False when the playback is to end instead."""
        due = self._await_turn(stamp_ns)
        if due and self.pace.paused:
            self.pace.played(stamp_ns)
        return due

    def _give_way(self) -> None:
        """Stops publishing what a live node has begun to publish."""
        for topic in list(self._publishers_by_topic):
            if publishers_of_others(self, topic):
                self.get_logger().warning(f"{topic} is left to the node that publishes it now")
                self.destroy_publisher(self._publishers_by_topic.pop(topic))
                self.report.left_to_live_nodes.append(topic)

    def _await_answers(self, stamp_ns: int) -> None:
        missing = partial(self._answers.missing, stamp_ns)
        if missing():
            failure = f"no answer to stamp {stamp_ns} ns"
            self._wait(lambda: not missing(), failure, lambda: f" on {', '.join(missing())}")

    def _wait(self, condition: Callable[[], bool], failure: str, detail: Callable[[], str] = str) -> None:
        limit = time.monotonic() + self._options.patience
        while not condition() and not self._stopped():
            if time.monotonic() > limit:
                raise PlaybackError(f"{failure}{detail()} after {self._options.patience:g} s")
            self._spin(_SPIN)

    def _spin(self, seconds: float) -> None:
        assert self._executor is not None
        self._executor.spin_once(timeout_sec=seconds)
        self._listen()
