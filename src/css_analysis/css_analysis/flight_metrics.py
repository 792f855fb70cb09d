# SPDX-License-Identifier: Apache-2.0
"""How well a flight was estimated and pointed, as O'Keefe & Schaub 2013 measure it (their Figs. 6-8).

Everything is measured against the truth; without a truth in the log every quantity is None. Definitions:

sunlit          more than half of the solar disc is in view (truth.illumination > 0.5).
power positive  the true Sun is within 30 deg of the array normal.
acquisition     the first moment from which the flight stays sunlit and power positive for 60 s.

Imported telemetry says nothing about solar arrays and orbit: nothing is told of pointing and acquisition, and errors
of estimates count over all of its lines.
"""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from css_analysis.estimate_errors import attitude_errors, estimated_rows, heading_errors
from css_analysis.flight_log import FlightLog

POWER_POSITIVE = np.radians(30.0)
"""Largest angle [rad] between array normal and Sun at which the arrays carry the spacecraft."""
ACQUIRED_AFTER = 60.0
"""Power-positive time [s] that makes an acquisition."""
SETTLED_AFTER = 300.0
"""Time [s] from the epoch after which an attitude filter counts as settled."""
FINAL_TIME = 60.0
"""Time [s] at the end of the flight over which the final rate is averaged."""

Run = dict[str, Any]

QUANTITIES = {
    "power_positive_s": "sunlit time [s] with the Sun over 30 deg off the array normal; None if never within",
    "heading_error_mean_deg": "mean angle [deg] of estimated to true Sun, sunlit, after acquisition",
    "heading_error_p95_deg": "95th percentile of the same angle [deg]",
    "attitude_error_mean_deg": "mean angle [deg] of estimated to true attitude, from 300 s on",
    "attitude_error_p95_deg": "95th percentile of the same angle [deg]",
    "attitude_nees": "mean normalised error squared of the attitude, 3 if the filter is consistent, from 300 s on",
    "pointing_error_mean_deg": "mean angle [deg] of array normal to true Sun, sunlit, after acquisition",
    "pointing_error_sunlit_deg": "the same over all sunlit steps [deg], those before acquisition included",
    "heading_error_sunlit_deg": "mean angle [deg] of estimated to true Sun over all sunlit steps with an estimate",
    "rate_final_deg_s": "mean norm of the true body rate [deg/s] over the last 60 s",
    "steps_without_estimate": "sunlit steps of the flight at which the estimator had none",
}
"""Measured quantities of a run and what they mean."""

_NOT_ACQUIRED = "the flight or its truth has no 60 s with the Sun within 30 deg of the array normal, or none after them"
_NOT_SETTLED = "no attitude was estimated after the first 300 s"
WITHOUT_VALUE = {
    "power_positive_s": _NOT_ACQUIRED,
    "heading_error_mean_deg": _NOT_ACQUIRED,
    "heading_error_p95_deg": _NOT_ACQUIRED,
    "pointing_error_mean_deg": _NOT_ACQUIRED,
    "attitude_error_mean_deg": _NOT_SETTLED,
    "attitude_error_p95_deg": _NOT_SETTLED,
    "attitude_nees": _NOT_SETTLED,
}
"""Why a quantity may have no value; others have one wherever there are truth and estimates."""


def estimator_runs(log: FlightLog, names: Iterable[str] | None = None, flown: str | None = None) -> list[Run]:
    """What each estimator of a flight achieved: one dictionary with `QUANTITIES`, estimator, gyro and flown.

    `power_positive_s`, the pointing errors and `rate_final_deg_s` belong to the flight: an estimator
    that was replayed or flew beside has those of the one that controlled.

    Args:
        names: estimators to report, all by default.
        flown: the estimator that controlled, when the log does not know.
    """
    flown = log.flown if flown is None else flown
    flight = _flight_quantities(log)
    return [
        {
            "estimator": name,
            "gyro": "on" if log.uses_gyro(name) else "off",
            "flown": name == flown,
            "power_positive_s": flight["power_positive_s"],
            **_heading_quantities(log, name),
            **_attitude_quantities(log, name),
            "pointing_error_mean_deg": flight["pointing_error_mean_deg"],
            "pointing_error_sunlit_deg": flight["pointing_error_sunlit_deg"],
            "heading_error_sunlit_deg": _heading_error_sunlit(log, name),
            "rate_final_deg_s": flight["rate_final_deg_s"],
            "steps_without_estimate": _steps_without_estimate(log, name),
        }
        for name in ((*log.estimates, *log.attitudes) if names is None else names)
    ]


def acquisition(log: FlightLog) -> int | None:
    """Step of the truth from which the flight stays sunlit and power positive for 60 s; None if never."""
    if log.truth is None:
        return None
    for first, last in _runs(log.sunlit & (log.pointing_error <= POWER_POSITIVE)):
        # a hundredth of a step of slack: stamps are whole nanoseconds
        if _span(log, first, last) >= ACQUIRED_AFTER - 0.01 * log.period:
            return first
    return None


