# SPDX-License-Identifier: Apache-2.0
"""Faults that no single output shows: noise, and a scale or level that changes with age."""

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from css_calibration.batch_fit import Fit
from css_calibration.cell_bounds import unpredicted_earth
from css_calibration.cell_data import CellData
from css_calibration.fault_stretches import Outputs
from css_calibration.recorded import Recorded
from css_common.health import KIND_DRIFTING, KIND_NOISY

_TIMES, _LEAST_NOISE = 3.0, 0.008
_BRIGHTNESS = (0.02, 0.15, 0.4, 0.7, np.inf)  # outputs within which noise is alike
_FEWEST_OTHERS = 2
_BESIDE = 0.05  # [-] beside its brightness that a sample may be
_FEWEST_LEAPS, _LEAST_LEAPS, _MOST_LEAPS = 15, 0.02, 0.4
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
    """Cells whose outputs change more from sample to sample than those of others that are as bright.

    Noise goes with the light where it is a loss or a jitter: a lit cell is not to be held against dark ones.
    """
    thirds = np.abs(np.diff(recorded.voltages, n=3, axis=0))
    samples = np.array([recorded.voltages[k : len(thirds) + k] for k in range(4)])
    brightness, least, most = np.median(samples, axis=0), samples.min(axis=0), samples.max(axis=0)
    worst: dict[int, tuple[float, float]] = {}  # noise of each cell that is beyond, and that of others as bright
    for low, high in pairwise(_BRIGHTNESS):
        # neither on the way through the edge of a view nor through a spike is a cell as bright as the middle one says
        steady = (least > low - _BESIDE) & (most <= high + _BESIDE)
        noise = _noise_between(np.where(steady, thirds, np.nan), brightness, low, high)
        for i in np.flatnonzero(np.isfinite(noise)).tolist():
            others = np.delete(noise, i)
            if np.isfinite(others).sum() < _FEWEST_OTHERS:
                continue
            usual = float(np.nanmedian(others))
            if noise[i] > max(_TIMES * usual, usual + _LEAST_NOISE) and noise[i] > worst.get(i, (0.0, 0.0))[0]:
                worst[i] = (float(noise[i]), usual)
    return {
        i: Slow(KIND_NOISY, f"noise of {sigma:.4f} where others as bright have {usual:.4f}")
        for i, (sigma, usual) in worst.items()
    }


def _noise_between(thirds: np.ndarray, brightness: np.ndarray, low: float, high: float) -> np.ndarray:
    """(N,) noise of each cell [-] by third differences (M, N), while it is so bright; NaN: too seldom."""
    noise = np.full(thirds.shape[1], np.nan)
    for i in range(len(noise)):
        inside = (brightness[:, i] > low) & (brightness[:, i] <= high) & np.isfinite(thirds[:, i])
        if inside.sum() > _FEWEST:
            noise[i] = 1.4826 * float(np.median(thirds[inside, i])) / math.sqrt(20.0)
    return noise


def spiky(outputs: Outputs) -> dict[int, tuple[int, int]]:
    """Cells that leap now and then where others do not, and the first and last instant of it."""
    known = np.isfinite(outputs.expected)
    leaps = outputs.leaps & known
    count = leaps.sum(axis=0)
    share = count / np.maximum(known.sum(axis=0), 1)  # of all that is known
    found = {}
    for i in np.flatnonzero((count >= _FEWEST_LEAPS) & (share > _LEAST_LEAPS)).tolist():
        if share[i] > _TIMES * max(float(np.max(np.delete(share, i), initial=0.0)), _LEAST_LEAPS / _TIMES):
            rows = np.flatnonzero(leaps[:, i])
            first, last = int(rows[0]), int(rows[-1])
            # noise leaps at most samples
            if count[i] < _MOST_LEAPS * known[first : last + 1, i].sum():
                found[i] = (first, last)
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
    # the Earth goes by as evenly as cells age
    by_earth = unpredicted_earth(data, cell) / float(np.median(expected[rows, cell]))
    if abs(slope) < _SIGMAS * error or abs(span) < max(_CHANGE, by_earth) or explained < _STEADY:
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
