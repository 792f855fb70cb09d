# SPDX-License-Identifier: Apache-2.0
"""The error of the heading as the Sun filter reports it: its own covariance, and what lasts too long to be noise."""

from css_common.kernel import kernel
from css_common.matrices import skew
from css_common.vectors import Vec3, matmul, multiply, transpose
from css_estimation.sun.sun_heading import Covariance
from css_estimation.sun_filter.memory import attitude_block, dcm_of
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
def heading_covariance(p: SunFilterParameters, x, covariance, sun_n: Vec3, earth_known: bool) -> Covariance:
    """Covariance of the heading in b, row-major."""
    # ds_b = dcm_bn (s x theta)
    turn = matmul(dcm_of(x), skew(sun_n))
    c = matmul(matmul(turn, attitude_block(covariance)), transpose(turn))
    lasting = p.earth.clouded_heading if earth_known else p.earth.unknown_heading
    systematic = across(multiply(dcm_of(x), sun_n), lasting)
    # what is beyond a bound is cut as a whole, so that it stays a covariance
    cut = min(1.0, LARGEST / max(c[0][0], c[1][1], c[2][2], LARGEST))
    xx, yy, zz = cut * c[0][0], cut * c[1][1], cut * c[2][2]
    xy, xz, yz = 0.5 * cut * (c[0][1] + c[1][0]), 0.5 * cut * (c[0][2] + c[2][0]), 0.5 * cut * (c[1][2] + c[2][1])
    return (
        xx + systematic[0], xy + systematic[1], xz + systematic[2],
        xy + systematic[1], yy + systematic[4], yz + systematic[5],
        xz + systematic[2], yz + systematic[5], zz + systematic[8],
    )  # fmt: skip


@kernel
def mean_variance(covariance: Covariance) -> float:
    """Mean variance of the two axes across the Sun line."""
    return 0.5 * (covariance[0] + covariance[4] + covariance[8])
