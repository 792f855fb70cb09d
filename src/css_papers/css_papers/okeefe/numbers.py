# SPDX-License-Identifier: Apache-2.0
"""Every number that the text of O'Keefe & Schaub 2013 states, beside ours.

What ours must be is either the paper's own bound or the range in which an independent implementation of the paper's
equations came out.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from css_analysis.flight_metrics import Windows
from css_monte_carlo.study import Configuration
from css_papers.cell_outputs import OrbitOutputs
from css_papers.okeefe.flight_figures import HEADING_ERROR, POINTING_ERROR, RATE_KNOWLEDGE, Shadow, Variant
from css_papers.okeefe.flights import merit
from css_papers.rows import Must, Row, full_name, number, row
from css_papers.study_columns import column, curve

# mean norm of the gyro's white noise, 0.01 deg/s on each of three axes
_NOISE_DEG_S = 0.01 * math.sqrt(8.0 / math.pi)
_DEADBAND_DEG = 15.0
_DUSK_S = 30.0
_BRIGHT_MIN = 20  # the Earth below is bright: the least favourable minutes of this orbit
_MOST_NAMED = 8
# found by flying the slow ones with one thing changed
_SLOW = (
    "Such cases spin about the Sun line, at 2 to 7 deg/s, with the Sun 40 to 50 deg off the array normal in the "
    "view of two cells. No Sun vector shows that spin, and of the turn across the Sun line, 1 to 1.5 deg/s, the "
    "average of two cells shows a sixth: the control pushes into a coning motion that it does not see. It is "
    "neither the speed limit of the wheels nor the Earth (without either some stay slow), but the deadband in "
    "which nothing damps, and the gain on the rate: `mrp_control.deadband_behaviour=damp` brings each below 1.2 "
    "min"
)

HEADING, RATE, KNOWLEDGE, CONVERGING, CONVERGED = "heading", "rate", "knowledge", "converging", "converged"
"""Kinds of quantities of a flight."""


class _Printed(NamedTuple):
    """What the text says of a configuration; rates are those at 50 min, None: "the noise level"."""

    error_deg: float
    rate_deg_s: float | None
    knowledge_deg_s: float | None
    converging_min: float
    relation: str


_PAPER = {
    "average, gyro": _Printed(4.99, None, None, 3.0, "<"),
    "average, no gyro": _Printed(4.94, 0.63, 0.66, 7.5, "≤"),
    "filter, gyro": _Printed(2.38, None, None, 3.0, "<"),
    "filter, no gyro": _Printed(2.51, 0.67, 0.76, 20.0, "≤"),
}
_ERROR_MUST = {"average": Must(4.0, 7.0), "filter": Must(None, 3.0)}
CONVERGING_LIMITS_MIN = tuple(sorted({printed.converging_min for printed in _PAPER.values()}))


class Peaks(NamedTuple):
    """Largest output by the Earth's light."""

    figure: OrbitOutputs  # at the attitude of the figure
    attitudes: np.ndarray  # (K,) at other attitudes


def coverage_rows(numbers: Mapping[str, Any]) -> list[Row]:
    """Figs. 1b and 2.

    Args:
        numbers: of `coverage_statistics.coverage_object`.
    """
    ideal = numbers["wavg_ideal"]
    seen = numbers["seen_by_fraction"]
    first, last = ideal["polar_mean_above_30"] or (None, None)
    return [
        row("directions that a cell sees", "%", None, 100.0 * (1.0 - seen[0]), Must(100.0)),
        row(
            "average: largest error within 19 deg", "deg", 10.0, ideal["max_within_deg"]["19"],
            Must(None, 10.0), relation="<",
        ),
        row(
            "average: 30 deg error band begins", "deg", None, first, Must(None, 90.0),
            relation="near 90",
        ),
        row(
            "average: 30 deg error band ends", "deg", None, last, Must(90.0), relation="near 90",
        ),
    ]  # fmt: skip


def orbit_rows(period_s: float, shadow: Shadow) -> list[Row]:
    """The orbit."""
    step_s = shadow.time_s[1] - shadow.time_s[0]
    sunlit = float(np.count_nonzero(~shadow.dark)) * step_s / 60.0
    return [
        row("orbital period", "min", 92.5, period_s / 60.0, Must(92.0, 93.0), relation="≈"),
        row("sunlight in one orbit", "min", 56.5, sunlit, Must(56.0, 57.0), relation="≈"),
    ]


