# SPDX-License-Identifier: Apache-2.0
"""The orbit that recorded positions follow, as elements that a mission can state: least squares under J2."""

import math
from typing import NamedTuple

import numpy as np

from css_environment.constants import EARTH_MU, EARTH_RADIUS
from css_environment.j2_integration import J2Track
from css_telemetry.places import Place

WORST_M = 20e3
"""Distance [m] of a position from the fitted orbit beyond which it is none: 0.15 deg, 3 s of a low orbit."""

_FIRST_SPAN_S = 3_000.0  # half of an orbit, from which on a fit is carried to longer spans
_SPANS_GROW = 8.0

_NEAR_ENOUGH, _BEST = 1e-2, 1e-6  # of sums of squares, what is left to gain: on the way to longer spans, and in the end
_MOST_ROUNDS = 40
_MOST_POINTS = 300
_STEP_S = 8.0  # of integration: 5 m in a week at 400 km
_SLOPE = (10.0, 10.0, 10.0, 0.01, 0.01, 0.01)  # [m, m/s]: far above what rounding makes of a week, far below what bends
_SLOPE_STEP_S = 32.0  # of integration for slopes: what longer steps err by goes out of differences
_FARTHEST = 1e9  # [m], of a way that has left the Earth or fallen into it
_BEGINNING_S = 120.0  # of positions by which a first velocity is found
_LOWEST = 100e3  # altitude [m] that missions accept


class Elements(NamedTuple):
    """Osculating elements at the epoch, in the units of missions."""

    altitude: float  # semi-major axis above the equatorial radius [m]
    eccentricity: float
    inclination_deg: float
    raan_deg: float
    argument_of_perigee_deg: float
    true_anomaly_deg: float


class OrbitFit(NamedTuple):
    """An orbit and how far the positions are from it."""

    elements: Elements
    rms_m: float
    worst_m: float


def fit_orbit(place: Place, stamps_ns: np.ndarray) -> OrbitFit:
    """The orbit through positions.

    Args:
        place: positions and velocities, NaN where they are not known.
        stamps_ns: of the rows; the first one is the epoch of the elements.

    Raises:
        ValueError: they follow no orbit, or there are too few; says so.
    """
    known = np.flatnonzero(np.isfinite(place.r_n).all(axis=1))
    if len(known) < 3:
        raise ValueError(f"{len(known)} positions are known, expected at least 3")
    elapsed = (stamps_ns - stamps_ns[0]) * 1e-9
    state = _first_state(place, elapsed, known)
    span, longest = elapsed[known[0]] + _FIRST_SPAN_S, float(elapsed[known[-1]])
    while span < longest:
        near = known[elapsed[known] <= span]
        if len(near) >= 3:
            state, _ = _improved(state, elapsed, place.r_n, near, _NEAR_ENOUGH)
        span *= _SPANS_GROW
    state, misses = _improved(state, elapsed, place.r_n, known, _BEST)
    away = np.linalg.norm(misses, axis=1)
    rms, worst = float(np.sqrt(np.mean(away**2))), float(np.max(away))
    if not worst <= WORST_M:
        raise ValueError(
            f"they are up to {worst / 1e3:.3g} km from the nearest orbit, expected at most {WORST_M / 1e3:g} km: check "
            "frame, unit and times"
        )
    return OrbitFit(elements_of(state[:3], state[3:]), rms, worst)


