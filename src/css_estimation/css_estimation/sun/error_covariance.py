# SPDX-License-Identifier: Apache-2.0
"""Covariance of the attitude filter's errors, and its propagation and update, in arrays that are written in place.

Errors are, in this order: attitude (rotation vector in b [rad], A_true = (I - [dtheta x]) A_estimated), gyro bias
[rad/s], then what else errs: slowly changing errors of the models (`slow_errors`), and for each cell what is
calibrated (`cell_calibration`). A measurement is one number at a time: numbers
whose errors are independent, taken in sequence with one linearisation, equal the stacked update, without a matrix
inverse (Crassidis & Junkins, Optimal Estimation of Dynamic Systems, sections 3.3 and 6.2).
"""

from typing import NamedTuple

import numpy as np

from css_common.kernel import kernel
from css_common.vectors import Mat3, Vec3, multiply
from css_estimation.symmetric import Symmetric

ATTITUDE, BIAS, FURTHER = 0, 3, 6
"""Where each kind of error begins."""

CORRECTION = 0
"""Row of the work array that holds the correction of the cycle."""
_PRODUCT, _GAIN = 1, 2


# Of a block. Loops over one go to this end whatever it holds: a compiled index into a tuple has a way out by an
# exception unless its bound is a constant.
_MOST_ERRORS = 3


class Block(NamedTuple):
    """Derivatives of one measured number to up to three errors that follow each other."""

    first: int  # index of the first
    errors: int  # how many, 0 to 3
    slopes: Vec3


class Partials(NamedTuple):
    """Derivatives of one measured number: to the attitude error, and to two blocks of further errors."""

    attitude: Vec3
    one: Block
    other: Block


def new_work(errors: int) -> np.ndarray:
    """Room (3, n) for the correction that a cycle gathers, and for the update of one number."""
    return np.zeros((3, errors))


@kernel
def attitude_block(covariance) -> Symmetric:
    """Covariance of the attitude error [rad^2]."""
    p = covariance
    return (p[0, 0], p[0, 1], p[0, 2], p[1, 1], p[1, 2], p[2, 2])


@kernel
def neglected_variance(covariance) -> float:
    """Variance of what the linear model of a direction leaves out, of second order in the attitude error.

    A unit vector turned by dtheta differs from its linear prediction by dtheta x (dtheta x s) / 2, of mean square
    between sigma^4 / 4 across s and 2 sigma^4 along it for an error of sigma about each axis; here sigma^4, as in a
    second-order filter (Bar-Shalom, Li & Kirubarajan, section 10.3). It keeps a filter that begins far off from
    believing that its first update has brought it close, and vanishes as it converges.
    """
    mean = (covariance[0, 0] + covariance[1, 1] + covariance[2, 2]) / 3.0
    return mean * mean


@kernel
def propagate(covariance, turn: Mat3, dt: float, angle_noise: float, bias_noise: float, with_gyro: bool) -> None:
    """P of the errors after `dt` [s], Phi P Phi^T + Q (Lefferts, Markley & Shuster 1982, to first order in dt).

    Args:
        turn: rotation of b over the step.
        angle_noise: [rad^2/s] white noise of the rate.
        bias_noise: [rad^2/s^3] walk of the gyro's bias.
        with_gyro: the rate was the gyro's, so that an error of its bias turned the attitude.
    """
    p = covariance
    n = p.shape[0]
    lever = dt if with_gyro else 0.0
    for j in range(n):
        a = multiply(turn, (p[0, j], p[1, j], p[2, j]))
        for i in range(3):
            p[i, j] = a[i] - lever * p[BIAS + i, j]
    for i in range(n):
        a = multiply(turn, (p[i, 0], p[i, 1], p[i, 2]))
        for j in range(3):
            p[i, j] = a[j] - lever * p[i, BIAS + j]
    for i in range(3):
        p[i, i] += angle_noise * dt + bias_noise * lever * lever * dt / 3.0
        p[i, BIAS + i] -= 0.5 * bias_noise * lever * dt
        p[BIAS + i, BIAS + i] += bias_noise * dt
    for i in range(3):
        for j in range(i + 1, n):
            p[j, i] = p[i, j]


@kernel
def begin_update(work) -> None:
    """No correction gathered yet."""
    for j in range(work.shape[1]):
        work[CORRECTION, j] = 0.0


@kernel
def no_block() -> Block:
    """No further errors."""
    return Block(0, 0, (0.0, 0.0, 0.0))


@kernel
def attitude_partials(attitude: Vec3) -> Partials:
    """Of a number in which nothing but the attitude errs."""
    return Partials(attitude, no_block(), no_block())


@kernel
def product_at(covariance, i: int, h: Partials) -> float:
    """Element `i` of P h: covariance of an error with the number that has the derivatives h."""
    p = covariance
    total = p[i, 0] * h.attitude[0] + p[i, 1] * h.attitude[1] + p[i, 2] * h.attitude[2]
    for k in range(_MOST_ERRORS):
        if k < h.one.errors:
            total += p[i, h.one.first + k] * h.one.slopes[k]
    for k in range(_MOST_ERRORS):
        if k < h.other.errors:
            total += p[i, h.other.first + k] * h.other.slopes[k]
    return total


