# SPDX-License-Identifier: Apache-2.0
"""How well some independent cases tell a number of all cases: 95 % intervals."""

import math
import warnings

import numpy as np
from scipy import stats

LEVEL = 0.95

Interval = tuple[float | None, float | None]
"""Both ends; None: there is no such end, because too few cases tell."""

_RESAMPLES = 2000
_BATCH = 2_000_000  # numbers that a bootstrap holds at a time


def share_interval(hits: int, cases: int) -> Interval:
    """Of the share of cases that something is true of, exact (Clopper & Pearson 1934)."""
    if cases == 0:
        return (None, None)
    found = stats.binomtest(hits, cases).proportion_ci(LEVEL, method="exact")
    return (float(found.low), float(found.high))


def mean_interval(values: np.ndarray) -> Interval:
    """Of the mean over all cases from values (C,), by the bootstrap, bias-corrected and accelerated (Efron 1987)."""
    if len(values) < 2:
        return (None, None)
    if np.ptp(values) == 0.0:
        return (float(values[0]), float(values[0]))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of values that are nearly alike: its ends are then NaN
        found = stats.bootstrap(
            (values,),
            np.mean,
            n_resamples=_RESAMPLES,
            batch=max(1, _BATCH // len(values)),
            confidence_level=LEVEL,
            rng=np.random.default_rng(0),
        ).confidence_interval
    if not (math.isfinite(found.low) and math.isfinite(found.high)):
        half = stats.t.ppf(0.5 + 0.5 * LEVEL, len(values) - 1) * np.std(values, ddof=1) / math.sqrt(len(values))
        return (float(np.mean(values) - half), float(np.mean(values) + half))
    return (float(found.low), float(found.high))


def percentile_interval(values: np.ndarray, percent: float) -> Interval:
    """Of a percentile over all cases from values (C,), by order statistics: exact for every distribution.

    An end that would need more cases is None: for the upper end of a 95 % percentile these are 72.
    """
    ordered, n, p = np.sort(values), len(values), 0.01 * percent
    tail = 0.5 * (1.0 - LEVEL)
    # the number of cases below the percentile is binomial; an end is the last order statistic that is sure
    below = int(stats.binom.ppf(tail, n, p)) if n else 0
    above = int(stats.binom.isf(tail, n, p)) + 1 if n else 0
    low = float(ordered[below - 1]) if below >= 1 else None
    high = float(ordered[above - 1]) if 0 < above <= n else None
    return (low, high)


def beyond_largest(cases: int) -> float | None:
    """Share of all cases that is beyond the largest of some at the most, with 95 % confidence; None without cases."""
    return 1.0 - (1.0 - LEVEL) ** (1.0 / cases) if cases else None
