# SPDX-License-Identifier: Apache-2.0
"""Attitude from two directions known in both frames (TRIAD), with its covariance (Shuster & Oh 1981)."""

from css_common.kernel import kernel
from css_common.vectors import Mat3, Vec3, cross, dot, matmul, norm, scale, transpose
from css_estimation.symmetric import Symmetric, add_outer, congruence, isotropic, product, subtract_pair

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


@kernel
def triad_covariance_of(primary_b: Vec3, secondary_b: Vec3, primary: Symmetric, secondary: Symmetric) -> Symmetric:
    """Covariance of the attitude error (rotation vector in b) [rad^2] of `triad`, for directions of any covariance.

    To first order in the errors e1, e2 of the directions, with t2 = unit(w1 x w2) and g the angle between them, the
    attitude errs by w1 x e1 + w1 (e2.t2 - cos g e1.t2) / sin g; for errors alike in all directions this is
    `triad_covariance`.

    Args:
        primary, secondary: covariance of each unit vector in b [rad^2].
    """
    w1 = primary_b
    across = cross(w1, secondary_b)
    sine, cosine = norm(across), dot(w1, secondary_b)
    t2 = scale(1.0 / sine, across)
    lever = scale(-cosine / sine, t2)
    jacobian = (
        (w1[0] * lever[0], w1[0] * lever[1] - w1[2], w1[0] * lever[2] + w1[1]),
        (w1[1] * lever[0] + w1[2], w1[1] * lever[1], w1[1] * lever[2] - w1[0]),
        (w1[2] * lever[0] - w1[1], w1[2] * lever[1] + w1[0], w1[2] * lever[2]),
    )
    about = dot(t2, product(secondary, t2)) / (sine * sine)
    return add_outer(congruence(jacobian, primary), about, w1)
