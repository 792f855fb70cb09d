# SPDX-License-Identifier: Apache-2.0
"""How the body follows an error of the heading: the linear loop of the control about the Sun."""

from typing import NamedTuple, Self

import numpy as np

from css_common.kernel import kernel
from css_common.mission import Mission
from css_common.vectors import Mat3, mat3
from css_monte_carlo.mission_parts import parts_of
from sunpoint_control.nodes.mrp_control import MrpControl


class Follower(NamedTuple):
    """The loop I theta'' = -P theta' - K/4 (theta - error) with the gains of a mission."""

    inverse: Mat3  # [1/(kg m^2)] of the inertia
    k: float  # [N m]
    p: float  # [N m s]
    period: float  # [s]

    @classmethod
    def of(cls, mission: Mission) -> Self | None:
        """That of a mission; None: its control is no linear loop about the Sun."""
        control = parts_of(mission).control
        if control is None or not issubclass(control.component, MrpControl) or control.values.deadband_deg > 0.0:
            return None
        inertia = np.asarray(mission.values.spacecraft.inertia)
        gains = control.values.gains
        return cls(mat3(np.linalg.inv(inertia)), gains.k, gains.p, mission.values.mission.period)

    def follow(self, errors: np.ndarray, active: np.ndarray) -> np.ndarray:
        """Rotations (M, 3) [rad] of the body under errors (M, 3) of the heading; it rests where not active (M,)."""
        turned = np.zeros_like(errors)
        _follow(self.inverse, self.k, self.p, self.period, errors, active, turned)
        return turned


@kernel
def _follow(inverse: Mat3, k: float, p: float, h: float, errors, active, out) -> None:
    tx, ty, tz = 0.0, 0.0, 0.0
    wx, wy, wz = 0.0, 0.0, 0.0
    for i in range(errors.shape[0]):
        if not active[i]:
            tx, ty, tz, wx, wy, wz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            continue
        out[i, 0], out[i, 1], out[i, 2] = tx, ty, tz
        ux = -p * wx - 0.25 * k * (tx - errors[i, 0])
        uy = -p * wy - 0.25 * k * (ty - errors[i, 1])
        uz = -p * wz - 0.25 * k * (tz - errors[i, 2])
        ax = inverse[0][0] * ux + inverse[0][1] * uy + inverse[0][2] * uz
        ay = inverse[1][0] * ux + inverse[1][1] * uy + inverse[1][2] * uz
        az = inverse[2][0] * ux + inverse[2][1] * uy + inverse[2][2] * uz
        # held over the cycle, as the wheels hold a command
        tx, ty, tz = tx + h * wx + 0.5 * h * h * ax, ty + h * wy + 0.5 * h * h * ay, tz + h * wz + 0.5 * h * h * az
        wx, wy, wz = wx + h * ax, wy + h * ay, wz + h * az
