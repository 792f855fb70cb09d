# SPDX-License-Identifier: Apache-2.0
"""The recorder's word to the plant: how far the flight is recorded."""

import time

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
        scripted = {event.node for event in mission.events if event.action == "deactivate"}
        self._silent_on_purpose = {
            node.resolve_topic_name(topic) for topic, name in mission.publishers.items() if name in scripted
        }
        self._hold_limit = mission.values.lockstep.hold_limit
        self._progress = RecordingProgress(spacing_ns, mission.epoch_ns, mission.period_ns, _TELL_EVERY)
        self._publisher = node.create_publisher(Header, PROGRESS_TOPIC, LOOP_PUBLISHER)
        self._timer = node.create_timer(_WATCH_EVERY, self._watch, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def note(self, topic: str, stamp_ns: int) -> None:
        """Takes the stamp of a message that is recorded."""
        self._tell(self._progress.note(topic, stamp_ns))

    def _watch(self) -> None:
        silent, progress = self._progress.give_up_silent(time.monotonic(), self._hold_limit, self._silent_on_purpose)
        for topic in silent:
            if topic not in self._silent_on_purpose:
                self._node.get_logger().error(f"{topic} is silent: the flight is recorded without it until it is back")
        self._tell(progress)

    def _tell(self, stamp_ns: int | None) -> None:
        if stamp_ns is not None:
            header = Header()
            header.stamp.sec, header.stamp.nanosec = divmod(stamp_ns, SECOND_NS)
            self._publisher.publish(header)
