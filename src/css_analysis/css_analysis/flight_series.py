# SPDX-License-Identifier: Apache-2.0
"""What is drawn of a flight, as numbers: the same for figures and for pages."""

from typing import NamedTuple

import numpy as np

from css_analysis.flight_log import FlightLog
from css_msgs.msg import ControlStatus, SunEstimate

RPM = 60.0 / (2.0 * np.pi)
"""Revolutions a minute of one rad/s."""
LEAST_ERROR = 1e-2
"""[deg] Below it an error is drawn as this, for the logarithmic axis."""
MODES = {
    ControlStatus.MODE_SAFE: "safe",
    ControlStatus.MODE_DETUMBLE: "detumble",
    ControlStatus.MODE_SUN_SEARCH: "search",
    ControlStatus.MODE_SUN_ACQUISITION: "acquisition",
    ControlStatus.MODE_SUN_POINT: "point",
    ControlStatus.MODE_ECLIPSE: "eclipse",
}
"""Names of the modes of control."""


class TimeAxis(NamedTuple):
    """Abscissa of a flight."""

    scale: float  # [s] of one unit
    label: str
    first: float  # in its unit
    last: float


def time_axis(log: FlightLog) -> TimeAxis:
    """From the first to the last message; in minutes when that is longer than ten of them, else in seconds."""
    spans = [log.time(columns)[[0, -1]] for columns in log.columns()]
    first, last = min(span[0] for span in spans), max(span[1] for span in spans)
    scale, label = (60.0, "time [min]") if last - first > 600.0 else (1.0, "time [s]")
    return TimeAxis(scale, label, first / scale, last / scale)


def dark_times(log: FlightLog) -> tuple[np.ndarray, np.ndarray] | None:
    """Times (T,) [s] and whether (T,) the flight is not sunlit then.

    Without truth an estimator says so; None: nobody does.
    """
    if log.truth is not None:
        return log.time(log.truth), ~log.sunlit
    if log.estimates:
        columns = next(iter(log.estimates.values()))
        return log.time(columns), columns.eclipse == SunEstimate.ECLIPSE_ECLIPSED
    return None


def error_series(log: FlightLog, steps: np.ndarray, errors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Times [s] and errors [deg], at least `LEAST_ERROR`; not a number where a stretch of steps has no estimate.

    Args:
        log: the flight.
        steps: (K,) steps of the truth that have an estimate.
        errors: (K,) [rad].
    """
    degrees = np.maximum(np.degrees(errors), LEAST_ERROR)
    time_s = log.time(log.having("truth"))[steps]
    gaps = gap_rows(steps)
    return np.insert(time_s, gaps, np.nan), np.insert(degrees, gaps, np.nan)


def gap_rows(steps: np.ndarray) -> np.ndarray:
    """Rows (G,) before which a stretch of steps of the truth is left out, of rows (K,) at these steps."""
    if not len(steps):
        return steps
    spacing = np.diff(steps, prepend=steps[:1])
    return np.flatnonzero(spacing > 3 * max(np.median(spacing), 1))


def estimator_label(log: FlightLog, name: str) -> str:
    """Name of an estimator with what is to be known of it."""
    gyro = "gyro" if log.uses_gyro(name) else "no gyro"
    return f"{name} ({gyro}{', flown' if name == log.flown else ''})"
