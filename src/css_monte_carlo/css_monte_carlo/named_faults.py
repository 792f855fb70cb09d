# SPDX-License-Identifier: Apache-2.0
"""Whether a cell that is left out is taken for what it is: kinds of faults that no reading tells apart are one class.

- Nothing: dead, and whatever then reads zero: stuck or frozen there, at the low end of a converter that has no negative
  readings, or with the wrong sign before one.
- The same: stuck, frozen, or at the high end.
- A part: scaled, shadowed, or saturated below what it should read.
- Off from time to time: noisy or spikes.

All other kinds are classes of their own.
"""

from numba.extending import overload

from css_analysis.fault_sums import CELLS
from css_common.kernel import kernel
from css_estimation.health.watched import WatchedMemory
from css_sim.fault_effects import (
    CELL,
    DEAD,
    FROZEN,
    NOISY,
    SATURATED,
    SCALED,
    SHADOWED,
    SIGN,
    SPIKES,
    STUCK,
    STUCK_HIGH,
    STUCK_LOW,
    SWAPPED,
    acts,
)

_NOTHING = 0.05  # [-] a reading that says no more than zero, where the Earth alone gives as much


@kernel
def class_of_kind(kind: int, reading: float) -> int:
    """The class of a kind of fault of a cell that reads so much [-], as the kind that stands for it."""
    if abs(reading) < _NOTHING and kind in (STUCK, FROZEN, STUCK_LOW, SIGN):
        return DEAD
    if kind in (FROZEN, STUCK_HIGH, STUCK_LOW):
        return STUCK
    if kind in (SHADOWED, SATURATED):
        return SCALED
    if kind == SPIKES:
        return NOISY
    return kind


@kernel
def note_cell_kinds(health, c: int, mask: int, cells, faults, step: int, voltages) -> None:
    """Writes what the cells of a mask are taken for in case `c`, and what they are.

    Args:
        health: `HealthTallies`.
        cells: (N,) rows with the `kind` of the verdict on each cell.
        faults: (F,) of `fault_effects.FAULT`.
        voltages: (N,) what the cells read [-].
    """
    for i in range(voltages.shape[0]):
        if mask >> i & 1:
            health.verdict_kind[c, CELLS, i] = class_of_kind(cells[i].kind, voltages[i])
            for k in range(faults.shape[0]):
                fault = faults[k]
                is_of = fault.unit == i or (fault.kind == SWAPPED and int(fault.value) == i)
                if fault.sort == CELL and is_of and acts(fault, step):
                    health.fault_kind[c, CELLS, i] = class_of_kind(fault.kind, voltages[i])


def note_kinds(tallies, c, heading, memory, failed, faults, step, voltages):
    """Writes what failed cells that are left out are taken for; nothing where no Sun estimator that judges cells flies.

    Args:
        heading, memory: of the Sun estimator.
        failed: mask of the cells that faults act on.
    """
    if heading is not None and isinstance(memory, WatchedMemory) and hasattr(tallies, "health"):
        note_cell_kinds(tallies.health, c, failed & heading.isolated, memory.cells.verdicts, faults, step, voltages)


@overload(note_kinds, jit_options={"forceinline": True})
def _overload_kinds(tallies, c, heading, memory, failed, faults, step, voltages):
    judged = getattr(memory, "instance_class", None) is WatchedMemory
    if not judged or not hasattr(tallies.instance_class, "health"):
        return lambda tallies, c, heading, memory, failed, faults, step, voltages: None

    def call(tallies, c, heading, memory, failed, faults, step, voltages):
        note_cell_kinds(tallies.health, c, failed & heading.isolated, memory.cells.verdicts, faults, step, voltages)

    return call
