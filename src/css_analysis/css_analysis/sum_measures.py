# SPDX-License-Identifier: Apache-2.0
"""How quantities are taken from what a study summed up while its cases flew, each for all cases at once."""

from collections.abc import Callable

import numpy as np

from css_analysis.quantity import CaseSums


def percentile_of_histogram(counts: np.ndarray, percent: float, bin_deg: float) -> float:
    """Percentile [deg] of errors in bins of `bin_deg`, linear within a bin; NaN without any."""
    total = int(counts.sum())
    if total == 0:
        return float("nan")
    wanted = 0.01 * percent * total
    up_to = np.cumsum(counts)
    index = int(np.searchsorted(up_to, wanted))
    before = int(up_to[index - 1]) if index else 0
    return bin_deg * (index + (wanted - before) / int(counts[index]))


def mean_of(total: str, count: str, each: int = 1) -> Callable[[CaseSums], np.ndarray]:
    """A sum over what it counts, of which every one stands for `each`."""
    return lambda sums: _ratio(sums.totals[total], each * sums.totals[count])


def _ratio(total: np.ndarray, count: np.ndarray) -> np.ndarray:
    return np.divide(total, count, out=np.full(len(count), np.nan), where=count > 0)


def time_of(steps: str) -> Callable[[CaseSums], np.ndarray]:
    """Time [s] of so many steps."""
    return lambda sums: sums.totals[steps] * sums.period_s


def converging(sums: CaseSums) -> np.ndarray:
    """Sunlit time [s] with the Sun far off the array normal; NaN where it never came near."""
    t = sums.totals
    return np.where(t["within"] > 0, (t["away_first"] + t["away_later"]) * sums.period_s, np.nan)


def first_of(step: str) -> Callable[[CaseSums], np.ndarray]:
    """Time [s] of a step since the epoch, NaN for -1."""
    return lambda sums: np.where(sums.totals[step] >= 0, sums.totals[step] * sums.period_s, np.nan)


def error_p95(sums: CaseSums) -> np.ndarray:
    """95th percentile [deg] of the errors of each case."""
    return np.array([percentile_of_histogram(row, 95.0, sums.bin_deg) for row in sums.histogram])


def largest_error(sums: CaseSums) -> np.ndarray:
    """Largest attitude error [deg] once settled; NaN where that never was."""
    return np.where(sums.totals["settled"] > 0, sums.totals["error_max"], np.nan)


def bias_nees(sums: CaseSums) -> np.ndarray:
    """Normalised error squared of attitude and gyro bias together, NaN without a bias."""
    nees = mean_of("nees6_sum", "settled")(sums)
    # a filter that estimates no bias has no covariance of it
    return np.where(np.isfinite(nees), nees, np.nan)


def pointing_sunlit(sums: CaseSums) -> np.ndarray:
    """Mean angle [deg] of array normal to Sun over all sunlight."""
    t = sums.totals
    return _ratio(t["sunlit_pointing_sum"], t["away_first"] + t["away_later"] + t["within"])
