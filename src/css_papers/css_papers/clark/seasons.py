# SPDX-License-Identifier: Apache-2.0
"""Monte Carlo over tip-off rates, attitude, date and albedo, and where in a pass the flat cells err at each date."""

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from css_common.epochs import parse_utc
from css_common.mission import load_mission
from css_monte_carlo.study import Configuration
from css_papers.clark.cases import averages, configuration, fly_cases_of
from css_papers.clark.flights import FLAT, PYRAMID
from css_papers.clark.numbers import GOAL, HALVED, INSENSITIVE
from css_papers.papers import Request
from css_papers.rows import Must, Row, row
from css_papers.study_columns import column, curve

TIP_OFF = ("dynamics.initial.rate=random", "dynamics.initial.max_rate_deg_s=2")
"""Rates uniform up to 2 deg/s about each axis; the mission has 1 deg/s about each."""
DATES = ("1996-03-20", "1996-06-06", "1996-08-05", "1996-09-22", "1996-12-21")
SCALES = (0.5, 1.0, 2.0)
MARCH, JUNE, _, SEPTEMBER, DECEMBER = DATES
QUICK_DATES, QUICK_SCALES = (JUNE, DECEMBER), (1.0, 2.0)

_TROPICAL_YEAR_DAYS = 365.2422
_NS_PER_DAY = 86_400 * 10**9
_SMOOTHED_MIN = 4.0
_SETTLED_MIN = 6.0  # when acquisition is over
_SHORTEST_MIN = 40.0


class Point(NamedTuple):
    """One date and one scale of the albedo."""

    date: str
    scale: float

    @property
    def overrides(self) -> tuple[str, ...]:
        """The mission on that date: the node moves with the mean Sun."""
        orbit = load_mission(FLAT)
        days = (parse_utc(f"{self.date}T00:00:00Z") - orbit.epoch_ns) / _NS_PER_DAY
        raan = (orbit.values.orbit.raan_deg + 360.0 * days / _TROPICAL_YEAR_DAYS) % 360.0
        return (
            f"mission.epoch={self.date}T00:00:00Z",
            f"orbit.raan_deg={raan:.3f}",
            f"css_array.albedo.factor={self.scale:g}",
        )

    def flown(self, mission: str) -> Configuration:
        """How a mission flies there."""
        return configuration(mission, self.overrides)


class Campaign(NamedTuple):
    """All flights of both missions."""

    points: Sequence[Point]
    cases: int  # of each point and mission
    tables: dict[str, pa.Table]  # mission to the study's `cases`
    percentiles: pa.Table  # of the flat mission


class Profile(NamedTuple):
    """Mean error of the flat cells over the time in a pass through sunlight."""

    minutes: np.ndarray  # (S,) since the begin of the pass
    error: np.ndarray  # (S,) [deg]

    @property
    def halves(self) -> tuple[float, float]:
        """Largest error [deg] of each half of the pass, acquisition left out."""
        settled, middle = self.minutes >= _SETTLED_MIN, 0.5 * self.minutes[-1]
        first, second = settled & (self.minutes < middle), self.minutes >= middle
        return float(self.error[first].max()), float(self.error[second].max())

    @property
    def peak_share(self) -> float:
        """Where in the pass the error is largest, 0 to 1."""
        settled = np.where(self.minutes >= _SETTLED_MIN, self.error, -np.inf)
        return float(self.minutes[int(np.argmax(settled))] / self.minutes[-1])