def albedo_rows(low: Peaks, polar: Peaks) -> list[Row]:
    """Figs. 5a and 5b: largest output by the Earth's light, full Sun being 100 %."""

    def line(inclination: str, paper: float, peaks: Peaks, must: Must) -> Row:
        peak = 100.0 * float(peaks.figure.albedo.max())
        direct = float(peaks.figure.direct.max())
        least, most = 100.0 * float(peaks.attitudes.min()), 100.0 * float(peaks.attitudes.max())
        note = (
            f"the paper does not state its attitude nor what it divides by. Of the {number(direct)} that the cells in "
            f"the Sun read in the figure it is {number(peak / direct)} %; at {len(peaks.attitudes)} other fixed "
            f"attitudes it is {number(least)} to {number(most)} % of full Sun"
        )
        return row(
            f"largest albedo, inclination {inclination} deg", "% of Sun", paper, peak, must,
            relation="≈", note=note,
        )  # fmt: skip

    return [line("45", 25.0, low, Must(20.0, 30.0)), line("90", 50.0, polar, Must(35.0, 60.0))]


def flight_rows(
    variant: Variant, shadow: Shadow, windows: Windows, notes: Mapping[tuple[str, str], str] | None = None
) -> list[Row]:
    """The flights of a variant, which keeps to the paper's bounds as printed, and else must be better than the paper.

    Args:
        shadow: where the orbit of the flights is dark.
        windows: when the mission of the flights is measured.
        notes: label of a configuration and kind of quantity to why it differs from the paper.
    """
    rows = []
    for label, _, configuration in variant.entries:
        paper, here = _PAPER[label], merit(variant.cases, configuration)
        error_must = _ERROR_MUST[label.split(",")[0]] if variant.is_printed else Must(None, paper.error_deg)

        def line(
            kind: str,
            what: str,
            unit: str,
            printed: float | None,
            value: float | None,
            must: Must | None,
            relation: str = "",
            note: str = "",
            label: str = label,
        ) -> Row:
            note = "; ".join(filter(None, ((notes or {}).get((label, kind), ""), note)))
            name = "" if variant.is_printed else variant.name
            return row(
                f"{label}: {what}", unit, printed, value, must, relation=relation, note=note, variant=name
            )  # fmt: skip

        rows += [
            line(HEADING, "heading error at the end", "deg", paper.error_deg, here.heading_error_late_deg, error_must),
            line(HEADING, "heading error, mean over sunlight", "deg", None, here.heading_error_deg, None),
            line(HEADING, f"heading error at {_BRIGHT_MIN} min", "deg", None,
                 _at_minute(variant, configuration, _BRIGHT_MIN), None),
            line(RATE, "rate at 50 min", "deg/s", paper.rate_deg_s, here.rate_50min_deg_s,
                 Must(None, paper.rate_deg_s or _NOISE_DEG_S), "" if paper.rate_deg_s else "noise"),
            line(KNOWLEDGE, "rate error at 50 min", "deg/s", paper.knowledge_deg_s,
                 here.rate_knowledge_50min_deg_s,
                 Must(None, paper.knowledge_deg_s or _NOISE_DEG_S), "" if paper.knowledge_deg_s else "noise",
                 _before_the_dark(variant, configuration, shadow, windows.report_time)),
            line(CONVERGING, "longest converging", "min", paper.converging_min, here.converging_max_min,
                 Must(None, paper.converging_min), paper.relation, _slow_cases(variant, configuration, paper)),
            line(CONVERGED, "cases converged", "%", 100.0, here.converged_percent, Must(100.0)),
        ]  # fmt: skip
    return rows


def _at_minute(variant: Variant, configuration: Configuration, minutes: int) -> float | None:
    """Mean heading error of the cases in the minute before a time."""
    line = curve(variant.percentiles, configuration, HEADING_ERROR.name)
    chosen = (line.time_s > 60.0 * (minutes - 1)) & (line.time_s <= 60.0 * minutes) & np.isfinite(line.mean)
    return float(line.mean[chosen].mean()) if chosen.any() else None


