# SPDX-License-Identifier: Apache-2.0
"""What becomes of the faults of a case, and of units that have none: isolated when, how often, and whether rightly."""

from typing import NamedTuple

import numpy as np

from css_analysis.fault_sums import CELLS, RODS, SENSORS, WHEELS
from css_common.kernel import kernel
from css_estimation.sun.sun_heading import HELD_FIELD, HELD_GYRO, LEFT_FIELD, LEFT_GYRO
from css_monte_carlo.failing_units import Failing

UNITS = 32  # bits of a mask

HEALTH = np.dtype(
    [
        (name, np.int64)
        for name in (
            "held",  # mask of those isolated at the last step
            "ever",  # mask of those isolated at some step
            "shown",  # mask of those whose fault has shown
            "found",  # mask of those isolated while a fault acted on them
            "false_onsets",  # isolations that began without a fault of the unit
        )
    ],
    align=True,
)
"""Running sums of one sort of units of one case."""


class Held(NamedTuple):
    """Units that the flight holds for failed, bit i of each mask for unit i."""

    cells: int
    wheels: int
    rods: int
    sensors: int  # LEFT_*, added: of which axes are held for failed, or which are left out


@kernel
def held_sensors(said: int) -> int:
    """Mask of LEFT_* of the sensors of which an estimate says that axes are held for failed, or that they are left out.

    Args:
        said: `SunHeading.sensors_left`.
    """
    gyro = LEFT_GYRO if said & (LEFT_GYRO | HELD_GYRO) else 0
    return gyro | (LEFT_FIELD if said & (LEFT_FIELD | HELD_FIELD) else 0)


class ActuatorsLeft(NamedTuple):
    """Those that the control holds for failed, bit i of each mask for unit i."""

    wheels: int
    rods: int


NO_ACTUATORS_LEFT = ActuatorsLeft(0, 0)


class HealthTallies(NamedTuple):
    """Running sums of C cases."""

    sums: np.ndarray  # (C, sorts) of HEALTH
    shown_step: np.ndarray  # (C, sorts, UNITS) first step at which the fault of a unit shows; -1: it never does
    found_step: np.ndarray  # (C, sorts, UNITS) first step at which a unit with a fault is isolated; -1: never
    fault_kind: np.ndarray  # (C, sorts, UNITS) class of its kind when it was last isolated and failed; -1: not known
    verdict_kind: np.ndarray  # (C, sorts, UNITS) class of what it was then taken for


def new_health(cases: int) -> HealthTallies:
    """Nothing seen yet."""
    never = np.full((cases, SENSORS + 1, UNITS), -1)
    return HealthTallies(np.zeros((cases, SENSORS + 1), HEALTH), never, never.copy(), never.copy(), never.copy())


@kernel
def tally_health(tallies: HealthTallies, c: int, step: int, failing: Failing, held: Held) -> None:
    """Counts one step of case `c`."""
    _tally(tallies, c, CELLS, step, failing.cells, failing.cells_evident, held.cells)
    _tally(tallies, c, WHEELS, step, failing.wheels, failing.wheels, held.wheels)
    _tally(tallies, c, RODS, step, failing.rods, failing.rods, held.rods)
    _tally(tallies, c, SENSORS, step, failing.sensors, failing.sensors, held.sensors)


@kernel
def _tally(tallies, c, sort, step, failed, evident, held) -> None:
    t = tallies.sums[c, sort]
    if (failed | held | t.held) == 0:
        return
    begun = held & ~t.held
    t.held = held
    t.ever |= begun
    shown, found = evident & ~t.shown, held & failed & ~t.found
    if (begun | shown | found) == 0:
        return
    t.shown |= shown
    t.found |= found
    for i in range(UNITS):
        if begun & ~failed & 1 << i:
            t.false_onsets += 1
        if shown & 1 << i:
            tallies.shown_step[c, sort, i] = step
        if found & 1 << i:
            tallies.found_step[c, sort, i] = step