@kernel
def covariance_of(covariance, a: Partials, b: Partials) -> float:
    """Covariance a^T P b of two numbers by the errors in both."""
    total = 0.0
    for k in range(3):
        total += a.attitude[k] * product_at(covariance, ATTITUDE + k, b)
    for k in range(_MOST_ERRORS):
        if k < a.one.errors:
            total += a.one.slopes[k] * product_at(covariance, a.one.first + k, b)
    for k in range(_MOST_ERRORS):
        if k < a.other.errors:
            total += a.other.slopes[k] * product_at(covariance, a.other.first + k, b)
    return total


@kernel
def innovate(covariance, work, h: Partials, residual: float, variance: float) -> tuple[float, float]:
    """Innovation of one number and its variance S; leaves g = P h in `work` for the update.

    Args:
        residual: measured less predicted with the state before any correction of this cycle.
    """
    for i in range(covariance.shape[0]):
        work[_PRODUCT, i] = product_at(covariance, i, h)
    innovation, s = residual, variance
    for i in range(3):
        innovation -= h.attitude[i] * work[CORRECTION, i]
        s += h.attitude[i] * work[_PRODUCT, i]
    for k in range(_MOST_ERRORS):
        if k < h.one.errors:
            innovation -= h.one.slopes[k] * work[CORRECTION, h.one.first + k]
            s += h.one.slopes[k] * work[_PRODUCT, h.one.first + k]
    for k in range(_MOST_ERRORS):
        if k < h.other.errors:
            innovation -= h.other.slopes[k] * work[CORRECTION, h.other.first + k]
            s += h.other.slopes[k] * work[_PRODUCT, h.other.first + k]
    return innovation, s


@kernel
def update(covariance, work, innovation: float, s: float, estimated: int) -> None:
    """Covariance and gathered correction after the number that `innovate` was called for.

    Joseph form for any gain k, (I - k h^T) P (I - k h^T)^T + R k k^T, multiplied out to
    P - k g^T - g k^T + S k k^T with g = P h: symmetric by construction and of second order in an error of the gain.

    Args:
        estimated: errors from this index on are considered, not estimated: their gain is zero, so that they keep
            their variance and count as a source of error (Schmidt-Kalman filter).
    """
    p, n = covariance, covariance.shape[0]
    for i in range(n):
        gain = work[_PRODUCT, i] / s if i < estimated else 0.0
        work[_GAIN, i] = gain
        work[CORRECTION, i] += gain * innovation
    for i in range(n):
        gain, product = work[_GAIN, i], work[_PRODUCT, i]
        for j in range(i, n):
            p[i, j] -= gain * work[_PRODUCT, j] + product * work[_GAIN, j] - s * gain * work[_GAIN, j]
            p[j, i] = p[i, j]


@kernel
def bound(covariance, largest) -> None:
    """Scale errors whose variance is above `largest` (n,) back to it; correlations stay."""
    p, n = covariance, covariance.shape[0]
    for i in range(n):
        if p[i, i] > largest[i]:
            factor = (largest[i] / p[i, i]) ** 0.5
            for j in range(n):
                p[i, j] *= factor
                p[j, i] *= factor
            p[i, i] = largest[i]


@kernel
def set_block(covariance, first: int, block: Symmetric) -> None:
    """Three errors from index `first` on have the covariance `block`, and nothing to do with the others."""
    p = covariance
    for i in range(first, first + 3):
        for j in range(p.shape[0]):
            p[i, j] = p[j, i] = 0.0
    p[first, first], p[first + 1, first + 1], p[first + 2, first + 2] = block[0], block[3], block[5]
    p[first, first + 1] = p[first + 1, first] = block[1]
    p[first, first + 2] = p[first + 2, first] = block[2]
    p[first + 1, first + 2] = p[first + 2, first + 1] = block[4]


@kernel
def set_single(covariance, i: int, variance: float) -> None:
    """One error has the variance, and nothing to do with the others."""
    for j in range(covariance.shape[0]):
        covariance[i, j] = covariance[j, i] = 0.0
    covariance[i, i] = variance


@kernel
def fade(covariance, i: int, factor: float, variance: float) -> None:
    """One error is multiplied by a factor, its correlations with it; then a variance of its own is added."""
    for j in range(covariance.shape[0]):
        covariance[i, j] *= factor
        covariance[j, i] *= factor
    covariance[i, i] += variance


@kernel
def mix(
    covariance, i: int, j: int, forward: tuple[float, float, float, float], lasting_i: float, lasting_j: float
) -> None:
    """Two errors are carried on by a 2 x 2 matrix (row by row), with the noise that keeps their variances in the end.

    Args:
        lasting_i, lasting_j: the variances P that they tend to, uncorrelated: the noise is P - F P F^T.
    """
    p, (a, b, c, d) = covariance, forward
    for k in range(p.shape[0]):
        p[i, k], p[j, k] = a * p[i, k] + b * p[j, k], c * p[i, k] + d * p[j, k]
    for k in range(p.shape[0]):
        p[k, i], p[k, j] = a * p[k, i] + b * p[k, j], c * p[k, i] + d * p[k, j]
    p[i, i] += lasting_i - (a * a * lasting_i + b * b * lasting_j)
    p[j, j] += lasting_j - (c * c * lasting_i + d * d * lasting_j)
    noise = -(a * c * lasting_i + b * d * lasting_j)
    p[i, j] += noise
    # symmetric to the last bit
    p[j, i] = p[i, j]
    for k in range(p.shape[0]):
        p[k, i], p[k, j] = p[i, k], p[j, k]
