# SPDX-License-Identifier: Apache-2.0
"""Sun angle and rotation rate from the counts of a slit sensor (Reichard et al., ESPRIT, Eqs. 2 to 7).

COUNT runs from the upper to the lower slit and is taken with its sign: positive when the upper one came first, which
is a Sun above the equator. RCOUNT runs from one upper pulse to the next. Eq. 5 as printed has neither rate nor the
right counter; with the arc of Eq. 1 and the rate of Eq. 2 its argument is 180 deg COUNT / RCOUNT, as in Eq. 6.
"""

import math

from css_common.kernel import kernel
from css_common.vectors import Vec3
from css_estimation.symmetric import Symmetric, add_outer, isotropic

_HALF_TURN = math.pi
# Variance of a time that is cut to whole counts [counts^2].
CUT_VARIANCE = 1.0 / 12.0
_RATIOS = 16


@kernel
def rotation_rate(turn: int, frequency: float) -> float:
    """Rate [rad/s] for RCOUNT `turn` of a counter of `frequency` [Hz] (Eq. 2)."""
    return 2.0 * math.pi * frequency / turn


@kernel
def half_arc(count: int, turn: int) -> float:
    """Half of the arc [rad] between the slanted slits, signed (Eqs. 1 and 2)."""
    return _HALF_TURN * count / turn


@kernel
def sun_angle(count: int, turn: int, inclination: float) -> float:
    """Signed Sun angle [rad] for COUNT and RCOUNT (Eq. 6); `inclination` [rad] is that of the slanted slits."""
    return math.atan(math.sin(half_arc(count, turn)) / math.tan(inclination))


@kernel
def sun_vector(angle: float, azimuth: float) -> Vec3:
    """Direction to the Sun in b when it crosses the vertical slit of a head at an azimuth [rad] (Eq. 7)."""
    return (math.cos(angle) * math.cos(azimuth), math.cos(angle) * math.sin(azimuth), math.sin(angle))


@kernel
def arc_slope(angle: float, inclination: float) -> float:
    """Change of the half arc with the Sun angle [rad/rad]."""
    k = math.tan(inclination)
    tangent = math.tan(angle)
    return k * (1.0 + tangent * tangent) / math.sqrt(max(1.0 - (k * tangent) ** 2, 1e-6))


@kernel
def quantum(count: int, turn: int, inclination: float) -> float:
    """Change of the Sun angle [rad] for one count of COUNT."""
    return _HALF_TURN / turn / arc_slope(sun_angle(count, turn, inclination), inclination)


@kernel
def counting_variance(count: int, turn: int, inclination: float, jitter_counts: float) -> float:
    """Variance of the Sun angle [rad^2] from whole counts and from jitter [counts, 1 sigma] of each pulse.

    COUNT and RCOUNT end and begin at one upper pulse, whose error counts in both.
    """
    share = count / turn
    of_pulses = (CUT_VARIANCE + jitter_counts**2) * (1.0 + (1.0 + share) ** 2 + share**2)
    return quantum(count, turn, inclination) ** 2 * of_pulses


@kernel
def motion_gain(angle: float, inclination: float, ratio: float) -> tuple[float, float]:
    """Error of the Sun angle over the swing of it by coning: the parts in phase with the swing, and in quadrature.

    While the Sun goes from slit to slit the axis moves, and the rate at which its azimuth runs is not that of the
    whole turn. To first order in the swing A, with the coning phase alpha at the vertical slit: the Sun angle is
    S + A cos alpha, its azimuth deviates by -tan S A sin alpha, and alpha grows by `ratio` 2 pi a turn.

    Args:
        ratio: coning frequency over spin frequency, close to the ratio of axial and transverse moment of inertia.
    """
    slope = arc_slope(angle, inclination)
    tangent = math.tan(angle)
    u = math.asin(min(max(math.tan(inclination) * tangent, -1.0), 1.0))
    beta, half_turn = ratio * u, _HALF_TURN * ratio
    # the interval between the slanted slits
    in_phase = slope * (math.cos(beta) - 1.0) - tangent * math.sin(beta)
    # the turn before, from upper to upper slit
    middle = -beta - half_turn
    weight = u / _HALF_TURN * math.sin(half_turn)
    in_phase += weight * (tangent * math.cos(middle) - slope * math.sin(middle))
    quadrature = -weight * (tangent * math.sin(middle) + slope * math.cos(middle))
    return in_phase / slope, quadrature / slope


@kernel
def _error_share(angle: float, inclination: float, ratio: float) -> float:
    in_phase, quadrature = motion_gain(angle, inclination, ratio)
    of_error = in_phase * in_phase + quadrature * quadrature
    # the measured swing has the error in it
    return of_error / max((1.0 + in_phase) ** 2 + quadrature * quadrature, 0.01)


@kernel
def motion_variance(angle: float, inclination: float, ratio: float, swing_variance: float) -> float:
    """Variance of the Sun angle [rad^2] from coning that makes measured angles swing with a variance [rad^2].

    A ratio of 0 is unknown: the worst of all that a body can have counts.
    """
    if ratio > 0.0:
        return _error_share(angle, inclination, ratio) * swing_variance
    worst = 0.0
    for i in range(1, _RATIOS + 1):
        worst = max(worst, _error_share(angle, inclination, 2.0 * i / _RATIOS))
    return worst * swing_variance


@kernel
def sun_covariance(angle: float, azimuth: float, angle_variance: float, azimuth_variance: float) -> Symmetric:
    """Covariance of `sun_vector` for independent errors of angle and azimuth [rad^2]."""
    up = (-math.sin(angle) * math.cos(azimuth), -math.sin(angle) * math.sin(azimuth), math.cos(angle))
    across = (-math.sin(azimuth), math.cos(azimuth), 0.0)
    upward = add_outer(isotropic(0.0), angle_variance, up)
    return add_outer(upward, azimuth_variance * math.cos(angle) ** 2, across)
