# SPDX-License-Identifier: Apache-2.0
"""Is the error of a gyro one that no constant bias explains, and of which axis: one that goes with the rate, or drifts.

Least squares of the differences d of `reference_line`: d = F b + x phi, with a bias b on all axes and one shape phi
more, of one axis i: G_i (an error that is x times what the axis reads), or t F_i (one that grows by x). What a shape
takes from the sum of squares once the biases have taken their part is a chi-square of one degree of freedom where the
gyro is right but for its bias (Schur complement; the generalised likelihood ratio of Willsky and Jones).
"""

from typing import NamedTuple

import numpy as np

from css_common.health import KIND_DRIFTING, KIND_SCALED, KIND_SIGN
from css_common.kernel import kernel
from css_common.vectors import Mat3, Vec3, dot
from css_estimation.symmetric import Symmetric, inverse, product

# A wrong sign makes an error of twice the reading: how near it must be to that, in sigma and at least.
_SIGN, _SIGN_SIGMAS, _SIGN_WIDTH = 2.0, 3.0, 0.3
_LARGEST_INNOVATION = 4.0  # [sigma]
_ROUNDING = 1e-9

_SHAPES = 6
BIASES = _SHAPES
"""Row of the biases in the normal equations; those before it: scale of x, y, z, drift of x, y, z."""

FIT = np.dtype([(name, np.float64) for name in ("xx", "xy", "xz", "yy", "yz", "zz", "x", "y", "z")], align=True)
"""Normal equations. Of the biases: matrix and right side. Of a shape: right side x, y, z is what it has in common with
the biases, xx its own square and xy what it has in common with d."""


class Shape(NamedTuple):
    """What an error looks like most that is no bias."""

    axis: int
    drifts: bool  # it grows; else it goes with the rate
    statistic: float  # [-] chi-square of one degree of freedom
    value: float  # [-] error over reading, or [rad/s2]
    variance: float


NO_SHAPE = Shape(0, False, 0.0, 0.0, np.inf)
"""Nothing but biases."""


def new_fits() -> np.ndarray:
    """Nothing known."""
    return np.zeros(_SHAPES + 1, FIT)


@kernel
def forget_fits(fits) -> None:
    """Nothing known any more."""
    for i in range(fits.shape[0]):
        f = fits[i]
        f.xx = f.xy = f.xz = f.yy = f.yz = f.zz = f.x = f.y = f.z = 0.0


@kernel
def add_block(fits, by_bias: Mat3, by_scale: Mat3, difference: Vec3, variance: float, time: float, kept: float) -> None:
    """Adds one block to the normal equations (7,).

    Args:
        by_bias, by_scale: F and G of `reference_line`.
        difference, variance: as of `gyro_bias.learn`.
        time: [s] since the equations were empty.
        kept: share of what they held that is not forgotten.
    """
    square = dot(difference, difference)
    # a block that is off by more than anything usual is heard, but not louder than that
    weight = 1.0 / max(variance, square / (_LARGEST_INNOVATION * _LARGEST_INNOVATION))
    f, g, d = by_bias, by_scale, difference
    for s in range(_SHAPES + 1):
        e = fits[s]
        e.xx, e.xy, e.xz, e.yy, e.yz, e.zz = (
            kept * e.xx,
            kept * e.xy,
            kept * e.xz,
            kept * e.yy,
            kept * e.yz,
            kept * e.zz,
        )
        e.x, e.y, e.z = kept * e.x, kept * e.y, kept * e.z
    e = fits[BIASES]
    for j in range(3):
        h, w = f[j], weight
        e.xx, e.xy, e.xz = e.xx + w * h[0] * h[0], e.xy + w * h[0] * h[1], e.xz + w * h[0] * h[2]
        e.yy, e.yz, e.zz = e.yy + w * h[1] * h[1], e.yz + w * h[1] * h[2], e.zz + w * h[2] * h[2]
        e.x, e.y, e.z = e.x + w * h[0] * d[j], e.y + w * h[1] * d[j], e.z + w * h[2] * d[j]
    for s in range(_SHAPES):
        e = fits[s]
        for j in range(3):
            phi = g[j][s] if s < 3 else time * f[j][s - 3]
            w = weight * phi
            e.xx += w * phi
            e.xy += w * d[j]
            e.x, e.y, e.z = e.x + w * f[j][0], e.y + w * f[j][1], e.z + w * f[j][2]


