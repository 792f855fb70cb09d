# SPDX-License-Identifier: Apache-2.0
"""Which units fail at one step of a case, and whether a cell that fails shows it."""

import math
from typing import NamedTuple

from css_common.kernel import kernel
from css_common.schema import Values
from css_estimation.sun.sun_heading import LEFT_FIELD, LEFT_GYRO
from css_sim import cell_errors, sun_cells
from css_sim.fault_effects import CELL, GYRO, MAGNETOMETER, ROD, SWAPPED, TACHOMETER, WHEEL, acts

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


class Uncertainty(NamedTuple):
    """How well a healthy reading of a cell could be known by one who knows attitude and Sun, 1 sigma."""

    constant: float  # [-] noise and offset
    share: float  # of the reading: losses and errors of scale
    tilt: float  # [rad] of the normal, and so at most as much of the reading
    lsb: float  # [-] step of the converter


def uncertainty_of(values: Values) -> Uncertainty:
    """Of the cells of a `css_array` node."""
    p, errors = sun_cells.parameters(values), cell_errors.error_model(values)
    losses = (loss / math.sqrt(12.0) for loss in (p.degradation, errors.fixed_degradation))
    share = math.hypot(*losses, errors.scale_common_error, errors.scale_cell_error)
    lsb = (p.output_high - p.output_low) / p.levels if p.levels > 0.0 else 0.0
    return Uncertainty(math.hypot(p.noise, errors.bias), share, errors.misalignment, lsb)


@kernel
def evident_cells(u: Uncertainty, failed: int, healthy, voltages, albedo) -> int:
    """Mask of those failed cells that read otherwise than without a fault, by more than a healthy reading is uncertain.

    Args:
        u: of all cells; the light of the Earth comes on top.
        failed: mask of the cells that faults act on.
        healthy: (N,) what the cells would read without faults [-].
        voltages: (N,) what they read [-].
        albedo: (N,) light reflected by the Earth that they receive [-].
    """
    evident = 0
    own = math.hypot(u.constant, u.tilt)
    for i in range(voltages.shape[0]):
        if failed >> i & 1:
            of_light = math.hypot(u.share * healthy[i], EARTH_UNKNOWN * albedo[i])
            if abs(voltages[i] - healthy[i]) > EVIDENT * math.hypot(own, of_light) + u.lsb:
                evident |= 1 << i
    return evident
