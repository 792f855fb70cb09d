# SPDX-License-Identifier: Apache-2.0
"""What a cell that fails looks most like, by what it read since then against what the others predict.

Sums over all looks since the first evidence: mean and spread of what it read, and the line through predictions and
readings. A cell that reads nothing is dead; one that reads the same whatever is predicted is stuck; one whose readings
are a share of the predictions is scaled; one with a constant difference has a bias.
"""

import math

from css_common.kernel import kernel
from css_estimation.health.cell_options import CellHealthParameters
from css_estimation.health.cell_signals import LEAPING, OUT_OF_RANGE, STUCK

# The numbers of css_msgs/Faults.
KIND_DEAD = 0
KIND_STUCK = 1
KIND_NOISY = 2
KIND_DRIFTING = 3
KIND_SCALED = 4
KIND_BIAS = 5
KIND_SIGN = 6
KIND_SATURATED = 7
KIND_SPIKES = 9
KIND_INTERMITTENT = 10
KIND_WRAP = 13
KIND_SWAPPED = 14
KIND_UNKNOWN = 255

_DARK = 0.05
_STEADY = 0.02  # spread of readings below which they are the same
_VARIES = 0.1  # spread of predictions at which a reading should have changed
_FEW, _MANY = 0.1, 0.6  # share of looks
_SLOW = 20.0  # [s] from first evidence to isolation of a fault that grows


@kernel
def forget_sums(cell) -> None:
    """Begins the sums of one of `WATCHED` anew."""
    cell.weight = cell.read = cell.read2 = cell.expected = cell.expected2 = cell.cross = 0.0
    cell.largest = -math.inf
    cell.zeros = cell.tops = 0.0


@kernel
def add_look(p: CellHealthParameters, cell, output: float, predicted: float) -> None:
    """Adds what a cell read and what was predicted to its sums."""
    cell.weight += 1.0
    cell.read += output
    cell.read2 += output * output
    cell.expected += predicted
    cell.expected2 += predicted * predicted
    cell.cross += output * predicted
    cell.largest = max(cell.largest, output)
    if abs(output) < _DARK:
        cell.zeros += 1.0
    if output > p.largest:
        cell.tops += 1.0


@kernel
def kind_of(cell, signal: int) -> int:
    """The kind, by the sums and what its outputs show by themselves."""
    n = max(cell.weight, 1.0)
    mean, predicted = cell.read / n, cell.expected / n
    spread = math.sqrt(max(0.0, cell.read2 / n - mean * mean))
    varied = math.sqrt(max(0.0, cell.expected2 / n - predicted * predicted))
    dark, top = cell.zeros / n, cell.tops / n
    if signal == STUCK or (signal == OUT_OF_RANGE and spread < _STEADY and mean > _DARK):
        return KIND_STUCK
    if signal == OUT_OF_RANGE and mean < -_DARK:
        return KIND_SIGN
    if dark > 1.0 - _FEW and mean < _DARK:
        return KIND_DEAD
    if signal == LEAPING or top > 0.0:
        if top > 0.0 and spread > _DARK:
            return KIND_WRAP
        return KIND_INTERMITTENT if dark > _FEW else KIND_NOISY
    if spread < _STEADY and varied > _VARIES:
        return KIND_STUCK
    slope = cell.cross / max(cell.expected2, 1e-9)
    off = cell.read2 - slope * cell.cross
    constant = mean - predicted
    about_constant = cell.read2 - 2.0 * cell.cross + cell.expected2 - n * constant * constant
    if cell.onset > _SLOW:
        return KIND_DRIFTING
    if off <= about_constant:
        return KIND_SCALED
    return KIND_BIAS
