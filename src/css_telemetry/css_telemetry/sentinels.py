# SPDX-License-Identifier: Apache-2.0
"""Numbers that stand for a missing value in telemetry: fill values far outside of everything that was measured."""

import math
from collections import Counter
from collections.abc import Iterable

import numpy as np

_FILLS = frozenset(
    [
        *(sign * fill for sign in (1.0, -1.0) for fill in (999.0, 9999.0, 99999.0, 999999.0, 1e20, 1e30, 1e31, 1e36)),
        *(2.0**bits - 1.0 for bits in (15, 16, 24, 31, 32, 63, 64)),
        *(-(2.0**bits) for bits in (7, 11, 15, 23, 31, 63)),
        9.969209968386869e36,  # of netCDF
    ]
)
_TIMES_THE_RANGE = 10.0
_LEAST_RANGE = 1e-3  # of readings that are all alike


def fill_values(values: Iterable[float]) -> Counter[float]:
    """Which of the values of one kind are fill values, and how often each occurs.

    A usual fill value counts as one only when it lies ten times further out than all other readings reach, a negative
    one when it lies below them by more than they reach: a cell that saturates at 4095 counts goes on reading 4095.

    Args:
        values: readings of all columns of a kind; NaN are missing already.
    """
    found = Counter(value for value in values if value in _FILLS)
    if not found:
        return found
    others = np.array([value for value in values if value not in found and not math.isnan(value)])
    low, high = (float(others.min()), float(others.max())) if others.size else (0.0, 0.0)
    reach = max(abs(low), abs(high), _LEAST_RANGE)
    return Counter({value: n for value, n in found.items() if _is_outside(value, reach)})


def _is_outside(value: float, reach: float) -> bool:
    return value > _TIMES_THE_RANGE * reach or value < -2.0 * reach
