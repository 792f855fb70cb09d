# SPDX-License-Identifier: Apache-2.0
"""Three-axis rate gyro: constant bias, white noise, and the errors a real one has besides.

O'Keefe & Schaub 2013 give the constant bias (1 deg/h) and the white noise (0.01 deg/s per sample); the walk of the
bias, scale, misalignment, range and resolution are zero or absent unless asked for.
"""

import math
from typing import NamedTuple

from css_common.declared import builder, given, made, table_of
from css_common.kernel import kernel
from css_common.random_streams import RandomKey, Stream, normal4
from css_common.schema import real
from css_common.vectors import Mat3, Vec3, add, multiply
from css_sim.fault_effects import GYRO, spoil_axes
from css_sim.random_walk import random_walk
from css_sim.three_axes import draw_bias, read_out, reading_variance, with_noise

_RADIANS_PER_SECOND = math.pi / 180.0 / 3600.0

NOISE = real("noise_deg_s", 0.01, "deg/s", "1 sigma of the white noise of a sample", low=0.0, high=1e3, tunable=True)


def _per_second(rate_deg_h: float) -> float:
    return rate_deg_h * _RADIANS_PER_SECOND


class Gyro(NamedTuple):
    """Statistics and limits; rates in rad/s."""

    bias: float = made(
        _per_second, real("bias_deg_h", 1.0, "deg/h", "1 sigma of the constant bias, per axis", low=0.0, high=1e6)
    )
    noise: float = made(math.radians, NOISE)
    bias_walk: float = made(
        math.radians,
        real("bias_walk_deg_s", 0.0, "deg/s", "1 sigma of the change of bias from step to step", low=0.0, high=1.0),
    )
    scale_error: float = given(real("scale_error", 0.0, "-", "1 sigma of the scale error, per axis", low=0.0, high=1.0))
    misalignment: float = made(  # [rad]
        math.radians, real("misalignment_deg", 0.0, "deg", "1 sigma of each angle between axes", low=0.0, high=10.0)
    )
    range: float = made(
        math.radians, real("range_deg_s", 0.0, "deg/s", "largest rate it can read; 0: any", low=0.0, high=1e6)
    )
    resolution: float = made(
        math.radians, real("resolution_deg_s", 0.0, "deg/s", "step of its output; 0: continuous", low=0.0, high=1e3)
    )


PARAMETERS = table_of(Gyro)
parameters = builder(Gyro)


class GyroErrors(NamedTuple):
    """Errors of one case."""

    bias_b: Vec3  # [rad/s] at step 0
    response: Mat3  # what the axes make of the body rate


@kernel
def draw_errors(p: Gyro, key: RandomKey) -> GyroErrors:
    """Errors of one case: bias, scale and misalignment."""
    s = normal4(key, Stream.GYRO_BIAS, 0, 1)
    m = normal4(key, Stream.GYRO_BIAS, 0, 2)
    o = normal4(key, Stream.GYRO_BIAS, 0, 3)
    d, t = p.scale_error, p.misalignment
    response = (
        (1.0 + d * s[0], t * m[0], t * m[1]),
        (t * m[2], 1.0 + d * s[1], t * m[3]),
        (t * o[0], t * o[1], 1.0 + d * s[2]),
    )
    return GyroErrors(draw_bias(p.bias, key, Stream.GYRO_BIAS), response)


@kernel
def bias_at(p: Gyro, errors: GyroErrors, key: RandomKey, step: int) -> Vec3:
    """Bias at a control cycle [rad/s]."""
    b = errors.bias_b
    if p.bias_walk <= 0.0:
        return b
    walk = random_walk(key, Stream.GYRO_BIAS, 4, step)
    return (b[0] + p.bias_walk * walk[0], b[1] + p.bias_walk * walk[1], b[2] + p.bias_walk * walk[2])


@kernel
def read(p: Gyro, errors: GyroErrors, bias_b: Vec3, faults, key: RandomKey, step: int, omega_bn_b: Vec3) -> Vec3:
    """Measured body rate [rad/s] at a control cycle, with the bias of that cycle (`bias_at`) and faults (F,)."""
    rate = with_noise(p.noise, key, Stream.GYRO_NOISE, step, add(multiply(errors.response, omega_bn_b), bias_b))
    if faults.shape[0] > 0:
        rate = spoil_axes(faults, GYRO, key, step, rate)
    return read_out(p.resolution, p.range, rate)


@kernel
def measure(p: Gyro, errors: GyroErrors, faults, key: RandomKey, step: int, omega_bn_b: Vec3) -> Vec3:
    """Measured body rate [rad/s] at a control cycle; faults (F,) of `fault_effects.FAULT`."""
    return read(p, errors, bias_at(p, errors, key, step), faults, key, step, omega_bn_b)


def variance(p: Gyro) -> float:
    """Variance of a reading about the true rate [rad^2/s^2], per axis: noise, initial bias and rounding."""
    return reading_variance(p.noise, p.bias, p.resolution)
