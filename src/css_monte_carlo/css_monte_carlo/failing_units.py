# SPDX-License-Identifier: Apache-2.0
"""Which units fail at one step of a case, and whether a cell that fails shows it."""

import math
from typing import NamedTuple

from css_common.kernel import kernel
from css_estimation.sun.sun_heading import LEFT_FIELD, LEFT_GYRO
from css_sim.fault_effects import CELL, GYRO, MAGNETOMETER, ROD, SWAPPED, TACHOMETER, WHEEL, acts
from css_sim.sun_cells import SunCells

EVIDENT = 5.0
"""Standard deviations of a healthy reading by which that of a failed cell is off once it shows."""

EARTH_UNKNOWN = 0.4
"""Part of the light of the Earth on a cell that no flight can predict under clouds that it does not know, 1 sigma."""


class Failing(NamedTuple):
    """Units on which faults act, bit i of each mask for unit i; a tachometer is a part of its wheel."""

    cells: int
    cells_evident: int  # those of them whose reading shows it
    wheels: int
    rods: int
    sensors: int  # LEFT_*, added


NOTHING_FAILS = Failing(0, 0, 0, 0, 0)


@kernel
def failing_units(faults, step: int) -> Failing:
    """The units that faults (F,) of `fault_effects.FAULT` act on, of the cells none evident yet."""
    cells, wheels, rods, sensors = 0, 0, 0, 0
    for k in range(faults.shape[0]):
        fault = faults[k]
        if not acts(fault, step):
            continue
        if fault.sort == CELL:
            cells |= 1 << fault.unit
            if fault.kind == SWAPPED:
                cells |= 1 << int(fault.value)
        elif fault.sort == WHEEL or fault.sort == TACHOMETER:
            wheels |= 1 << fault.unit
        elif fault.sort == ROD:
            rods |= 1 << fault.unit
        elif fault.sort == GYRO:
            sensors |= LEFT_GYRO
        elif fault.sort == MAGNETOMETER:
            sensors |= LEFT_FIELD
    return Failing(cells, 0, wheels, rods, sensors)


@kernel
def evident_cells(p: SunCells, failed: int, healthy, voltages, albedo) -> int:
    """Mask of those failed cells that read otherwise than without a fault, by more than a healthy reading is uncertain.

    A reading is uncertain by its noise, the loss that is drawn anew every step, and the light of the Earth.

    Args:
        failed: mask of the cells that faults act on.
        healthy: (N,) what the cells would read without faults [-].
        voltages: (N,) what they read [-].
        albedo: (N,) light reflected by the Earth that they receive [-].
    """
    evident = 0
    lsb = (p.output_high - p.output_low) / p.levels if p.levels > 0.0 else 0.0
    loss = p.degradation / math.sqrt(12.0)
    for i in range(voltages.shape[0]):
        if failed >> i & 1:
            of_light = math.hypot(loss * healthy[i], EARTH_UNKNOWN * albedo[i])
            if abs(voltages[i] - healthy[i]) > EVIDENT * math.hypot(p.noise, of_light) + lsb:
                evident |= 1 << i
    return evident
