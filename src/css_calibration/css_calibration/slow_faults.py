# SPDX-License-Identifier: Apache-2.0
"""Faults that no single output shows: noise, and a scale or level that changes with age."""

import math
from typing import NamedTuple

import numpy as np

from css_calibration.batch_fit import Fit
from css_calibration.cell_data import CellData
from css_calibration.recorded import Recorded
from css_common.health import KIND_DRIFTING, KIND_NOISY

_TIMES, _LEAST_NOISE = 3.0, 0.008
_BLOCKS = 8
_FEWEST = 12  # lit outputs of a block
_SIGMAS, _CHANGE = 6.0, 0.06
_STEP = 0.85  # of the squares that a line leaves, below which a step is the better story
_STEADY = 0.5  # share of the change that a straight line explains


class Slow(NamedTuple):
    """One fault."""

    kind: int
    evidence: str


def noisy_cells(recorded: Recorded) -> dict[int, Slow]:
    """Cells whose outputs change more from sample to sample than those of the others."""
    thirds = np.abs(np.diff(recorded.voltages, n=3, axis=0))
    bright = recorded.voltages[3:] > 0.02
    noise = []
    for i in range(recorded.voltages.shape[1]):
        values = thirds[bright[:, i] & np.isfinite(thirds[:, i]), i]
        noise.append(1.4826 * float(np.median(values)) / math.sqrt(20.0) if len(values) > _FEWEST else math.nan)
    usual = float(np.nanmedian(noise)) if np.isfinite(noise).any() else math.nan
    found = {}
    for i, sigma in enumerate(noise):
        if sigma > max(_TIMES * usual, usual + _LEAST_NOISE):
            found[i] = Slow(KIND_NOISY, f"noise of {sigma:.4f} where others have {usual:.4f}")
    return found


def ageing(data: CellData, result: Fit, cell: int) -> Slow | None:
    """A cell whose output, relative to the light on it, goes up or down evenly over the recording."""
    expected, _, _ = data.predicted(result.parameters, result.earth)
    lit = data.usable[:, cell] & data.seen[:, cell] & (expected[:, cell] > 0.25)
    rows = np.flatnonzero(lit)
    if len(rows) < _BLOCKS * _FEWEST:
        return None
    ratio = data.voltages[rows, cell] / expected[rows, cell]
    blocks = np.array_split(np.arange(len(rows)), _BLOCKS)
    time = np.array([data.time[rows[b]].mean() for b in blocks])
    median = np.array([np.median(ratio[b]) for b in blocks])
    spread = np.array([1.4826 * np.median(np.abs(ratio[b] - m)) for b, m in zip(blocks, median, strict=True)])
    sigma = np.maximum(1.25 * spread / np.sqrt([len(b) for b in blocks]), 2e-3)
    weight = 1.0 / sigma**2
    off = time - np.average(time, weights=weight)
    level = np.average(median, weights=weight)
    slope = float(np.sum(off * (median - level) * weight) / np.sum(off**2 * weight))
    error = float(1.0 / np.sqrt(np.sum(off**2 * weight)))
    line = level + slope * off
    explained = 1.0 - np.var(median - line) / max(float(np.var(median)), 1e-12)
    span = slope * (data.time[rows[-1]] - data.time[rows[0]])
    if abs(slope) < _SIGMAS * error or abs(span) < _CHANGE or explained < _STEADY:
        return None
    if _is_step(data.time[rows], ratio):
        return None
    per_hour = 100.0 * slope * 3600.0
    return Slow(KIND_DRIFTING, f"its scale changes by {100.0 * span:+.1f} % over the recording, {per_hour:+.1f} %/h")


def _is_step(time: np.ndarray, values: np.ndarray) -> bool:
    """Whether one sudden change explains values better than a straight line: a fault with a beginning, not an age."""
    count = np.arange(1, len(values))
    sums, squares = np.cumsum(values), np.cumsum(values**2)
    before = squares[:-1] - sums[:-1] ** 2 / count
    after = (squares[-1] - squares[:-1]) - (sums[-1] - sums[:-1]) ** 2 / (len(values) - count)
    slope, level = np.polyfit(time - time[0], values, 1)
    line = float(np.sum((values - level - slope * (time - time[0])) ** 2))
    return float(np.min(before + after)) < _STEP * line
