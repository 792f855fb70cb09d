# SPDX-License-Identifier: Apache-2.0
"""What a flight has told of the cells: gain and tilts with their error bars, and what of them no flight could tell.

Whether something was observed follows from the covariance against what was known before. Single numbers may all be
little known although most of what they say together is known, and the other way round; so combinations stand in the
report too: the gain of all cells, which the intensity of the light resembles, and a turn of all cells together, which
only a body that turns by large angles under a gyro tells from another attitude.
"""

import math
from typing import NamedTuple

import numpy as np

from css_common.vectors import axes_across
from css_estimation.sun_filter.calibration import PER_CELL, first_state
from css_estimation.sun_filter.memory import GAIN, X_GAIN, SunFilterMemory
from css_estimation.sun_filter.options import SunFilterParameters

OBSERVED = 0.5
"""Part of the error bar before the flight below which a quantity counts as observed."""


class Calibrated(NamedTuple):
    """One quantity."""

    name: str
    unit: str  # `%` or `deg`
    value: float  # less that of the mission
    sigma: float  # its error, 1 sigma
    prior: float  # the same before the flight
    observable: bool  # the flight has told it


def calibration_states(p: SunFilterParameters, m: SunFilterMemory) -> tuple[np.ndarray, np.ndarray]:
    """Gain [-] and two tilts [rad] of each cell, (N, 3), and their covariance (3 N, 3 N), by the likeliest attitude."""
    cells = len(p.cells)
    best, first = int(np.argmax(m.weights)), first_state.py_func(cells)
    states = m.estimates[best, X_GAIN - GAIN + first :].reshape(cells, PER_CELL)
    return states.copy(), m.covariances[best, first:, first:].copy()


def calibration_report(p: SunFilterParameters, m: SunFilterMemory) -> list[Calibrated]:
    """All quantities: of each cell, then of all together; empty where cells are not calibrated in flight."""
    if p.calibration.per_cell == 0:
        return []
    cells = len(p.cells)
    states, covariance = calibration_states(p, m)
    before = np.diag(np.tile([p.calibration.gain, p.calibration.tilt, p.calibration.tilt], cells))
    names = [f"cell {i}: {what}" for i in range(cells) for what in ("gain", "tilt 1", "tilt 2")]
    rows = list(zip(names, ["%", "deg", "deg"] * cells, np.eye(PER_CELL * cells), strict=True))
    rows += [("gain of all cells", "%", _gain_of_all(cells))]
    turns = _turns_of_all(p)
    rows += [(f"turn of all cells about {axis}", "deg", turns[k]) for k, axis in enumerate("xyz")]
    return [_calibrated(name, unit, weights, states.ravel(), covariance, before) for name, unit, weights in rows]


def calibration_line(report: list[Calibrated]) -> str:
    """The same in one line for a log."""
    observed = sum(row.observable for row in report)
    missed = [f"{row.name} ({row.sigma:.2g} {row.unit} of {row.prior:.2g})" for row in report if not row.observable]
    text = f"calibration of the cells: {observed} of {len(report)} quantities observed"
    return text + (f"; not: {', '.join(missed)}" if missed else "")


def _calibrated(
    name: str, unit: str, weights: np.ndarray, states: np.ndarray, covariance: np.ndarray, before: np.ndarray
) -> Calibrated:
    factor = 100.0 if unit == "%" else math.degrees(1.0)
    sigma = float(np.sqrt(max(0.0, weights @ covariance @ weights)))
    prior = float(np.sqrt(weights @ before @ weights))
    value = factor * float(weights @ states)
    return Calibrated(name, unit, value, factor * sigma, factor * prior, sigma < OBSERVED * prior)


def _gain_of_all(cells: int) -> np.ndarray:
    """(3 N,) weights of the mean gain."""
    return np.tile([1.0 / cells, 0.0, 0.0], cells)


def _turns_of_all(p: SunFilterParameters) -> np.ndarray:
    """(3, 3 N) weights of the turns about x, y and z that fit the tilts of all cells best."""
    cells = p.cells
    by_turn = np.zeros((PER_CELL * len(cells), 3))
    for i, (x, y, z) in enumerate(zip(cells["nx"], cells["ny"], cells["nz"], strict=True)):
        normal = np.array([x, y, z])
        # dn = turn x n, along the axes of the tilts
        for k, axis in enumerate(axes_across.py_func((float(x), float(y), float(z)))):
            by_turn[PER_CELL * i + 1 + k] = np.cross(normal, axis)
    return np.linalg.pinv(by_turn)
