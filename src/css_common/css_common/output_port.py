# SPDX-License-Identifier: Apache-2.0
"""One topic that a node publishes, and what it published there last."""

import copy
from collections import deque

from rclpy.node import Node
from rclpy.qos_overriding_options import QoSOverridingOptions

from css_common.component import Output
from css_common.qos import LOOP_PUBLISHER

RECENT = 12


class OutputPort:
    """A publisher of serialised messages.

    Attributes:
        topic: as the component names it.
        full_name: as the graph has it.
        publisher: the one of rclpy.
        recent: the last messages, the oldest first. Another thread may copy it at any time.
    """

    def __init__(self, node: Node, output: Output, overriding: QoSOverridingOptions) -> None:
        """Begins to publish."""
        self.topic = output.topic
        self.publisher = node.create_publisher(
            output.message_type,
            output.topic,
            copy.copy(LOOP_PUBLISHER),  # rclpy writes overrides into the profile that it is given
            qos_overriding_options=overriding,
        )
        self.full_name: str = self.publisher.topic_name
        self.recent: deque[bytes] = deque(maxlen=RECENT)

    def publish(self, data: bytes) -> None:
        """Publishes a message."""
        self.recent.append(data)
        self.publisher.publish(data)