def _improved(
    start: np.ndarray, elapsed: np.ndarray, r_n: np.ndarray, rows: np.ndarray, tolerance: float
) -> tuple[np.ndarray, np.ndarray]:
    """The state (6,) at time zero that fits the positions of some rows best, and how far (K, 3) [m] it misses them.

    By Levenberg and Marquardt, who begin with the whole step: a trust region that begins with one of a unit takes a
    dozen rounds to reach it where the residuals are thousands of kilometres.
    """
    from scipy.optimize import least_squares

    used = rows[np.unique(np.linspace(0, len(rows) - 1, min(len(rows), _MOST_POINTS)).astype(int))]
    time, positions = elapsed[used], r_n[used]

    def misses(state: np.ndarray, step_s: float) -> np.ndarray:
        track, _ = J2Track(state[:3], state[3:], step_s).states(time)
        miss = track - positions
        return np.where(np.isfinite(miss), np.clip(miss, -_FARTHEST, _FARTHEST), _FARTHEST).ravel()

    def slopes(state: np.ndarray) -> np.ndarray:
        here = misses(state, _SLOPE_STEP_S)
        steps = np.diag(_SLOPE)
        return np.stack([(misses(state + step, _SLOPE_STEP_S) - here) / step.sum() for step in steps], axis=1)

    found = least_squares(
        lambda x: misses(x, _STEP_S),
        start,
        jac=slopes,
        method="lm",
        x_scale="jac",
        ftol=tolerance,
        max_nfev=_MOST_ROUNDS,
    )
    return found.x, found.fun.reshape(-1, 3)


def _first_state(place: Place, elapsed: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Position and velocity at time zero, near enough to begin with: by the first positions, carried back."""
    first = known[0]
    near = known[elapsed[known] <= elapsed[first] + _BEGINNING_S]
    if len(near) < 3:
        near = known[:3]
    time = elapsed[near] - elapsed[first]
    if np.all(np.isfinite(place.v_n[first])):
        r, v = place.r_n[first], place.v_n[first]
    else:
        degree = min(3, len(near) - 1)
        coefficients = np.polynomial.polynomial.polyfit(time, place.r_n[near], degree)
        r, v = coefficients[0], coefficients[1]
    back = -elapsed[first : first + 1]
    r_n, v_n = J2Track(r, v).states(back)
    return np.concatenate((r_n[0], v_n[0]))


def elements_of(r_n: np.ndarray, v_n: np.ndarray) -> Elements:
    """Osculating elements of a position [m] and velocity [m/s] in n (Vallado, algorithm 9).

    Raises:
        ValueError: they are of no orbit around the Earth that a mission may fly.
    """
    r, v2 = float(np.linalg.norm(r_n)), float(v_n @ v_n)
    energy = 0.5 * v2 - EARTH_MU / r
    momentum = np.cross(r_n, v_n)
    h = float(np.linalg.norm(momentum))
    if not energy < 0.0 or not h > 0.0:
        raise ValueError("they follow no closed orbit")
    axis = -0.5 * EARTH_MU / energy
    towards = np.cross(v_n, momentum) / EARTH_MU - r_n / r  # to the perigee, as long as the eccentricity
    eccentricity = float(np.linalg.norm(towards))
    if axis * (1.0 - eccentricity) - EARTH_RADIUS < _LOWEST or eccentricity > 0.9:
        raise ValueError(f"the orbit comes down to {axis * (1.0 - eccentricity) / 1e3 - EARTH_RADIUS / 1e3:.0f} km")
    node = np.array([-momentum[1], momentum[0], 0.0])
    if np.linalg.norm(node) < 1e-9 * h:  # equatorial: from the x axis
        node = np.array([1.0, 0.0, 0.0])
    node = node / np.linalg.norm(node)
    across = np.cross(momentum / h, node)
    if eccentricity < 1e-9:  # circular: from the node
        towards = node
    perigee = math.atan2(float(towards @ across), float(towards @ node))
    place = math.atan2(float(r_n @ across), float(r_n @ node))
    return Elements(
        axis - EARTH_RADIUS,
        eccentricity if eccentricity >= 1e-9 else 0.0,
        math.degrees(math.acos(max(-1.0, min(1.0, float(momentum[2]) / h)))),
        math.degrees(math.atan2(float(node[1]), float(node[0]))),
        math.degrees(perigee),
        math.degrees(math.remainder(place - perigee, 2.0 * math.pi)),
    )
