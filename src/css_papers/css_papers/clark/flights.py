# SPDX-License-Identifier: Apache-2.0
"""The flights of the figures: several orbits of one case, and what their passes through sunlight came to."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from css_analysis.flight_log import FlightLog, angle
from css_analysis.flight_metrics import sunlit_passes
from css_common.mission import Mission, load_mission
from css_estimation.sun.safe_hold import MODE_PYRAMID
from css_monte_carlo.direct_flight import fly_directly
from css_msgs.msg import SunEstimate

FLAT, PYRAMID = "clark_1996_flat", "clark_1996_pyramid"
DOUBLED = ("css_array.albedo.factor=2",)
"""All intensities doubled; the mission cuts them at 0.80."""
STEADY_DEG = 10.0
"""Angle [deg] of panel to Sun, the original goal, within which an acquisition must end."""


class Flight(NamedTuple):
    """One flight at every control cycle; angles in deg."""

    time_s: np.ndarray  # (T,) since the epoch
    sunlit: np.ndarray  # (T,) bool
    panel_true: np.ndarray  # (T,) panel normal to the true Sun, in the shadow too
    panel_sensed: np.ndarray  # (T,) panel normal to the sensed Sun; NaN: no estimate came
    error: np.ndarray  # (T,) sensed to true Sun; NaN where there is none, and in the shadow
    on_pyramid: np.ndarray  # (T,) bool, the Sun is measured by the pyramid
    passes: Sequence[tuple[float, float]]  # start and end [s] of each stretch of sunlight

    @property
    def mean_error(self) -> float:
        """Mean of `error` over sunlight."""
        return float(np.nanmean(self.error)) if np.isfinite(self.error).any() else float("nan")

    @property
    def mean_panel(self) -> float:
        """Mean of `panel_true` over sunlight, acquisition included."""
        return float(self.panel_true[self.sunlit].mean()) if self.sunlit.any() else float("nan")


def fly(name: str, overrides: Sequence[str] = ()) -> Flight:
    """Flies a mission, component by component."""
    return flight_of(fly_directly(load_mission(name, list(overrides))))


def flight_of(log: FlightLog) -> Flight:
    """The angles of a flight that has one estimator."""
    truth, mission = log.having("truth"), _mission(log)
    estimates = log.estimates[mission.values.graph.estimator]
    rows, steps = log.truth_rows(estimates)
    size = len(truth)
    sensed, error, on_pyramid = np.full(size, np.nan), np.full(size, np.nan), np.zeros(size, bool)
    sun_b = estimates.sun_b[rows]
    sensed[steps] = np.degrees(angle(sun_b, log.array_normal_b))
    error[steps] = np.degrees(angle(sun_b, log.sun_b[steps]))
    unknown = np.ones(size, bool)
    unknown[steps] = estimates.validity[rows] == SunEstimate.VALIDITY_NONE
    error[unknown | ~log.sunlit] = np.nan
    on_pyramid[steps] = estimates.mode[rows] == MODE_PYRAMID
    passes = [(stretch.start_s, stretch.end_s) for stretch in sunlit_passes(log)]
    return Flight(log.time(truth), log.sunlit, np.degrees(log.pointing_error), sensed, error, on_pyramid, passes)


def _mission(log: FlightLog) -> Mission:
    if log.mission is None:
        raise ValueError(f"{log.origin}: the mission of the flight is not known")
    return log.mission


def acquisition_min(flight: Flight) -> list[float]:
    """Minutes from each sunrise until the panel is within `STEADY_DEG` of the Sun for the rest of the pass.

    A pass that ends outside has no acquisition and is infinite.
    """
    return [_until_rest(flight, flight.panel_true <= STEADY_DEG, *stretch) for stretch in flight.passes]


def handover_min(flight: Flight) -> list[float]:
    """Minutes from each sunrise until the pyramid measures the Sun for the rest of the pass; infinite: never."""
    return [_until_rest(flight, flight.on_pyramid, *stretch) for stretch in flight.passes]


def _until_rest(flight: Flight, good: np.ndarray, start: float, end: float) -> float:
    rows = np.flatnonzero((flight.time_s >= start) & (flight.time_s <= end))
    bad = rows[~good[rows]]
    if not len(bad):
        return 0.0
    if bad[-1] == rows[-1]:
        return float("inf")
    return float(flight.time_s[bad[-1] + 1] - start) / 60.0
