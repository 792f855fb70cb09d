# SPDX-License-Identifier: Apache-2.0
"""What one cycle of a control law decided, whatever law it is; see css_msgs/ControlStatus."""

from typing import NamedTuple

from css_common.vectors import Vec3

_ZERO: Vec3 = (0.0, 0.0, 0.0)


class ControlOutput(NamedTuple):
    """What one cycle decided; see css_msgs/ControlStatus."""

    torque_b: Vec3  # [N m] asked of the wheels, or of the rods where there is no control with wheels, on the body
    integral: Vec3  # [N m s] z of the control law
    wheel_momentum_b: Vec3  # [N m s]
    pointing_error: float  # [rad] -1: no Sun known
    rate: float  # [rad/s]
    mode: int
    reason: int
    deadband: bool
    dumping: bool
    wheels_saturated: int  # bit i: wheel i was asked for more than it may give
    rods_saturated: int  # bit i: rod i was asked for more than it may give
    wheels_isolated: int  # bit i: wheel i is held for failed
    rods_isolated: int  # bit i: rod i is


def at_rest(mode: int, reason: int) -> ControlOutput:
    """Output of a control that does nothing: no torque, nothing known."""
    return ControlOutput(_ZERO, _ZERO, _ZERO, -1.0, 0.0, mode, reason, False, False, 0, 0, 0, 0)