def _minutes(value: float) -> str:
    return f"{number(float(value))} min" if math.isfinite(value) else "never"


def _slow_cases(variant: Variant, configuration: Configuration, paper: _Printed) -> str:
    minutes = column(variant.cases, configuration, "converging_s") / 60.0
    slow = np.flatnonzero(~(minutes <= paper.converging_min))
    if not len(slow):
        return ""
    numbers = column(variant.cases, configuration, "case")
    slow = slow[np.argsort(-np.nan_to_num(minutes[slow], nan=np.inf))]
    named = ", ".join(f"{int(numbers[i])} ({_minutes(minutes[i])})" for i in slow[:_MOST_NAMED])
    more = f" and {len(slow) - _MOST_NAMED} more" if len(slow) > _MOST_NAMED else ""
    text = f"{len(slow)} of {len(minutes)} cases take longer than the paper's longest: {named}{more}"
    return text if configuration.gyro or not variant.is_printed else f"{text}. {_SLOW}"


def _before_the_dark(variant: Variant, configuration: Configuration, shadow: Shadow, time_s: float) -> str:
    """What the rate error was in the last sunlit minute before a time [s], if it is dark then and no gyro measures."""
    if configuration.gyro or not shadow.at(np.array([time_s]))[0]:
        return ""
    line = curve(variant.percentiles, configuration, RATE_KNOWLEDGE.name)
    lit = np.flatnonzero((line.time_s <= time_s) & ~shadow.at(line.time_s))
    if not len(lit):
        return ""
    # the last seconds of sunlight are dim, and no time to read a rate from
    end_s = line.time_s[lit[-1]] - _DUSK_S
    minute = (line.time_s > end_s - 60.0) & (line.time_s <= end_s)
    return (
        f"at {time_s / 60.0:g} min it is dark here and nothing measures a rate, the estimator holds or forgets its "
        f"last one; in a minute of sunlight before, at {end_s / 60.0:.0f} min, "
        f"it errs by {number(float(line.mean[minute].mean()))}"
    )


def attitude_rows(variant: Variant, shadow: Shadow, windows: Windows) -> list[Row]:
    """Attitude errors that the text reads from Fig. 2: the average settles where its own error meets the deadband."""
    entry = next(entry for entry in variant.entries if entry.label == "average, gyro")
    line = curve(variant.percentiles, entry.configuration, POINTING_ERROR.name)
    late = np.flatnonzero(~shadow.at(line.time_s) & np.isfinite(line.mean))
    late = late[line.time_s[late] > line.time_s[late[-1]] - windows.late_time] if len(late) else late
    mean, p95 = (float(values[late].mean()) if len(late) else None for values in (line.mean, line.p95))
    return [
        row("average, gyro: pointing error, mean", "deg", 10.0, mean, Must(None, _DEADBAND_DEG)),
        row("average, gyro: pointing error, 95 %", "deg", 15.0, p95,
            Must(None, _DEADBAND_DEG + _PAPER["average, gyro"].error_deg), relation="≈"),
    ]  # fmt: skip


MEASURED = (
    "heading error at the end: mean over the last five minutes of sunlight, where the Earth disturbs least; the "
    "paper does not say when it reads its numbers, so the mean over sunlight after acquisition stands beside "
    "it, and the minute before 20 min, when the Earth below is bright",
    "rates at 50 min: mean over the minute before, in the dark of this orbit",
    "longest converging: sunlit time with the Sun more than 30 deg off the array normal, acquisition and sunrise alike",
)
"""What is measured when."""


def notable(rows: Sequence[Row]) -> list[str]:
    """The quantities that are larger here than in the paper's text, where less is better."""
    worse = [
        f"{full_name(line)} ({number(line.here)}, paper {number(line.paper)} {line.unit})"
        for line in rows
        if line.unit in ("deg", "deg/s", "min") and line.quantity not in _NOT_LESS
        if line.here is not None and line.paper is not None and line.here > line.paper
    ]
    return [f"worse than in the paper: {'; '.join(worse)}"] if worse else []


_NOT_LESS = ("orbital period", "sunlight in one orbit")