class Pass(NamedTuple):
    """One stretch of sunlight."""

    start_s: float  # [s] since the epoch
    end_s: float  # [s] since the epoch
    converging_s: float  # [s] of it with the Sun more than 30 deg off the array normal
    acquired_s: float | None  # [s] from its start to its acquisition, None: not in this stretch


def sunlit_passes(log: FlightLog) -> list[Pass]:
    """The stretches of sunlight: the first holds the first acquisition, the others those after an eclipse."""
    if log.truth is None:
        return []
    time = log.time(log.truth)
    away = log.pointing_error > POWER_POSITIVE
    passes = []
    for first, last in _runs(log.sunlit):
        within = _runs(~away[first : last + 1])
        slack = ACQUIRED_AFTER - 0.01 * log.period
        start = next((first + a for a, b in within if _span(log, first + a, first + b) >= slack), None)
        acquired = None if start is None else float(time[start] - time[first])
        converging = float(np.count_nonzero(away[first : last + 1])) * log.period
        passes.append(Pass(float(time[first]), float(time[last]), converging, acquired))
    return passes


def _flight_quantities(log: FlightLog) -> Run:
    unknown: Run = dict.fromkeys(
        ("power_positive_s", "pointing_error_mean_deg", "pointing_error_sunlit_deg", "rate_final_deg_s")
    )
    if log.truth is None:
        return unknown
    if log.imported:
        # a table without rates has zeros there
        return unknown | ({"rate_final_deg_s": _final_rate(log)} if np.any(log.truth.omega_bn_b) else {})
    away = log.pointing_error > POWER_POSITIVE
    start = acquisition(log)
    counted = _counted(log, start)
    return {
        "power_positive_s": float(np.count_nonzero(away & log.sunlit)) * log.period
        if np.any(~away & log.sunlit)
        else None,
        "pointing_error_mean_deg": _mean_deg(log.pointing_error[counted]),
        "pointing_error_sunlit_deg": _mean_deg(log.pointing_error[log.sunlit]),
        "rate_final_deg_s": _final_rate(log),
    }


def _final_rate(log: FlightLog) -> float | None:
    time = log.time(log.having("truth"))
    return _mean_deg(log.rate[time > time[-1] - FINAL_TIME + 0.01 * log.period])


def _heading_quantities(log: FlightLog, name: str) -> Run:
    mean = p95 = None
    if log.truth is not None and name in log.estimates:
        steps, errors = heading_errors(log, name)
        errors = errors[_counted(log, acquisition(log))[steps]]
        mean = _mean_deg(errors)
        p95 = float(np.degrees(np.percentile(errors, 95.0))) if len(errors) else None
    return {"heading_error_mean_deg": mean, "heading_error_p95_deg": p95}


def _heading_error_sunlit(log: FlightLog, name: str) -> float | None:
    if log.truth is None or name not in log.estimates:
        return None
    steps, errors = heading_errors(log, name)
    return _mean_deg(errors[log.sunlit[steps]])


def _attitude_quantities(log: FlightLog, name: str) -> Run:
    mean = p95 = nees = None
    if log.truth is not None and name in log.attitudes:
        steps, errors, squared = attitude_errors(log, name)
        settled = log.time(log.truth)[steps] >= SETTLED_AFTER - 0.01 * log.period
        mean = _mean_deg(errors[settled])
        if settled.any():
            p95 = float(np.degrees(np.percentile(errors[settled], 95.0)))
            nees = float(np.mean(squared[settled]))
    return {"attitude_error_mean_deg": mean, "attitude_error_p95_deg": p95, "attitude_nees": nees}


def _steps_without_estimate(log: FlightLog, name: str) -> int | None:
    if log.truth is None:
        return None
    without = log.sunlit.copy()
    without[estimated_rows(log, name)[1]] = False
    return int(np.count_nonzero(without))


def _counted(log: FlightLog, start: int | None) -> np.ndarray:
    """(M,) True at the sunlit steps from acquisition on."""
    counted = log.sunlit.copy()
    if log.imported:
        return counted
    counted[: len(counted) if start is None else start] = False
    return counted


def _runs(flags: np.ndarray) -> list[tuple[int, int]]:
    """First and last index of each stretch of True."""
    edges = np.diff(np.concatenate(([0], flags.astype(np.int8), [0])))
    firsts, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    return list(zip(firsts.tolist(), (ends - 1).tolist(), strict=True))


def _span(log: FlightLog, first: int, last: int) -> float:
    """Time [s] from one step of the truth to another."""
    stamps = log.having("truth").stamp_ns
    return float(stamps[last] - stamps[first]) * 1e-9


def _mean_deg(angles: np.ndarray) -> float | None:
    return float(np.degrees(np.mean(angles))) if len(angles) else None
