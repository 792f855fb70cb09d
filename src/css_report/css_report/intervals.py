# SPDX-License-Identifier: Apache-2.0
"""Confidence intervals of what a study measured, 95 % two-sided."""

import math

import numpy as np
from scipy import special

LEVEL = 0.95
_TAIL = 0.5 * (1.0 + LEVEL)
_Z = float(special.ndtri(_TAIL))

Interval = tuple[float | None, float | None]
"""Low and high end; None: the cases are too few for it."""


def share_interval(hits: int, count: int) -> Interval:
    """Of a share of `hits` in `count` cases (Wilson 1927)."""
    if count == 0:
        return None, None
    share, z2 = hits / count, _Z * _Z
    middle = (share + 0.5 * z2 / count) / (1.0 + z2 / count)
    half = _Z * math.sqrt(share * (1.0 - share) / count + 0.25 * z2 / count**2) / (1.0 + z2 / count)
    # at the ends rounding must not cut off the share itself
    return (0.0 if hits == 0 else max(middle - half, 0.0)), (1.0 if hits == count else min(middle + half, 1.0))


def mean_interval(values: np.ndarray) -> Interval:
    """Of the mean of values (N,), by Student's distribution."""
    count = len(values)
    if count < 2:
        return None, None
    half = float(special.stdtrit(count - 1, _TAIL)) * float(np.std(values, ddof=1)) / math.sqrt(count)
    mean = float(np.mean(values))
    return mean - half, mean + half


def percentile_interval(values: np.ndarray, percent: float) -> Interval:
    """Of a percentile of values (N,), by the order statistics around it, whatever their distribution.

    The number of values below a percentile is binomial (Conover, Practical Nonparametric Statistics, section 3.2).
    """
    ordered, count = np.sort(values), len(values)
    if count == 0:
        return None, None
    share = 0.01 * percent
    below = special.bdtr(np.arange(count), count, share)  # of at most k values below it
    low = int(np.searchsorted(below, 1.0 - _TAIL, side="right"))
    high = int(np.searchsorted(below, _TAIL, side="left"))
    return (
        float(ordered[low - 1]) if low >= 1 else None,
        float(ordered[high]) if high < count else None,
    )
