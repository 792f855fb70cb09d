# SPDX-License-Identifier: Apache-2.0
"""Quality of service of the graph's topics, in one place."""

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from css_common.edge import HISTORY

LOOP_PUBLISHER = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=100,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
"""Topics of the control loop: a node that was restarted receives the stamp that waits for its answer."""

LOOP_SUBSCRIPTION = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=HISTORY,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)

RECORDER_SUBSCRIPTION = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=10_000,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
"""Deep, because a recorder may stall on its disk and must not lose a message for it."""
