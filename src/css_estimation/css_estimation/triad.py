# SPDX-License-Identifier: Apache-2.0
"""Attitude from two directions known in both frames (TRIAD), with its covariance (Shuster & Oh 1981)."""

from css_common.kernel import kernel
from css_common.vectors import Mat3, Vec3, cross, dot, matmul, norm, scale, transpose
from css_estimation.symmetric import Symmetric, add_outer, isotropic, subtract_pair

LEAST_SINE = 0.1
"""Sine of the angle between the directions below which they are too close to one line to give an attitude."""


@kernel
def triad(primary_b: Vec3, secondary_b: Vec3, primary_n: Vec3, secondary_n: Vec3) -> tuple[bool, Mat3]:
    """Whether the directions fix an attitude, and dcm_bn.

    Of the secondary direction only the part across the primary one counts, so the more accurate one is to be first.

    Args:
        primary_b, secondary_b: measured, unit vectors.
        primary_n, secondary_n: the same directions from models.
    """
    across_b, across_n = cross(primary_b, secondary_b), cross(primary_n, secondary_n)
    length_b, length_n = norm(across_b), norm(across_n)
    if not (length_b > LEAST_SINE and length_n > LEAST_SINE):
        return False, ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    across_b, across_n = scale(1.0 / length_b, across_b), scale(1.0 / length_n, across_n)
    body = (primary_b, across_b, cross(primary_b, across_b))
    reference = (primary_n, across_n, cross(primary_n, across_n))
    return True, matmul(transpose(body), reference)


@kernel
def triad_covariance(primary_b: Vec3, secondary_b: Vec3, primary_sigma: float, secondary_sigma: float) -> Symmetric:
    """Covariance of the attitude error (rotation vector in b) [rad^2] of `triad` (Shuster & Oh 1981).

    P = s1^2 I + [s1^2 (w1.w2)(w1 w2^T + w2 w1^T) + (s2^2 - s1^2) w1 w1^T] / |w1 x w2|^2

    Args:
        primary_sigma, secondary_sigma: error of each direction about each axis across it [rad].
    """
    w1, w2 = primary_b, secondary_b
    across = cross(w1, w2)
    inverse = 1.0 / dot(across, across)
    first, second = primary_sigma * primary_sigma, secondary_sigma * secondary_sigma
    p = subtract_pair(isotropic(first), w1, scale(-first * dot(w1, w2) * inverse, w2))
    return add_outer(p, (second - first) * inverse, w1)
