# SPDX-License-Identifier: Apache-2.0
"""Three-axis magnetometer: bias, white noise, resolution and range on the field in the body frame."""

from typing import NamedTuple

from css_common.conversions import tesla
from css_common.declared import builder, made, table_of
from css_common.kernel import kernel
from css_common.random_streams import RandomKey, Stream
from css_common.schema import real
from css_common.vectors import Vec3, add
from css_sim import three_axes
from css_sim.fault_effects import MAGNETOMETER, spoil_axes
from css_sim.three_axes import read_out, reading_variance, with_noise

NOISE = real("noise_nt", 200.0, "nT", "1 sigma of the white noise of a sample", low=0.0, high=1e6, tunable=True)


class Magnetometer(NamedTuple):
    """Statistics and limits [T]."""

    bias: float = made(tesla, real("bias_nt", 0.0, "nT", "1 sigma of the constant bias, per axis", low=0.0, high=1e6))
    noise: float = made(tesla, NOISE)
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
    return three_axes.draw_bias(p.bias, key, Stream.MAGNETOMETER_BIAS)


@kernel
def measure(p: Magnetometer, bias_b: Vec3, faults, key: RandomKey, step: int, field_b: Vec3) -> Vec3:
    """Measured field [T] at a control cycle; faults (F,) of `fault_effects.FAULT`."""
    field_b = with_noise(p.noise, key, Stream.MAGNETOMETER_NOISE, step, add(field_b, bias_b))
    if faults.shape[0] > 0:
        field_b = spoil_axes(faults, MAGNETOMETER, key, step, field_b)
    return read_out(p.resolution, p.range, field_b)


def variance(p: Magnetometer) -> float:
    """Variance of a reading about the true field [T^2], per axis: noise, bias and rounding."""
    return reading_variance(p.noise, p.bias, p.resolution)
