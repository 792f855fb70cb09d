# SPDX-License-Identifier: Apache-2.0
"""Numbers that stand for a missing value in telemetry: fill values far outside of everything that was measured."""

import numpy as np

_FILLS = np.array(
    sorted(
        {
            *(s * fill for s in (1.0, -1.0) for fill in (999.0, 9999.0, 99999.0, 999999.0, 1e20, 1e30, 1e31, 1e36)),
            *(2.0**bits - 1.0 for bits in (15, 16, 24, 31, 32, 63, 64)),
            *(-(2.0**bits) for bits in (7, 11, 15, 23, 31, 63)),
            -99.0, -999.9, -999.99, -9999.9, -9999.99,
            9.969209968386869e36,  # of netCDF
        }
    )
)  # fmt: skip
_TIMES_THE_RANGE = 10.0
_LEAST_RANGE = 1e-3  # of readings that are all alike


def fill_values(values: np.ndarray) -> tuple[float, ...]:
    """Which of the values of one kind are fill values.

    A usual fill value counts as one only when it lies ten times further out than all other readings reach, a negative
    one when it lies below them by more than they reach: a cell that saturates at 4095 counts goes on reading 4095.

    Args:
        values: readings of all columns of a kind; NaN are missing already.
    """
    usual = np.isin(values, _FILLS)
    if not np.any(usual):
        return ()
    others = values[~usual & np.isfinite(values)]
    reach = max(float(np.max(np.abs(others))) if len(others) else 0.0, _LEAST_RANGE)
    found = np.unique(values[usual])
    return tuple(float(v) for v in found if v > _TIMES_THE_RANGE * reach or v < -2.0 * reach)
