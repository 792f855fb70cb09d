# SPDX-License-Identifier: Apache-2.0
"""What a fault did to the cases of one line, against the same cases without it and without the cell that failed."""

import math
from collections.abc import Callable, Collection, Mapping
from typing import NamedTuple

import numpy as np

from css_common.case_faults import NEVER
from css_common.mission import Mission
from css_common.random_streams import random_key
from css_papers.faults.kinds import PAIR, Fault
from css_sim import cell_faults

PROMPTLY_S = 10.0
"""Time [s] within which dead, stuck and wrapped cells have to be found."""

FALSE = ("false_isolations", "false_actuator_isolations", "falsely_left_sensors")
"""Columns that count isolations of units that did not fail."""

Column = Callable[[str], np.ndarray]
"""Values of a column of a study, (C,), NaN for null."""


class Outcome(NamedTuple):
    """One line of the page; None: there is no such number."""

    cases: int
    power: float | None  # share of the cases that end in power
    power_seen: float | None  # the same of the cases whose failed cells are not needed to see the Sun there
    later_median: float | None  # [s] more sunlight beyond 30 deg of the array normal than without the fault
    later_max: float | None  # infinite: some case never came within
    ratio: float | None  # mean heading error over that of the mission without the cell
    shown: int  # cases in which a fault showed
    detected: float | None  # share of them in which all that showed were isolated while they acted
    promptly: float | None  # the same within `PROMPTLY_S`
    detected_median: float | None  # [s] over the cases in which all were
    detected_p95: float | None
    named: float | None  # share of those in which what was isolated was taken for what it is
    false: int  # isolations of units that did not fail, in all cases
    nis: float | None


def failed_cells(mission: Mission, cases: int) -> list[frozenset[int]]:
    """The cells that fail in each case of a mission; of two that are swapped the one that was drawn."""
    values = mission.node("css_array").values
    keys = (random_key(mission.values.mission.seed, case) for case in range(cases))
    drawn = (cell_faults.case_faults(values, key) for key in keys)
    return [frozenset(fault.unit for fault in faults if fault.first_step < NEVER) for faults in drawn]


def counted_cases(fault: Fault, failed: list[frozenset[int]]) -> np.ndarray:
    """(C,) whether a case is one of the line: of a pair, whether it drew two cells."""
    if fault.sort != PAIR:
        return np.ones(len(failed), bool)
    return np.array([len(cells) == 2 for cells in failed])


def outcome(
    of: Column,
    without: Column,
    counted: np.ndarray,
    lacking: Mapping[frozenset[int], np.ndarray],
    failed: list[frozenset[int]],
    seen: Collection[frozenset[int]] = (),
) -> Outcome:
    """What became of the cases of a line.

    Args:
        of, without: columns of the study with the fault and without it.
        counted: (C,) the cases that count.
        lacking: heading errors (C,) of missions without some cells, by these.
        failed: the cells that fail in each case.
        seen: sets of cells without which the Sun is seen in power as with them.
    """
    converging, reference = of("converging_s")[counted], without("converging_s")[counted]
    # a case that never had the Sun within 30 deg has no time; where it has none without the fault either, none is lost
    later = np.where(np.isnan(converging), np.where(np.isnan(reference), 0.0, math.inf), converging - reference)
    later = np.where(np.isnan(reference) & ~np.isnan(converging), 0.0, later)
    shown = np.isfinite(of("fault_shown_s"))[counted]
    time = of("detected_s")[counted]
    found = np.isfinite(time)
    false = sum(of(name)[counted].sum() for name in FALSE)
    return Outcome(
        cases=int(counted.sum()),
        power=_mean(np.isfinite(of("power_positive_from_s")[counted]).astype(float)),
        power_seen=_share(np.isfinite(of("power_positive_from_s")), counted & [cells in seen for cells in failed]),
        later_median=float(np.median(later)) if len(later) else None,
        later_max=float(np.max(later)) if len(later) else None,
        ratio=_ratio(of("heading_error_mean_deg"), counted, lacking, failed),
        shown=int(shown.sum()),
        detected=_share(found, shown),
        promptly=_share(time <= PROMPTLY_S, shown),
        detected_median=float(np.median(time[found])) if found.any() else None,
        detected_p95=float(np.percentile(time[found], 95.0)) if found.any() else None,
        named=_share(of("misnamed_units")[counted] == 0, found) if any(failed) else None,
        false=int(false),
        nis=_mean(of("nis_mean")[counted]),
    )


def _ratio(
    errors: np.ndarray, counted: np.ndarray, lacking: Mapping[frozenset[int], np.ndarray], failed: list[frozenset[int]]
) -> float | None:
    """Mean error of the cases with an error over the mean of the same cases of the missions without their cells."""
    pairs = [
        (errors[case], lacking[cells][case])
        for case, cells in enumerate(failed)
        if counted[case] and cells in lacking and np.isfinite(errors[case]) and np.isfinite(lacking[cells][case])
    ]
    if not pairs:
        return None
    with_fault, without_cell = np.mean(pairs, axis=0)
    return float(with_fault / without_cell)


def _share(good: np.ndarray, of: np.ndarray) -> float | None:
    return float(np.mean(good[of])) if of.any() else None


def _mean(values: np.ndarray) -> float | None:
    known = values[np.isfinite(values)]
    return float(np.mean(known)) if len(known) else None
