# SPDX-License-Identifier: Apache-2.0
"""Torque-free motion fitted to pulses: three events a passage, whose times each depend on where the axis is just then.

The Sun angle of a passage is wrong by the motion during the passage (`slit_angles.motion_gain`), and so is any coning
angle made of Sun angles. A motion fitted to the pulses themselves has no such error, and a wrong alias of its
frequency misses the pulses by far more than the timer does.

Frame h has the angular momentum along z and the Sun in the half plane of x and z. In 3-1-3 angles from it the body
has constant nutation theta and rates of precession phi and spin psi.
"""

from typing import NamedTuple

import numpy as np

_LEAST_PULSES = 24
_EVALUATIONS = 60


class Pulses(NamedTuple):
    """P pulses of passages that were accepted."""

    time: np.ndarray  # (P,) [s]
    tangent: np.ndarray  # (P,) of the slit's inclination, signed: + upper, 0 vertical, - lower
    azimuth: np.ndarray  # (P,) [rad] of the head


class MotionFit(NamedTuple):
    """Fitted motion of a window."""

    half_angle: float  # [rad] theta
    coning: float  # [Hz] precession
    spin: float  # [Hz] turns relative to the Sun
    sun_polar: float  # [rad] between angular momentum and Sun
    residual: float  # [s] root mean square of the pulses


def sun_in_body(parameters: np.ndarray, elapsed: np.ndarray) -> np.ndarray:
    """(3, P) direction to the Sun in b.

    Args:
        parameters: theta, Sun's polar angle, phi and its rate, phi + psi and its rate [rad, rad/s].
        elapsed: (P,) [s].
    """
    theta, polar, phi_0, phi_rate, turn_0, turn_rate = parameters
    phi = phi_0 + phi_rate * elapsed
    psi = turn_0 + turn_rate * elapsed - phi
    x, z = np.sin(polar), np.cos(polar)
    # rotation about z by phi, about x by theta, about z by psi, of (x, 0, z)
    a, b = x * np.cos(phi), -x * np.sin(phi)
    b, c = np.cos(theta) * b + np.sin(theta) * z, np.cos(theta) * z - np.sin(theta) * b
    return np.stack((np.cos(psi) * a + np.sin(psi) * b, np.cos(psi) * b - np.sin(psi) * a, c))


def _misses(parameters: np.ndarray, pulses: Pulses, elapsed: np.ndarray) -> np.ndarray:
    """(P,) time [s] by which each pulse misses the instant at which the Sun is on its slit."""
    x, y, z = sun_in_body(parameters, elapsed)
    c, s = np.cos(pulses.azimuth), np.sin(pulses.azimuth)
    out, across = c * x + s * y, c * y - s * x
    # behind the payload the plane is no slit: an angle instead of a sine does not fold there
    off = np.arctan2(across - pulses.tangent * z, out)
    return off / parameters[5]


def fit_motion(pulses: Pulses, coning: float, spin: float, sun_angle: float, half_angle: float) -> MotionFit | None:
    """The torque-free motion with a coning frequency near a given one that explains the pulses best.

    Args:
        pulses: of a window in which the motion is steady; less than 24 give no fit.
        coning, spin: [Hz] to start from.
        sun_angle: mean Sun angle [rad].
        half_angle: [rad] to start from.

    Returns:
        The fit, or None without enough pulses.
    """
    if len(pulses.time) < _LEAST_PULSES:
        return None
    from scipy.optimize import least_squares  # half a second to load, for the few that look at coning

    elapsed = pulses.time - pulses.time[0]
    vertical = pulses.tangent == 0.0
    turn_rate = 2.0 * np.pi * spin
    # at the first vertical pulse the Sun is at the head's azimuth: on average phi + psi is its negative there
    first = int(np.argmax(vertical))
    turn_0 = -pulses.azimuth[first] - turn_rate * elapsed[first]
    best = None
    for phi_0 in np.pi * np.arange(4) / 2.0:
        start = np.array([half_angle, 0.5 * np.pi - sun_angle, phi_0, 2.0 * np.pi * coning, turn_0, turn_rate])
        fit = least_squares(
            _misses, start, args=(pulses, elapsed), method="lm", x_scale=_scales(elapsed[-1]), max_nfev=_EVALUATIONS * 7
        )
        if best is None or fit.cost < best.cost:
            best = fit
    assert best is not None
    theta, polar, _, phi_rate, _, fitted_turn_rate = best.x
    return MotionFit(
        abs(float(theta)),
        abs(float(phi_rate)) / (2.0 * np.pi),
        float(fitted_turn_rate) / (2.0 * np.pi),
        float(polar),
        float(np.sqrt(np.mean(best.fun**2))),
    )


def _scales(span: float) -> np.ndarray:
    return np.array([0.1, 0.1, 1.0, 1.0 / span, 1.0, 1.0 / span])
