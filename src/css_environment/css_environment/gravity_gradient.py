# SPDX-License-Identifier: Apache-2.0
"""Torque of the Earth's gravity gradient, which truth and estimators share."""

from css_common.kernel import kernel
from css_common.vectors import Mat3, Vec3, cross, multiply, norm, scale
from css_environment.constants import EARTH_MU


@kernel
def gravity_gradient_torque(inertia: Mat3, r_b: Vec3) -> Vec3:
    """Torque [N m] at the position `r_b` [m] from the centre of the Earth, in b (Wertz, section 17.2)."""
    r = norm(r_b)
    u = scale(1.0 / r, r_b)
    return scale(3.0 * EARTH_MU / (r * r * r), cross(u, multiply(inertia, u)))
