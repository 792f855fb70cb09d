# SPDX-License-Identifier: Apache-2.0
"""What became of faults in the cases of a study, from the sums that it kept: shown, isolated, and isolated wrongly.

Sums of C cases are a `HealthTallies` of `css_monte_carlo.health_tallies`.
"""

from typing import Any

import numpy as np

CELLS, WHEELS, RODS, SENSORS = range(4)
"""Rows of the sums of a case: sorts of units that may be isolated. A sensor is gyro or magnetometer as a whole."""

_LONG_AFTER = np.iinfo(np.int64).max


def shown_s(sums: Any, period_s: float) -> np.ndarray:
    """(C,) time since the epoch [s] at which the first fault of a case showed; NaN: none did."""
    steps = np.where(sums.shown_step >= 0, sums.shown_step, _LONG_AFTER).min(axis=(1, 2))
    return np.where(steps < _LONG_AFTER, steps * period_s, np.nan)


def detected_s(sums: Any, period_s: float) -> np.ndarray:
    """(C,) longest time [s] from a fault that showed to the isolation of its unit; NaN: none showed, or not all are."""
    shown, found = sums.shown_step >= 0, sums.found_step >= 0
    # a unit may have been isolated already, for a reason of its own
    delay = np.where(shown & found, np.maximum(sums.found_step - sums.shown_step, 0), 0).max(axis=(1, 2))
    all_found = np.any(shown, axis=(1, 2)) & ~np.any(shown & ~found, axis=(1, 2))
    return np.where(all_found, delay * period_s, np.nan)


def undetected_units(sums: Any) -> np.ndarray:
    """(C,) units whose fault showed and that were not isolated while it acted."""
    return np.count_nonzero((sums.shown_step >= 0) & (sums.found_step < 0), axis=(1, 2))


def misnamed_units(sums: Any) -> np.ndarray:
    """(C,) units that were isolated while a fault acted on them, and last taken for one of another class."""
    known = (sums.found_step >= 0) & (sums.fault_kind >= 0)
    return np.count_nonzero(known & (sums.fault_kind != sums.verdict_kind), axis=(1, 2))


def isolated_units(sums: Any, *sorts: int) -> np.ndarray:
    """(C,) different units of some sorts that were ever isolated."""
    return np.bitwise_count(sums.sums["ever"][:, sorts]).sum(axis=1, dtype=np.int64)


def false_isolations(sums: Any, *sorts: int) -> np.ndarray:
    """(C,) isolations of units of some sorts that began while no fault acted on the unit."""
    return sums.sums["false_onsets"][:, sorts].sum(axis=1)
