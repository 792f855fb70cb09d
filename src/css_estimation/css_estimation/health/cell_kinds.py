# SPDX-License-Identifier: Apache-2.0
"""What a cell that fails looks most like, by what it has read since the first evidence and what the others predict.

A cell that reads the same is dead or stuck; one that is dark at times and right at others is intermittent; one that
leaps is noisy, or has spikes if it is right most of the time, or a converter that wraps if it leaps to its top. What is
left is a matter of least squares: a share of the predictions, a constant difference, or one that grows.
"""

import math

from css_common.health import (
    KIND_BIAS,
    KIND_DEAD,
    KIND_DRIFTING,
    KIND_INTERMITTENT,
    KIND_NOISY,
    KIND_SATURATED,
    KIND_SCALED,
    KIND_SIGN,
    KIND_SPIKES,
    KIND_STUCK,
    KIND_UNKNOWN,
    KIND_WRAP,
)
from css_common.kernel import kernel
from css_estimation.health.cell_memory import LEAPING, OUT_OF_RANGE, STUCK, CellHealthMemory
from css_estimation.health.cell_options import CellHealthParameters
from css_estimation.sun.cell_layout import READABLE

_DARK = 0.05
_SAME = 1e-9
_FEW_CYCLES = 20.0
_LIT = 0.3  # prediction of a cell that should be lit
_RIGHT = 0.15  # off a prediction by less is agreement
_SWAPPED = 0.12  # mean difference from what is predicted of the other
_MORE_THAN_EARTH = 0.4
_GROWN = 0.1  # [-] from first evidence on


@kernel
def forget_sums(cell) -> None:
    """Begins the sums of one of `WATCHED` anew."""
    cell.cycles = cell.seconds = cell.read = cell.read2 = cell.zeros = cell.tops = 0.0
    cell.compared = cell.agreed = cell.dark_seen = cell.lit_seen = cell.leaps = 0.0
    cell.expected = cell.expected2 = cell.cross = cell.off = cell.off2 = 0.0
    cell.off_time = cell.time = cell.time2 = cell.told = 0.0
    cell.night = cell.night_read = cell.night_read2 = cell.sun_read2 = cell.sun_off = cell.sun_off2 = 0.0
    cell.least, cell.most = math.inf, -math.inf


@kernel
def add_output(cell, v: float, dt: float) -> None:
    """Adds an output to the sums of one of `WATCHED`."""
    cell.cycles += 1.0
    cell.seconds += dt
    cell.read += v
    cell.read2 += v * v
    cell.least = min(cell.least, v)
    if v > cell.most + _SAME:
        cell.most, cell.tops = v, 0.0
    if v >= cell.most - _SAME:
        cell.tops += 1.0
    dark = abs(v) < _DARK
    if dark:
        cell.zeros += 1.0
    predicted = cell.predicted
    # at the limit of what is looked at an output tells no more by how much it is off
    if math.isnan(predicted) or not abs(v) < READABLE:
        return
    off = v - predicted
    cell.off_time += off * cell.seconds
    cell.time += cell.seconds
    cell.time2 += cell.seconds * cell.seconds
    cell.told += 1.0
    cell.off += off
    cell.off2 += off * off
    if not predicted > _DARK:
        cell.night += 1.0
        cell.night_read += v
        cell.night_read2 += v * v
        return
    cell.compared += 1.0
    cell.sun_read2 += v * v
    if predicted > _LIT:
        if dark:
            cell.dark_seen += 1.0
        else:
            cell.lit_seen += 1.0
            # light of the Earth is no contradiction
            if -_RIGHT < off < 2.0 * _RIGHT:
                cell.agreed += 1.0
    cell.expected += predicted
    cell.expected2 += predicted * predicted
    cell.cross += v * predicted
    cell.sun_off += off
    cell.sun_off2 += off * off


@kernel
def is_swapped(memory: CellHealthMemory, i: int) -> bool:
    """Whether cell `i` reads what is predicted of another that is left out, and that one what is predicted of it."""
    looks = memory.swap_looks
    if not looks[i] > 3.0:
        return False
    for j in range(memory.cells.shape[0]):
        if j == i or not looks[j] > 3.0 or memory.verdicts[j].held == 0:
            continue
        if memory.swaps[i, j] < _SWAPPED * looks[i] and memory.swaps[j, i] < _SWAPPED * looks[j]:
            own = min(memory.swaps[i, i] / looks[i], memory.swaps[j, j] / looks[j])
            if own > 2.0 * _SWAPPED:
                return True
    return False


@kernel
def kind_of(p: CellHealthParameters, cell, signal: int) -> int:
    """The kind of one of `WATCHED` that fails, by its sums and what its outputs show by themselves."""
    n = cell.cycles
    mean = cell.read / max(n, 1.0)
    if n > 2.0 and cell.most - cell.least < _SAME:
        return KIND_STUCK if abs(mean) > _DARK else KIND_DEAD
    if n < _FEW_CYCLES:
        if signal == STUCK:
            return KIND_STUCK
        if signal == LEAPING:
            return KIND_NOISY
        if signal == OUT_OF_RANGE:
            return KIND_SIGN if cell.last < 0.0 else KIND_UNKNOWN
    if mean < -_DARK:
        return KIND_SIGN
    if cell.zeros > 0.95 * n:
        return KIND_DEAD
    seen = cell.dark_seen + cell.lit_seen
    if min(cell.dark_seen, cell.lit_seen) > 0.05 * seen and cell.agreed > 0.8 * cell.lit_seen:
        return KIND_INTERMITTENT
    if signal == LEAPING or cell.leaps > 0.05 * n:
        if cell.tops >= 3.0 and cell.most > p.largest:
            return KIND_WRAP
        # each spike makes three leaps of second differences
        return KIND_SPIKES if cell.leaps < 0.45 * n else KIND_NOISY
    predicted = cell.expected / max(cell.compared, 1.0)
    if cell.tops > 0.2 * n and predicted > cell.most + _DARK:
        return KIND_SATURATED
    return _by_least_squares(cell)


@kernel
def _by_least_squares(cell) -> int:
    """A share of what is predicted, a constant difference from it, or one that grows."""
    n = cell.told
    if n < 2.0:
        return KIND_UNKNOWN
    # squares that are left by v = e + b, and by v = e + b + c t
    constant = max(cell.off2 - cell.off * cell.off / n, 0.0)
    spread = cell.time2 - cell.time * cell.time / n
    tilt = cell.off_time - cell.off * cell.time / n
    slope = tilt / max(spread, 1e-9)
    growing = max(constant - slope * tilt, 0.0)
    # in the Sun: squares that are left by v = k e
    scaled = cell.sun_read2 - cell.cross * cell.cross / max(cell.expected2, 1e-9)
    grown = abs(slope) * cell.seconds > max(_GROWN, 0.5 * abs(cell.off) / n)
    # no share of anything explains what is read without the Sun
    unexplained = scaled + cell.night_read2
    if grown and growing < min(0.2 * constant, unexplained):
        return KIND_DRIFTING
    # what is read without the Sun is no share of anything; the Earth gives less
    if cell.night > _FEW_CYCLES and abs(cell.night_read) > _MORE_THAN_EARTH * cell.night:
        return KIND_BIAS
    m = cell.compared
    if m < 2.0:
        return KIND_BIAS
    # with predictions that stay the same both are as good, and light is more easily lost than won
    biased = max(cell.sun_off2 - cell.sun_off * cell.sun_off / m, 0.0)
    return KIND_BIAS if biased < 0.3 * scaled else KIND_SCALED
