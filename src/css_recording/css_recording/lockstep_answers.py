# SPDX-License-Identifier: Apache-2.0
"""Which stamps the topics have answered that a playback in lockstep waits for."""

from collections.abc import Sequence
from functools import partial

from rclpy.node import Node
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo

from css_common.codec import stamp_of
from css_common.qos import LOOP_SUBSCRIPTION, matching_qos
from css_recording.ros_topics import message_class_of


class LockstepAnswers:
    """Answers to the stamps of a playback; false while no topic is listened to."""

    def __init__(self, node: Node) -> None:
        """Listens to nothing yet.

        Args:
            node: that subscribes.
        """
        self._node = node
        self._answered: dict[str, int] = {}

    def __bool__(self) -> bool:
        return bool(self._answered)

    def listen_to(self, topic: str, publishers: Sequence[TopicEndpointInfo]) -> Subscription:
        """Subscribes to a topic that answers.

        Args:
            topic: its full name.
            publishers: that it has, at least one.

        Raises:
            BagError: its type is not installed.
        """
        self._answered[topic] = -1
        return self._node.create_subscription(
            message_class_of(publishers[0].topic_type),
            topic,
            partial(self._note, topic),
            matching_qos(publishers, LOOP_SUBSCRIPTION.depth),
            raw=True,
        )

    def forget(self) -> None:
        """Begins anew: a playback that loops asks for the same stamps again."""
        self._answered = dict.fromkeys(self._answered, -1)

    def missing(self, stamp_ns: int) -> list[str]:
        """Topics that have not answered a stamp."""
        return [topic for topic, answered in self._answered.items() if answered < stamp_ns]

    def _note(self, topic: str, data: bytes) -> None:
        self._answered[topic] = stamp_of(data)
