# SPDX-License-Identifier: Apache-2.0
"""Body rate from two successive Sun directions (O'Keefe & Schaub 2013, Eq. 15)."""

import math

from css_common.kernel import kernel
from css_common.vectors import Vec3, cross, dot, norm

# Below this sine the two directions are one, and their cross product has no direction.
_SAME_DIRECTION = 1e-12
# A shorter time [s] is none to divide by: the quotient overflows.
_SHORTEST = 1e-30


@kernel
def rate_from_sun_vectors(sun_b: Vec3, previous_sun_b: Vec3, dt: float, limit: float) -> Vec3:
    """Angular velocity omega_bn_b [rad/s] that turned the Sun from `previous_sun_b` to `sun_b` in `dt` [s].

    The Sun line is inertially fixed, so d(sun_b)/dt = sun_b x omega and the printed order, current x
    previous, gives +omega. Only the part normal to the Sun line shows. The angle comes from the arc
    tangent: the arc cosine of Eq. 15 loses half its digits at the small angles of one step.

    Args:
        sun_b, previous_sun_b: unit vectors in b.
        dt: time between them [s]; not above zero gives zero.
        limit: bound on each axis [rad/s].
    """
    axis = cross(sun_b, previous_sun_b)
    sine = norm(axis)
    if not (dt > 0.0 and sine > _SAME_DIRECTION):
        return (0.0, 0.0, 0.0)
    k = math.atan2(sine, dot(sun_b, previous_sun_b)) / (sine * max(dt, _SHORTEST))
    return (
        min(max(k * axis[0], -limit), limit),
        min(max(k * axis[1], -limit), limit),
        min(max(k * axis[2], -limit), limit),
    )
