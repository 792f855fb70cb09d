# SPDX-License-Identifier: Apache-2.0
"""Health of a node on /diagnostics, once a second of the wall clock."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from css_common.supervised import beat

_PERIOD_S = 1.0


class Health(NamedTuple):
    """How a node is.

    Attributes:
        level: `DiagnosticStatus.OK`, `WARN` or `ERROR`.
        message: one line.
        counters: what it has counted since its start, and what its component measures of a device.
        stamp_ns: simulated time of its last cycle [ns since 1970 UTC].
        left_out: names of the units that it holds for failed.
    """

    level: bytes
    message: str
    counters: Mapping[str, int | float]
    stamp_ns: int
    left_out: tuple[str, ...] = ()


class Diagnostics:
    """Publishes what `health` says; keep it for as long as the node lives."""

    def __init__(self, node: Node, health: Callable[[], Health]) -> None:
        """Begins to publish.

        Args:
            node: whose health it is.
            health: asked once a second.
        """
        self._node = node
        self._health = health
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._timer = node.create_timer(_PERIOD_S, self._publish, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _publish(self) -> None:
        beat()
        level, message, counters, stamp_ns, left_out = self._health()
        array = DiagnosticArray()
        array.header.stamp.sec, array.header.stamp.nanosec = divmod(stamp_ns, 1_000_000_000)
        array.status = [
            DiagnosticStatus(
                level=level,
                name=self._node.get_fully_qualified_name(),
                message=message,
                hardware_id="",
                values=[
                    *(KeyValue(key=key, value=str(value)) for key, value in counters.items()),
                    *([KeyValue(key="left_out", value=", ".join(left_out))] if left_out else []),
                ],
            )
        ]
        self._publisher.publish(array)