@kernel
def _bias_covariance(fits, largest_bias: float) -> Symmetric:
    b = fits[BIASES]
    prior = 1.0 / largest_bias
    return inverse((b.xx + prior, b.xy, b.xz, b.yy + prior, b.yz, b.zz + prior))


@kernel
def _value(fits, s: int, covariance: Symmetric) -> tuple[float, float]:
    """Least-squares value of a shape beside the biases, and its variance; infinite where they cannot be told apart."""
    b, e = fits[BIASES], fits[s]
    common = (e.x, e.y, e.z)
    taken = product(covariance, common)
    information = e.xx - dot(taken, common)
    # what rounding leaves of a shape that is one with a bias
    if not information > _ROUNDING * e.xx:
        return 0.0, np.inf
    return (e.xy - dot(taken, (b.x, b.y, b.z))) / information, 1.0 / information


@kernel
def best_shape(fits, drifts: bool, largest_bias: float, usual: float) -> Shape:
    """The axis whose shape of a sort takes most from the sum of squares once the biases have taken their part.

    Args:
        fits: (7,) of FIT.
        drifts: an error that grows; else one that goes with the rate.
        largest_bias: variance [rad2/s2] of a bias before anything is known.
        usual: variance of the value of a good gyro.
    """
    covariance = _bias_covariance(fits, largest_bias)
    best = NO_SHAPE
    for axis in range(3):
        value, variance = _value(fits, axis + 3 if drifts else axis, covariance)
        statistic = value * value / (variance + usual)
        if statistic > best.statistic:
            best = Shape(axis, drifts, statistic, value, variance)
    return best


@kernel
def wrong_sign(fits, largest_bias: float, threshold: float, margin: float) -> Shape:
    """The axis whose error is twice its reading, where that alone explains as much as biases on all axes do.

    Args:
        threshold: least that it must take from the sum of squares.
        margin: by how much three biases may explain more.
    """
    covariance = _bias_covariance(fits, largest_bias)
    b = fits[BIASES]
    right = (b.x, b.y, b.z)
    least = max(threshold, dot(right, product(covariance, right)) - margin)
    best = NO_SHAPE
    for axis in range(3):
        e = fits[axis]
        # |d|^2 - |d - 2 phi|^2
        taken = 4.0 * (e.xy - e.xx)
        if taken > max(least, best.statistic):
            best = Shape(axis, False, taken, _SIGN, 1.0 / e.xx)
    return best


@kernel
def refutes(fits, claim: Shape, largest_bias: float, usual: float, sigmas2: float) -> bool:
    """Whether an axis whose error once went with its rate shows that it does so no longer.

    Args:
        claim: what it was.
        usual: variance of the scale of a good gyro.
        sigmas2: square of how many sigma its scale must be from what it was, and may be from none.
    """
    value, variance = _value(fits, claim.axis, _bias_covariance(fits, largest_bias))
    off = value - claim.value
    return off * off > sigmas2 * (variance + claim.variance) and value * value < sigmas2 * (variance + usual)


@kernel
def sign_of_axis(axis: int, sigma: float) -> Shape:
    """A wrong sign of an axis that is known to `sigma` of its reading."""
    return Shape(axis, False, 1.0, _SIGN, sigma * sigma)


@kernel
def is_motion(shape: Shape) -> bool:
    """Whether an error that goes with the rate is one of the rate, and not all that an axis reads of a body at rest."""
    return abs(shape.value - 1.0) > _SIGN_WIDTH


@kernel
def kind_of(shape: Shape) -> int:
    """`KIND_*` of css_msgs/Faults that a shape is."""
    if shape.drifts:
        return KIND_DRIFTING
    width = max(_SIGN_WIDTH, _SIGN_SIGMAS * np.sqrt(shape.variance))
    return KIND_SIGN if abs(shape.value - _SIGN) < width else KIND_SCALED
