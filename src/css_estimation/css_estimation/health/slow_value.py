# SPDX-License-Identifier: Apache-2.0
"""A quantity that no turn of the body changes and that the orbit changes slowly, followed with its slope."""

from typing import NamedTuple

from css_common.kernel import kernel

_MEMORY = 10.0  # measurements of which the innovations are averaged
_TURN = 0.5  # [rad] of the orbit, after which the slope is another, and nothing is known of the value
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
def passed(slow: SlowValue, dt: float, rate: float, mean_motion: float) -> SlowValue:
    """After some time [s], in which nothing need have been measured.

    Args:
        rate: how fast the orbit changes the quantity, 1 sigma [1/s].
        mean_motion: of the orbit [rad/s]; the slope is another after the time in which it turns by 1/2 rad, and
            nothing is known of the value after a longer one.
    """
    if not slow.begun or mean_motion * dt > _TURN:
        return SlowValue(0.0, 0.0, 0.0, 0.0, 0.0, slow.nis, False)
    walk = 4.0 * mean_motion * rate * rate
    p = slow.p + 2.0 * dt * slow.c + dt * dt * slow.q + walk * dt * dt * dt / 3.0
    c = slow.c + dt * slow.q + 0.5 * walk * dt * dt
    q = min(slow.q + walk * dt, rate * rate)
    return SlowValue(slow.value + dt * slow.slope, slow.slope, p, c, q, slow.nis, True)


@kernel
def follow(slow: SlowValue, x: float, variance: float, rate: float) -> SlowValue:
    """After one measurement and its variance, now.

    Args:
        rate: as of `passed`.
    """
    if not slow.begun:
        return SlowValue(x, 0.0, variance, 0.0, rate * rate, slow.nis, True)
    s = slow.p + variance
    innovation = x - slow.value
    nis = min(innovation * innovation / s, _LARGEST)
    return SlowValue(
        slow.value + slow.p / s * innovation,
        slow.slope + slow.c / s * innovation,
        slow.p - slow.p * slow.p / s,
        slow.c - slow.p * slow.c / s,
        slow.q - slow.c * slow.c / s,
        slow.nis + (nis - slow.nis) / _MEMORY,
        True,
    )