def fly_campaign(request: Request, most: int) -> Campaign:
    """Flies both missions at every date and scale, all cases split over the points."""
    dates, scales = (QUICK_DATES, QUICK_SCALES) if request.quick else (DATES, SCALES)
    points = [Point(date, scale) for date in dates for scale in scales]
    cases = max(1, -(-min(request.cases, most) // len(points)))
    changes = [point.overrides for point in points]
    flat = fly_cases_of(FLAT, changes, cases, "campaign", request, TIP_OFF)
    pyramid = fly_cases_of(PYRAMID, changes, cases, "campaign", request, TIP_OFF)
    return Campaign(points, cases, {FLAT: flat.cases, PYRAMID: pyramid.cases}, flat.percentiles)


def panel_angles(campaign: Campaign, mission: str, scale: float | None = None) -> np.ndarray:
    """Mean angle [deg] of panel to Sun over sunlight of every case of a mission, at one scale or all."""
    return np.concatenate(
        [
            column(campaign.tables[mission], point.flown(mission), "pointing_error_sunlit_deg")
            for point in campaign.points
            if scale is None or point.scale == scale
        ]
    )


def profile(campaign: Campaign, date: str) -> Profile:
    """Profile at a date with nominal albedo, over all whole passes but the first.

    Raises:
        ValueError: the flights have no whole pass after the first.
    """
    line = curve(campaign.percentiles, Point(date, 1.0).flown(FLAT), "heading_error_deg")
    step_min = float(line.time_s[1] - line.time_s[0]) / 60.0
    lit = np.isfinite(line.mean).astype(np.int8)
    edges = np.flatnonzero(np.diff(np.concatenate(([0], lit, [0]))))
    passes = [line.mean[a:b] for a, b in edges.reshape(-1, 2)[1:] if (b - a) * step_min > _SHORTEST_MIN]
    if not passes:
        raise ValueError("no whole pass through sunlight after the first")
    # a pass that the end of the flight cuts off is shorter than the others
    longest = max(map(len, passes))
    whole = [errors for errors in passes if len(errors) > 0.9 * longest]
    size = min(map(len, whole))
    mean = np.mean([errors[:size] for errors in whole], axis=0)
    width = max(1, round(_SMOOTHED_MIN / step_min))
    weights = np.convolve(np.ones(size), np.ones(width), mode="same")
    return Profile(step_min * np.arange(size), np.convolve(mean, np.ones(width), mode="same") / weights)


def profile_rows(profiles: Mapping[str, Profile]) -> list[Row]:
    """Where in a pass the error peaks: early in June, late in December, in both halves at the equinoxes."""
    expected = {JUNE: (0.0, 0.5), DECEMBER: (0.5, 1.0)}
    rows = []
    for date, found in profiles.items():
        if date in expected:
            rows.append(
                row(f"peak of the error, {day(date)}", "of pass", None, found.peak_share, Must(*expected[date]))
            )
        elif date in (MARCH, SEPTEMBER):
            lower, higher = sorted(found.halves)
            rows.append(row(f"lower over higher peak, {day(date)}", "-", None, lower / higher, Must(0.75)))
    return rows


def campaign_rows(campaign: Campaign) -> list[Row]:
    """The paper's conclusions over all cases."""
    flat, pyramid = (panel_angles(campaign, mission, 1.0) for mission in (FLAT, PYRAMID))
    doubled = panel_angles(campaign, PYRAMID, 2.0)
    every = panel_angles(campaign, PYRAMID)
    difference = abs(float(doubled.mean() - pyramid.mean()))
    variant = "all cases"
    return [
        row("panel to Sun, flat", "deg", None, float(flat.mean()), variant=variant),
        row("panel to Sun, pyramid", "deg", None, float(pyramid.mean()), GOAL, variant=variant),
        row("panel to Sun, pyramid, doubled", "deg", None, float(doubled.mean()), GOAL, variant=variant),
        row("pyramid, doubled to nominal", "deg", None, difference, INSENSITIVE, variant=variant),
        row("pyramid over flat", "-", None, float(pyramid.mean() / flat.mean()), HALVED, variant=variant),
        row("panel to Sun, pyramid, worst", "deg", None, float(every.max()), variant=variant),
    ]


def campaign_lines(campaign: Campaign) -> list[list[str]]:
    """A line for each point: means over its cases, with the largest case, and the ratio."""
    lines = []
    for point in campaign.points:
        flat, pyramid = (averages(campaign.tables[m], point.flown(m)) for m in (FLAT, PYRAMID))
        lines.append(
            [
                f"{day(point.date)}, albedo x {point.scale:g}",
                f"{flat.error:.2f}",
                f"{flat.panel:.2f} ({flat.panel_max:.2f})",
                f"{pyramid.error:.2f}",
                f"{pyramid.panel:.2f} ({pyramid.panel_max:.2f})",
                f"{pyramid.panel / flat.panel:.2f}",
            ]
        )
    return lines


def day(date: str) -> str:
    """A date as the page has it."""
    return f"{datetime.fromisoformat(date).replace(tzinfo=UTC):%d %B}".lstrip("0")
