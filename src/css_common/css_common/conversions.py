# SPDX-License-Identifier: Apache-2.0
"""From what people write in missions to what algorithms compute with."""

import math


def square(sigma: float) -> float:
    """Variance of a standard deviation."""
    return sigma**2


def square_of_degrees(sigma_deg: float) -> float:
    """Variance [rad^2] of a standard deviation [deg]."""
    return math.radians(sigma_deg) ** 2


def sine_of_degrees(angle_deg: float) -> float:
    """Sine of an angle [deg]."""
    return math.sin(math.radians(angle_deg))


def cosine_of_degrees(angle_deg: float) -> float:
    """Cosine of an angle [deg]."""
    return math.cos(math.radians(angle_deg))


def seconds(time_us: float) -> float:
    """Time [s] of a time [us]."""
    return 1e-6 * time_us


def tesla(field_nt: float) -> float:
    """Field [T] of a field [nT]."""
    return field_nt * 1e-9
