# SPDX-License-Identifier: Apache-2.0
"""What all sensors of three axes do to a vector: draws that are the same to each axis, rounding and range."""

import math

from css_common.kernel import kernel
from css_common.random_streams import RandomKey, normal4
from css_common.vectors import Vec3, scale


@kernel
def draw_bias(sigma: float, key: RandomKey, stream: int) -> Vec3:
    """The constant bias of a case, of standard deviation `sigma` per axis."""
    n = normal4(key, stream, 0, 0)
    return scale(sigma, (n[0], n[1], n[2]))


@kernel
def with_noise(sigma: float, key: RandomKey, stream: int, step: int, vector: Vec3) -> Vec3:
    """A vector with white noise of standard deviation `sigma`; 0: as it is, and nothing is drawn."""
    if sigma <= 0.0:
        return vector
    n = normal4(key, stream, step, 0)
    return (vector[0] + sigma * n[0], vector[1] + sigma * n[1], vector[2] + sigma * n[2])


@kernel
def read_out(resolution: float, limit: float, vector: Vec3) -> Vec3:
    """A vector in steps of `resolution`, each component cut at `limit`; 0: continuous, any."""
    return (
        read_out_one(resolution, limit, vector[0]),
        read_out_one(resolution, limit, vector[1]),
        read_out_one(resolution, limit, vector[2]),
    )


@kernel
def read_out_one(resolution: float, limit: float, value: float) -> float:
    """A value in steps of `resolution`, cut at `limit`; 0: continuous, any."""
    if resolution > 0.0:
        value = resolution * math.floor(value / resolution + 0.5)
    if limit > 0.0:
        value = min(max(value, -limit), limit)
    return value


def reading_variance(noise: float, bias: float, resolution: float) -> float:
    """Variance of a reading about the truth, per axis: of noise and bias by their standard deviations, and rounding."""
    return noise**2 + bias**2 + resolution**2 / 12.0
