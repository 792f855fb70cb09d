# SPDX-License-Identifier: Apache-2.0
"""What the outputs of one cell alone tell of its health, cycle by cycle: range, leaps, an output that does not change.

Range: no place in the Sun gives a cell more than a bound. Leaps: the second difference of three outputs in a row is
noise and what a turning body adds; where the edge of its view passes the Sun a healthy cell leaps too, once. The same
output again and again: as unlikely as others that are lit change.
"""

import math

from css_common.kernel import kernel
from css_estimation.health.cell_kinds import add_output
from css_estimation.health.cell_memory import LEAPING, NO_SIGNAL, OUT_OF_RANGE, STUCK, CellHealthMemory
from css_estimation.health.cell_options import CellHealthParameters
from css_estimation.sun.cell_layout import READABLE

# Of 5 sigma of a second difference, 6 sigma^2.
_LEAP = 5.0 * math.sqrt(6.0)
# Share of an output by which it leaps: common changes of all cells from cycle to cycle are smaller.
_LEAP_SHARE = 0.15
_FASTEST = 0.1  # [rad/s] of a body of which no faster turn is known
_KEPT = 0.9  # of counts of recent cycles
_MOST_LEAPS, _MOST_OUT_OF_RANGE = 3.5, 2.5
_UNLIKELY = 14.0  # -ln of a chance of 1e-6
_LIT = 0.1  # output above which a cell tells how others change
_EDGES = 0.6  # [1/s] leaps of a healthy cell of a body that wobbles, as edges of its view pass the Sun
_FULL = 0.9  # above it the largest output that any cell has had may be the converter's
_DARK = 0.05  # below which nothing need change
_STEPS = 3.0  # of a converter that the ripple of others has to exceed before an output has to change


@kernel
def reading(v: float) -> float:
    """An output as it is looked at: no more than a cell can read, also of one at the limit of its converter; or NaN."""
    return min(max(v, -READABLE), READABLE) if abs(v) < math.inf else math.nan


@kernel
def in_range(p: CellHealthParameters, v: float) -> bool:
    """Whether a healthy cell can read this."""
    return p.smallest <= v <= p.largest


@kernel
def signal_of(cell) -> int:
    """What one of `WATCHED` shows by itself."""
    if cell.out_of_range > _MOST_OUT_OF_RANGE:
        return OUT_OF_RANGE
    if cell.jumps > _MOST_LEAPS:
        return LEAPING
    if cell.same > _UNLIKELY:
        return STUCK
    return NO_SIGNAL


@kernel
def statistic_of(cell, signal: int) -> tuple[float, float]:
    """Of a signal, and its threshold."""
    if signal == OUT_OF_RANGE:
        return cell.out_of_range, _MOST_OUT_OF_RANGE
    if signal == LEAPING:
        return cell.jumps, _MOST_LEAPS
    return cell.same, _UNLIKELY


@kernel
def note_outputs(
    p: CellHealthParameters, memory: CellHealthMemory, voltages, dt: float, rate: float, least_change: float
) -> float:
    """Takes note of the outputs (N,) of a cycle; gives the smallest change of any so far.

    Args:
        dt: [s] since the last cycle.
        rate: [rad/s] at which the body turns, as far as it is known.
    """
    turn = max(rate, _FASTEST) * dt
    top = 0.0
    for i in range(voltages.shape[0]):
        cell, v = memory.cells[i], reading(voltages[i])
        # a NaN compares false
        if v > cell.top and in_range(p, v):
            cell.top = v
        top = max(top, cell.top)
        change = abs(v - cell.last)
        if change > 0.0:
            least_change = min(least_change, change)
    for i in range(voltages.shape[0]):
        cell, v = memory.cells[i], reading(voltages[i])
        cell.out_of_range *= _KEPT
        cell.jumps *= _KEPT
        if not math.isnan(v):
            if not in_range(p, v):
                cell.out_of_range += 1.0
            second = abs(v - 2.0 * cell.last + cell.before)
            if not math.isnan(second):
                largest = max(v, cell.last, cell.before)
                if second > max(_LEAP * p.noise, _LEAP_SHARE * largest) + 3.0 * turn * turn:
                    cell.jumps += 1.0 / (1.0 + _EDGES * dt)
                    cell.leaps += 1.0
                cell.ripple = 0.95 * cell.ripple + 0.05 * min(second, _LEAP_SHARE * largest)
            if v != cell.last:
                cell.same = 0.0
            elif v > _DARK and not (v == top and v > _FULL):
                cell.same += _surprise(memory, voltages, i, _STEPS * least_change + turn * turn)
            cell.sum += v
            cell.readings += 1
            if memory.verdicts[i].held == 1 or cell.first_step >= 0:
                add_output(cell, v, dt)
    for i in range(voltages.shape[0]):
        cell = memory.cells[i]
        cell.before, cell.last = cell.last, reading(voltages[i])
    return least_change


@kernel
def _surprise(memory: CellHealthMemory, voltages, i: int, quiet: float) -> float:
    """-ln of the chance that a healthy cell reads the same again, while so many others that are lit change.

    Args:
        quiet: second differences that a turning body and the steps of a converter make.
    """
    lit = changed = 0
    for j in range(voltages.shape[0]):
        other = memory.cells[j]
        if j == i or not _LIT < voltages[j] <= READABLE:
            continue
        lit += 1
        ripple = other.ripple * min(1.0, voltages[i] / voltages[j])
        if voltages[j] != other.last and ripple > quiet:
            changed += 1
    return -math.log(1.0 - 0.5 * changed / lit) if lit > 0 else 0.0
