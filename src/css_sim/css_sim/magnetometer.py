# SPDX-License-Identifier: Apache-2.0
"""Three-axis magnetometer: bias, white noise, resolution and range on the field in the body frame."""

import math
from typing import NamedTuple

from css_common.conversions import tesla
from css_common.declared import builder, made, table_of
from css_common.kernel import kernel
from css_common.random_streams import RandomKey, Stream, normal4
from css_common.schema import real
from css_common.vectors import Vec3, scale


class Magnetometer(NamedTuple):
    """Statistics and limits [T]."""

    bias: float = made(tesla, real("bias_nt", 0.0, "nT", "1 sigma of the constant bias, per axis", low=0.0, high=1e6))
    noise: float = made(
        tesla, real("noise_nt", 200.0, "nT", "1 sigma of the white noise of a sample", low=0.0, high=1e6)
    )
    resolution: float = made(
        tesla, real("resolution_nt", 0.0, "nT", "step of its output; 0: continuous", low=0.0, high=1e6)
    )
    range: float = made(
        tesla, real("range_nt", 0.0, "nT", "largest field component it can read; 0: any", low=0.0, high=1e9)
    )


PARAMETERS = table_of(Magnetometer)
parameters = builder(Magnetometer)


@kernel
def draw_bias(p: Magnetometer, key: RandomKey) -> Vec3:
    """Bias of one case [T]."""
    n = normal4(key, Stream.MAGNETOMETER_BIAS, 0, 0)
    return scale(p.bias, (n[0], n[1], n[2]))


@kernel
def _read_out(p: Magnetometer, field: float) -> float:
    if p.resolution > 0.0:
        field = p.resolution * math.floor(field / p.resolution + 0.5)
    if p.range > 0.0:
        field = min(max(field, -p.range), p.range)
    return field


@kernel
def measure(p: Magnetometer, bias_b: Vec3, key: RandomKey, step: int, field_b: Vec3) -> Vec3:
    """Measured field [T] at a control cycle."""
    x, y, z = field_b[0] + bias_b[0], field_b[1] + bias_b[1], field_b[2] + bias_b[2]
    if p.noise > 0.0:
        n = normal4(key, Stream.MAGNETOMETER_NOISE, step, 0)
        x += p.noise * n[0]
        y += p.noise * n[1]
        z += p.noise * n[2]
    return (_read_out(p, x), _read_out(p, y), _read_out(p, z))


def variance(p: Magnetometer) -> float:
    """Variance of a reading about the true field [T^2], per axis: noise, bias and rounding."""
    return p.noise**2 + p.bias**2 + p.resolution**2 / 12.0
