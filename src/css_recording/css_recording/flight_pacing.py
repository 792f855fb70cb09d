# SPDX-License-Identifier: Apache-2.0
"""The recorder's word to the plant: how far the flight is recorded."""

import time
from collections.abc import Callable

from lifecycle_msgs.msg import State, TransitionEvent
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from std_msgs.msg import Header

from css_common.edge import HISTORY
from css_common.mission import Mission
from css_common.qos import LOOP_PUBLISHER, PROGRESS_TOPIC
from css_recording.recording_progress import RecordingProgress
from css_recording.second_buffer import SECOND_NS

_WATCH_EVERY = 0.5
_TELL_EVERY = HISTORY // 5  # steps: several of them fit into what a topic holds


class FlightPacing:
    """Publishes the progress of a recording, for the plant that waits for it."""

    def __init__(self, node: Node, mission: Mission) -> None:
        """Begins before the first step.

        Args:
            node: on whose behalf.
            mission: the flight.
        """
        self._node = node
        spacing_ns = {
            node.resolve_topic_name(name): output.divider * mission.period_ns
            for name, output in mission.outputs.items()
            if not output.events
        }
        self._topics_of: dict[str, set[str]] = {}
        for topic, name in mission.publishers.items():
            self._topics_of.setdefault(name, set()).add(node.resolve_topic_name(topic))
        scripted = {event.node for event in mission.events if event.action == "deactivate"}
        self._silent_on_purpose = {topic for name in scripted for topic in self._topics_of.get(name, ())}
        self._switched_off: set[str] = set()
        self._hold_limit = mission.values.lockstep.hold_limit
        self._progress = RecordingProgress(spacing_ns, mission.epoch_ns, mission.period_ns, _TELL_EVERY)
        self._publisher = node.create_publisher(Header, PROGRESS_TOPIC, LOOP_PUBLISHER)
        for name in self._topics_of.keys() - scripted:
            # an operator may take any node out of the flight
            node.create_subscription(TransitionEvent, f"{name}/transition_event", self._switcher(name), 10)
        self._timer = node.create_timer(_WATCH_EVERY, self._watch, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def note(self, topic: str, stamp_ns: int) -> None:
        """Takes the stamp of a message that is recorded."""
        self._tell(self._progress.note(topic, stamp_ns))

    def _switcher(self, name: str) -> Callable[[TransitionEvent], None]:
        def switch(event: TransitionEvent) -> None:
            if event.goal_state.id == State.PRIMARY_STATE_ACTIVE:
                self._switched_off -= self._topics_of[name]
            else:
                self._switched_off |= self._topics_of[name]

        return switch

    def _watch(self) -> None:
        on_purpose = self._silent_on_purpose | self._switched_off
        silent, progress = self._progress.give_up_silent(time.monotonic(), self._hold_limit, on_purpose)
        for topic in silent:
            if topic not in on_purpose:
                self._node.get_logger().error(f"{topic} is silent: the flight is recorded without it until it is back")
        self._tell(progress)

    def _tell(self, stamp_ns: int | None) -> None:
        if stamp_ns is not None:
            header = Header()
            header.stamp.sec, header.stamp.nanosec = divmod(stamp_ns, SECOND_NS)
            self._publisher.publish(header)
