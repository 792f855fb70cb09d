# SPDX-License-Identifier: Apache-2.0
"""The heading as the Sun filter reports it, with its error: that of all turns it follows, and of an unknown Earth."""

import math

from css_common.kernel import kernel
from css_common.matrices import skew
from css_common.vectors import Vec3, add, matmul, multiply, scale, subtract, transpose, unit
from css_estimation.sun.sun_heading import Covariance
from css_estimation.sun_filter.memory import DEAD, HYPOTHESES, SunFilterMemory, attitude_block, dcm_of
from css_estimation.sun_filter.options import SunFilterParameters

LARGEST = 4.0
"""Reported variance [rad2] of a heading of which nothing is known."""


@kernel
def across(sun: Vec3, variance: float) -> Covariance:
    """Equal variance on both axes across the Sun line, row-major."""
    x, y, z = sun
    return (
        variance * (1.0 - x * x), -variance * x * y, -variance * x * z,
        -variance * x * y, variance * (1.0 - y * y), -variance * y * z,
        -variance * x * z, -variance * y * z, variance * (1.0 - z * z),
    )  # fmt: skip


@kernel
def heading(p: SunFilterParameters, m: SunFilterMemory, sun_n: Vec3, earth_known: bool) -> tuple[Vec3, Covariance]:
    """Direction to the Sun in b and its covariance, row-major: of all hypotheses that are followed, by their weights.

    Where they disagree about the Sun the disagreement is part of the covariance.
    """
    total, sun_b = 0.0, (0.0, 0.0, 0.0)
    for k in range(HYPOTHESES):
        if m.weights[k] > DEAD:
            weight = math.exp(m.weights[k])
            total += weight
            sun_b = add(sun_b, scale(weight, multiply(dcm_of(m.estimates[k]), sun_n)))
    sun_b = unit(sun_b)
    xx = yy = zz = xy = xz = yz = 0.0
    for k in range(HYPOTHESES):
        if not m.weights[k] > DEAD:
            continue
        weight = math.exp(m.weights[k]) / total
        # ds_b = dcm_bn (s x theta)
        dcm_bn = dcm_of(m.estimates[k])
        turn = matmul(dcm_bn, skew(sun_n))
        c = matmul(matmul(turn, attitude_block(m.covariances[k])), transpose(turn))
        off = subtract(multiply(dcm_bn, sun_n), sun_b)
        xx += weight * (c[0][0] + off[0] * off[0])
        yy += weight * (c[1][1] + off[1] * off[1])
        zz += weight * (c[2][2] + off[2] * off[2])
        xy += weight * (0.5 * (c[0][1] + c[1][0]) + off[0] * off[1])
        xz += weight * (0.5 * (c[0][2] + c[2][0]) + off[0] * off[2])
        yz += weight * (0.5 * (c[1][2] + c[2][1]) + off[1] * off[2])
    # what is beyond a bound is cut as a whole, so that it stays a covariance
    cut = min(1.0, LARGEST / max(xx, yy, zz, LARGEST))
    systematic = across(sun_b, 0.0 if earth_known else p.earth.unknown_heading)
    return sun_b, (
        cut * xx + systematic[0], cut * xy + systematic[1], cut * xz + systematic[2],
        cut * xy + systematic[1], cut * yy + systematic[4], cut * yz + systematic[5],
        cut * xz + systematic[2], cut * yz + systematic[5], cut * zz + systematic[8],
    )  # fmt: skip


@kernel
def mean_variance(covariance: Covariance) -> float:
    """Mean variance of the two axes across the Sun line."""
    return 0.5 * (covariance[0] + covariance[4] + covariance[8])
