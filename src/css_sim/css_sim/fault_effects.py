# SPDX-License-Identifier: Apache-2.0
"""What faults make of a reading or a command, whatever has them: one kernel for cells, axes, wheels and rods.

All but a frozen reading is a function of seed, case, cycle and the fault itself; a frozen one holds what it read when
it began, for as long as its node runs.
"""

import numpy as np

from css_common import link_kinds
from css_common.kernel import kernel
from css_common.random_streams import RandomKey, Stream, normal4, uniform4
from css_common.vectors import Vec3

DEAD, STUCK, NOISY, DRIFTING, SCALED, BIAS, SIGN, SATURATED, FROZEN, SPIKES, INTERMITTENT = range(11)
STUCK_LOW, STUCK_HIGH, WRAP, SWAPPED, SHADOWED, SILENT, FRICTION = range(11, 18)
"""Codes of kinds; a number, once given, is never given to another kind."""

STUCK_RANDOM = 18  # an instruction to draw: what then acts is STUCK
SLOW = 19  # a wheel that is saturated in speed, not in what it is commanded

LATE, DROPPED, DOUBLED = link_kinds.LATE, link_kinds.DROPPED, link_kinds.DOUBLED  # of pulses, as of messages
SPURIOUS = 29

CELL, GYRO, MAGNETOMETER, WHEEL, ROD, TACHOMETER = range(6)
"""Codes of the sorts of units; never given to another either."""

HEAD = 9  # 6 to 8 are those of `link_kinds`

_BEYOND = 1e30  # any converter's limits

FAULT = np.dtype(
    [
        ("sort", np.int64),
        ("unit", np.int64),  # number of the cell, axis, wheel or rod
        ("kind", np.int64),
        ("index", np.int64),  # of its random draws
        ("value", np.float64),  # in SI and control cycles
        ("second", np.float64),
        ("first_step", np.int64),  # first control cycle of the fault
        ("end_step", np.int64),  # first control cycle after it
        ("held", np.float64),  # what a frozen unit shows; NaN until it is known
    ],
    align=True,
)

NO_FAULTS = np.zeros(0, FAULT)


@kernel
def stream_of(sort: int) -> int:
    """Stream of the draws of a sort's faults in flight; cells had one before there were others."""
    return Stream.CELL_FAILURE if sort == CELL else Stream.FAULT


@kernel
def acts(fault, step: int) -> bool:
    """Whether a fault acts at a control cycle."""
    return fault.first_step <= step < fault.end_step


@kernel
def faulty(fault, key: RandomKey, stream: int, step: int, x: float) -> float:
    """What a fault that acts makes of a value.

    Args:
        fault: of FAULT; one that is frozen takes note of the value.
        stream: of the random draws of this cycle.
        x: reading or command, in the units of `fault.value`.
    """
    kind, index = fault.kind, fault.index
    if kind == DEAD:
        return 0.0
    if kind == STUCK:
        return fault.value
    if kind == NOISY:
        return x + fault.value * normal4(key, stream, step, index)[0]
    if kind == DRIFTING:
        return x + fault.value * (step - fault.first_step)
    if kind == SCALED:
        return x * fault.value
    if kind == BIAS:
        return x + fault.value
    if kind == SIGN:
        return -x
    if kind == SATURATED:
        return min(max(x, -fault.value), fault.value)
    if kind == FROZEN:
        if np.isnan(fault.held):
            fault.held = x
        return fault.held
    if kind == SPIKES:
        u = uniform4(key, stream, step, index)
        if u[0] < fault.second:
            return x + fault.value if u[1] < 0.5 else x - fault.value
        return x
    if kind == INTERMITTENT:
        spell = int((step - fault.first_step) / fault.second)
        return 0.0 if uniform4(key, stream, spell, index)[0] < fault.value else x
    if kind == STUCK_LOW:
        return -_BEYOND
    if kind == STUCK_HIGH:
        return _BEYOND
    if kind == WRAP:
        return _BEYOND if x < 0.0 else x
    return x


@kernel
def any_acts(faults, sort: int, kind: int, step: int) -> bool:
    """Whether some fault (F,) of a kind acts on a unit of a sort at a control cycle."""
    for k in range(faults.shape[0]):
        if faults[k].sort == sort and faults[k].kind == kind and acts(faults[k], step):
            return True
    return False


@kernel
def is_silent(faults, sort: int, step: int) -> bool:
    """Whether faults (F,) keep a sensor of a sort from giving any reading at a control cycle."""
    return faults.shape[0] > 0 and any_acts(faults, sort, SILENT, step)


@kernel
def spoil(faults, sort: int, key: RandomKey, step: int, values) -> None:
    """Changes the values of all units of one sort, the later fault what an earlier one left.

    Args:
        faults: (F,) of FAULT; a frozen one takes note of its value.
        values: (N,) readings or commands, changed.
    """
    for k in range(faults.shape[0]):
        fault = faults[k]
        i = fault.unit
        if fault.sort != sort or i >= values.shape[0] or not acts(fault, step):
            continue
        if fault.kind == SWAPPED:
            other = int(fault.value)
            if other < values.shape[0]:
                values[i], values[other] = values[other], values[i]
        else:
            values[i] = faulty(fault, key, stream_of(sort), step, values[i])


@kernel
def spoil_axes(faults, sort: int, key: RandomKey, step: int, vector: Vec3) -> Vec3:
    """A vector of three axes after its faults (F,), as `spoil`."""
    x, y, z = vector
    for k in range(faults.shape[0]):
        fault = faults[k]
        if fault.sort != sort or not acts(fault, step):
            continue
        if fault.unit == 0:
            x = faulty(fault, key, stream_of(sort), step, x)
        elif fault.unit == 1:
            y = faulty(fault, key, stream_of(sort), step, y)
        else:
            z = faulty(fault, key, stream_of(sort), step, z)
    return (x, y, z)
