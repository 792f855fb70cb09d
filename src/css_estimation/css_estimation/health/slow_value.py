# SPDX-License-Identifier: Apache-2.0
"""A quantity that no turn of the body changes and that the orbit changes slowly, followed with its slope."""

from typing import NamedTuple

from css_common.kernel import kernel

_MEMORY = 10.0  # measurements of which the innovations are averaged
_LARGEST = 25.0  # normalised innovation squared of one measurement, at most


class SlowValue(NamedTuple):
    """Kalman filter of value and slope."""

    value: float
    slope: float  # [1/s]
    p: float  # variance of the value
    c: float  # covariance
    q: float  # variance of the slope
    nis: float  # [-] normalised innovation squared, averaged
    begun: bool  # there has been a measurement


NOTHING_YET = SlowValue(0.0, 0.0, 0.0, 0.0, 0.0, 1.0, False)


@kernel
def follow(slow: SlowValue, x: float, variance: float, dt: float, rate: float, mean_motion: float) -> SlowValue:
    """After one measurement.

    Args:
        x, variance: the measurement.
        dt: [s] since the last.
        rate: how fast the orbit changes the quantity, 1 sigma [1/s].
        mean_motion: of the orbit [rad/s]; the slope is another after the time in which it turns by 1/2 rad.
    """
    if not slow.begun:
        return SlowValue(x, 0.0, variance, 0.0, rate * rate, 1.0, True)
    p = slow.p + 2.0 * dt * slow.c + dt * dt * slow.q
    c = slow.c + dt * slow.q
    q = min(slow.q + 4.0 * mean_motion * rate * rate * dt, rate * rate)
    s = p + variance
    innovation = x - (slow.value + dt * slow.slope)
    nis = min(innovation * innovation / s, _LARGEST)
    return SlowValue(
        slow.value + dt * slow.slope + p / s * innovation,
        slow.slope + c / s * innovation,
        p - p * p / s,
        c - p * c / s,
        q - c * c / s,
        slow.nis + (nis - slow.nis) / _MEMORY,
        True,
    )
