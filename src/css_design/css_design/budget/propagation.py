# SPDX-License-Identifier: Apache-2.0
"""Linearised propagation of every source of error through a mission's estimator, along flights without errors.

A flight with perfect sensors is the nominal. Along it the heading is a function of all readings, s_k(y_0, ..., y_k), of
which the estimator itself is the only description needed. Of an error source with covariance R that function's
derivative H gives the covariance H R H^T of the heading, whose trace is the mean square of the error:

    what lasts (scale, offset and tilt of each cell, bias, scale and alignment of the gyro): a column of H for each, by
        central differences of one standard deviation; the variances add up.
    what is white (noise, rounding): the trace of H R H^T by random signs z, E |H R^(1/2) z|^2 = tr H R H^T (Hutchinson
        1990), in pairs of z and -z, of which the difference is free of what is not linear.
    what is given (light of the Earth, response and losses of the cells): its own difference from the nominal.

Variances of different sources add up; how far that holds is what the Monte Carlo is for.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from css_analysis.flight_log import angle
from css_common.mission import Mission
from css_design.budget.along import Along
from css_design.budget.open_loop import Path, flown_path
from css_design.budget.perturbations import squares_by_source
from css_design.budget.sources import FILTER, heard_sources, without
from css_design.budget.turning import Follower
from css_monte_carlo.mission_flight import MissionFlight

Tell = Callable[[int, int], None]


class Propagated(NamedTuple):
    """Mean squares over the counted steps of all nominal flights, by source [rad^2]."""

    heading: dict[str, float]
    pointing: dict[str, float] | None  # None: the loop of the control is not linear
    second_order: dict[str, float]  # of the heading: what both sides of a pair do alike, which is not linear
    bound: float  # [rad] 95 % of the heading errors that all sources together make
    steps: int  # counted
    runs: int  # of the estimator


def propagate(mission: Mission, cases: int, tell: Tell) -> Propagated:
    """Propagates all sources along some flights.

    Args:
        mission: with everything switched on; scripted events are left out.
        cases: nominal flights, from case 0 on.
        tell: told how many flights are done, and of how many.
    """
    ideal = without(mission, heard_sources(mission))
    flight = MissionFlight(ideal)
    follower = Follower.of(ideal)
    squares: dict[str, list[np.ndarray]] = {}
    seconds: dict[str, list[np.ndarray]] = {}
    counted, runs = 0, 0
    for case in range(cases):
        tell(case, cases)
        around = flight.around_case(case) if flight.own_surroundings else flight
        along = Along(around, flown_path(around, case)[0], follower)
        mask = along.path.counted & along.base.known
        for name, square in squares_by_source(mission, along):
            if name == FILTER and follower is not None:
                square = np.stack([square[0], _off_the_sun(ideal, along.path)])
            squares.setdefault(name, []).append(square[:, mask])
            seconds.setdefault(name, []).append(along.take_second_order()[mask])
        counted += int(np.count_nonzero(mask))
        runs += along.runs
    tell(cases, cases)
    together = {name: np.concatenate(parts, axis=1) for name, parts in squares.items()}
    means = {name: square.mean(axis=1) if counted else np.full(2, np.nan) for name, square in together.items()}
    total = sum((square[0] for square in together.values()), np.zeros(counted))
    return Propagated(
        {name: float(mean[0]) for name, mean in means.items()},
        None if follower is None else {name: float(mean[1]) for name, mean in means.items()},
        {name: float(np.concatenate(parts).mean()) if counted else np.nan for name, parts in seconds.items()},
        rayleigh_percentile(total, 0.95),
        counted,
        runs,
    )


def _off_the_sun(mission: Mission, path: Path) -> np.ndarray:
    """(M,) squares [rad^2] of the angle of array normal to Sun: what control and torques leave by themselves."""
    return np.asarray(angle(path.sun_b, np.asarray(mission.values.spacecraft.array_normal)) ** 2)


def rayleigh_percentile(squares: np.ndarray, share: float) -> float:
    """Angle [rad] below which a share of errors lies, by their mean squares at each step [rad^2], alike on two axes."""
    if not len(squares) or not np.any(squares > 0.0):
        return float("nan") if not len(squares) else 0.0
    low, high = 0.0, 10.0 * float(np.sqrt(np.max(squares)))
    for _ in range(60):
        middle = 0.5 * (low + high)
        with np.errstate(divide="ignore"):
            below = float(np.mean(-np.expm1(-(middle**2) / squares)))
        low, high = (middle, high) if below < share else (low, middle)
    return high
