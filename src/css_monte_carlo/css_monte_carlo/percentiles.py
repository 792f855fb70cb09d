# SPDX-License-Identifier: Apache-2.0
"""Percentiles over the cases against time."""

import numpy as np

PERCENTS = (5, 25, 50, 75, 95)


def over_cases(samples: np.ndarray) -> dict[str, np.ndarray]:
    """Count, mean and percentiles, (S,) each, of samples (C, S); NaN marks a case without a value at that time.

    Percentiles are linear between order statistics, as numpy's.
    """
    count = np.count_nonzero(~np.isnan(samples), axis=0)
    ordered = np.sort(samples, axis=0)  # NaN last
    columns = np.arange(samples.shape[1])
    has_any = count > 0
    mean = np.full(samples.shape[1], np.nan)
    np.divide(np.nansum(samples, axis=0, dtype=np.float64), count, out=mean, where=has_any)
    result = {"count": count, "mean": mean}
    last = np.maximum(count - 1, 0)
    for percent in PERCENTS:
        position = 0.01 * percent * last
        below = np.floor(position).astype(np.int64)
        low = ordered[below, columns].astype(np.float64)
        high = ordered[np.minimum(below + 1, last), columns].astype(np.float64)
        result[f"p{percent:02d}"] = low + (position - below) * (high - low)
    return result
