# SPDX-License-Identifier: Apache-2.0
"""Bias of a gyro by a Kalman filter on what reference lines tell of its error, block by block."""

import math
from typing import NamedTuple

from css_common.kernel import kernel
from css_common.vectors import Mat3, Vec3, add, dot, scale, subtract
from css_estimation.symmetric import Symmetric, add_outer, inverse, inverse_form, isotropic, product

# One block in a crowd may say anything, as when a cell comes into view; a lasting error says it again.
_LARGEST_INNOVATION = 4.0  # [sigma]
_MEMORY = 10.0  # blocks of which the innovations are averaged


class Bias(NamedTuple):
    """Estimate and its consistency."""

    bias_b: Vec3  # [rad/s]
    covariance: Symmetric
    nis: float  # [-] normalised innovation squared per degree of freedom, averaged over the last blocks
    blocks: int  # since nothing was known


@kernel
def unknown_bias(variance: float) -> Bias:
    """Nothing known but the variance [rad2/s2] of what it may be."""
    return Bias((0.0, 0.0, 0.0), isotropic(variance), 1.0, 0)


@kernel
def walk(bias: Bias, variance: float, largest: float) -> Bias:
    """After some time in which each axis has walked by this variance [rad2/s2]; no axis gets less known than ever."""
    p = bias.covariance
    covariance = (
        min(p[0] + variance, largest),
        p[1],
        p[2],
        min(p[3] + variance, largest),
        p[4],
        min(p[5] + variance, largest),
    )
    return Bias(bias.bias_b, covariance, bias.nis, bias.blocks)


@kernel
def learn(bias: Bias, response: Mat3, difference: Vec3, variance: float, degrees: int) -> Bias:
    """After one block.

    Args:
        response: F of `reference_line`.
        difference: measured vector less the carried one.
        variance: of each of its components.
        degrees: how many of them can differ: 2 of a direction, 3 of a vector.
    """
    b, p = bias.bias_b, bias.covariance
    nis = 0.0
    for i in range(3):
        h = response[i]
        ph = product(p, h)
        s = dot(h, ph) + variance
        sigma = math.sqrt(s)
        innovation = difference[i] - dot(h, b)
        limit = _LARGEST_INNOVATION * sigma
        innovation = min(max(innovation, -limit), limit)
        nis += innovation * innovation / s
        b = add(b, scale(innovation / s, ph))
        p = add_outer(p, -1.0 / s, ph)
    nis /= degrees
    return Bias(b, p, bias.nis + (nis - bias.nis) / _MEMORY, bias.blocks + 1)


@kernel
def significance(bias: Bias, usual: float) -> float:
    """Chi-square (3) of the bias beyond what is usual, a variance [rad2/s2] per axis."""
    p = bias.covariance
    return inverse_form((p[0] + usual, p[1], p[2], p[3] + usual, p[4], p[5] + usual), bias.bias_b)


@kernel
def axis_significance(bias: Bias, axis: int, usual: float) -> float:
    """Chi-square (1) of the bias of one axis beyond what is usual."""
    variance = bias.covariance[0] if axis == 0 else bias.covariance[3] if axis == 1 else bias.covariance[5]
    return bias.bias_b[axis] * bias.bias_b[axis] / (variance + usual)


@kernel
def variance_along(bias: Bias, direction: Vec3) -> float:
    """Variance of the bias along a unit vector [rad2/s2]; along a line at rest in b, that of the beginning."""
    return dot(direction, product(bias.covariance, direction))


@kernel
def corrected(gyro_b: Vec3, bias: Bias, body: float) -> Vec3:
    """The rate that the body most likely has [rad/s], if all that is wrong with the gyro is its bias.

    Where nothing is known of the bias, as along a Sun line that stands still in b, the reading says nothing.

    Args:
        body: variance of the rate of a body of which nothing is known, per axis [rad2/s2].
    """
    p = bias.covariance
    total = (p[0] + body, p[1], p[2], p[3] + body, p[4], p[5] + body)
    return scale(body, product(inverse(total), subtract(gyro_b, bias.bias_b)))


@kernel
def after_jumps(jump_b: Vec3, usual: float, gate: float) -> Bias:
    """Bias of a gyro that was good until its axes jumped [rad/s].

    Args:
        usual: variance of the bias of a good gyro, per axis [rad2/s2].
        gate: variance of a jump [rad2/s2].
    """
    x, y, z = jump_b
    return Bias(
        jump_b,
        (
            usual + (gate if x != 0.0 else 0.0),
            0.0,
            0.0,
            usual + (gate if y != 0.0 else 0.0),
            0.0,
            usual + (gate if z != 0.0 else 0.0),
        ),
        1.0,
        0,
    )


@kernel
def jumped(bias: Bias, jump_b: Vec3, gate: float) -> Bias:
    """After the error has changed by jumps [rad/s] that are known to a variance [rad2/s2] on the axes that jumped."""
    p = bias.covariance
    x, y, z = jump_b
    covariance = (
        p[0] + (gate if x != 0.0 else 0.0),
        p[1],
        p[2],
        p[3] + (gate if y != 0.0 else 0.0),
        p[4],
        p[5] + (gate if z != 0.0 else 0.0),
    )
    return Bias(add(bias.bias_b, jump_b), covariance, bias.nis, bias.blocks)
