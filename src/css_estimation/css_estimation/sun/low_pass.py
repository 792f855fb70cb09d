# SPDX-License-Identifier: Apache-2.0
"""First-order low-pass filter, discretised exactly for an input that is constant over a step."""

import math

from css_common.kernel import kernel
from css_common.vectors import Vec3


@kernel
def low_pass_gain(cutoff: float, dt: float) -> float:
    """Share of a new input that one step takes in: 1 - exp(-2 pi cutoff dt).

    Args:
        cutoff: corner frequency [Hz].
        dt: step [s].
    """
    return -math.expm1(-2.0 * math.pi * cutoff * dt)


@kernel
def low_pass(filtered: Vec3, measured: Vec3, gain: float) -> Vec3:
    """Filter output after one step with `measured` as input."""
    return (
        filtered[0] + gain * (measured[0] - filtered[0]),
        filtered[1] + gain * (measured[1] - filtered[1]),
        filtered[2] + gain * (measured[2] - filtered[2]),
    )
