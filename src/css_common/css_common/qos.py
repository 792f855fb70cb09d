# SPDX-License-Identifier: Apache-2.0
"""Quality of service of the graph's topics, in one place."""

from collections.abc import Iterable

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo

from css_common.edge import HISTORY

LOOP_PUBLISHER = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=HISTORY,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
"""Topics of the control loop: a node that was restarted receives the stamp that waits for its answer."""

RECORDER = "recorder"
"""Name of the node that records a flight."""

PROGRESS_TOPIC = f"{RECORDER}/progress"
"""`std_msgs/Header`: the stamp up to which the recorder of a flight has every message."""

LOOP_SUBSCRIPTION = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=10 * HISTORY,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
"""Deep, because all writers of a topic share it: a stranger that floods it must not push out what is waiting."""

RECORDER_SUBSCRIPTION = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=10_000,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
"""Deep, because a recorder may stall on its disk and must not lose a message for it."""


def matching_qos(publishers: Iterable[TopicEndpointInfo], depth: int) -> QoSProfile:
    """The strictest subscription that matches every one of the publishers.

    A reliable or latched subscription is not matched by a publisher that offers less: a driver that publishes
    with best effort would be silently left out.
    """
    offered = [publisher.qos_profile for publisher in publishers]
    reliable = all(qos.reliability != ReliabilityPolicy.BEST_EFFORT for qos in offered)
    latched = all(qos.durability == DurabilityPolicy.TRANSIENT_LOCAL for qos in offered)
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )
