# SPDX-License-Identifier: Apache-2.0
"""Fewer points of a long series that look the same: of each stretch the smallest and the largest value are kept."""

import numpy as np

BINS = 1500
"""Stretches of a series: more than a wide screen has columns of points for a plot."""


def kept_rows(values: np.ndarray, bins: int = BINS) -> np.ndarray:
    """Rows (K,) of a series that are drawn, ascending.

    The first and last row are kept, and of each of `bins` stretches the smallest and the largest value; where a stretch
    has rows without a number, the first of these too, which is a gap. A spike of one row is never lost.

    Args:
        values: (N,) with NaN where there is none.
        bins: into how many stretches a long series is cut; one of at most twice as many rows is kept whole.
    """
    count = len(values)
    if count <= 2 * bins:
        return np.arange(count)
    size = -(-count // bins)
    stretches = -(-count // size)
    padded = np.full(stretches * size, np.nan)
    padded[:count] = values
    rows = padded.reshape(stretches, size)
    missing = np.isnan(rows)
    has_number = ~missing.all(axis=1)
    first = size * np.arange(stretches)
    low = first + np.where(missing, np.inf, rows).argmin(axis=1)
    high = first + np.where(missing, -np.inf, rows).argmax(axis=1)
    gap = (first + missing.argmax(axis=1))[missing.any(axis=1)]
    chosen = np.concatenate(([0, count - 1], low[has_number], high[has_number], gap[gap < count]))
    return np.unique(chosen)


def merged_spans(begin: np.ndarray, end: np.ndarray, least_gap: float) -> tuple[np.ndarray, np.ndarray]:
    """Spans with shorter gaps than `least_gap` between them closed; no span is lost.

    Args:
        begin, end: (S,) of spans in ascending order that do not overlap.
        least_gap: in their unit.
    """
    if len(begin) < 2:
        return begin, end
    apart = begin[1:] - end[:-1] >= least_gap
    return begin[np.concatenate(([True], apart))], end[np.concatenate((apart, [True]))]
