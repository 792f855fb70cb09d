# SPDX-License-Identifier: Apache-2.0
"""What the health of cells carries from cycle to cycle."""

from typing import NamedTuple

import numpy as np

from css_common.vectors import Mat3, Vec3
from css_estimation.symmetric import Symmetric

DIRECTIONS = 500
"""Directions among which the Sun is looked for: 9 deg from one to the next."""

MOST_IN_PAIRS = 16
"""Cells of a layout of which any two may fail together at the start; with more of them, one."""

WATCHED = np.dtype(
    [
        ("last", np.float64),  # output of the last cycle
        ("before", np.float64),  # and of that before it
        ("sum", np.float64),  # of outputs since the last look
        ("readings", np.int64),  # in it
        ("same", np.float64),  # how unlikely it is that a healthy one has read the same for so long, -ln
        ("top", np.float64),  # largest output in range
        ("ripple", np.float64),  # mean size of its second differences
        ("jumps", np.float64),  # recent cycles in which it leapt
        ("out_of_range", np.float64),  # recent cycles
        ("score", np.float64),  # contradiction by the other cells
        ("first_step", np.int64),  # when that began; -1: there is none
        ("isolated", np.int64),  # 1: left out
        ("kind", np.int64),
        ("evidence", np.int64),
        ("statistic", np.float64),
        ("threshold", np.float64),
        ("since_step", np.int64),  # first evidence
        ("good", np.float64),  # [s] of agreement since it was left out
        ("times", np.int64),  # that it was left out
        ("weight", np.float64),  # of the sums that tell kinds apart, all over what it read while it failed
        ("read", np.float64),  # sum of its outputs
        ("read2", np.float64),  # of their squares
        ("expected", np.float64),  # of what the others predict
        ("expected2", np.float64),
        ("cross", np.float64),  # of output times prediction
        ("largest", np.float64),
        ("zeros", np.float64),  # looks at which it was dark
        ("tops", np.float64),  # at which it was at or above the top of its range
        ("onset", np.float64),  # [s] from first evidence to isolation
    ],
    align=True,
)
"""One cell."""


class CellHealthMemory(NamedTuple):
    """Of N cells; all written by `cell_health.watch_cells`."""

    cells: np.ndarray  # (N,) of WATCHED
    grid: np.ndarray  # (hypotheses, DIRECTIONS) logarithms of weights, see `cell_search`
    misfits: np.ndarray  # (N,) room
    against: np.ndarray  # (N,) evidence that a cell fails, as the search has it
    healthy: np.ndarray  # (N,) room
    means: np.ndarray  # (N,) outputs since the last look
    used: np.ndarray  # (N,) those of them that the direction rests on, NaN for others
    judged: np.ndarray  # (N,) those that rival directions are held against: also of cells left out for the direction's sake
    trusted: np.ndarray  # (N,) outputs of this cycle, NaN for those that are left out


class Track(NamedTuple):
    """The Sun as the cells together see it."""

    phase: int  # PHASE_*
    since: float  # [s] of light in this phase
    faded: float  # [s] for how long all that should be lit have been darker than they should
    calm: float  # [s] for how long all cells have been explained while several saw the Sun, at most a bound
    doubt: float  # [s] for which the search goes on beside it
    searched: float  # [s] since its last look
    sun_b: Vec3
    covariance: Symmetric  # [rad^2]
    light: float  # [-] output over cosine, in common
    frame: Mat3  # from the frame in which directions of the search are fixed to b


class CellHealthState(NamedTuple):
    """Beside the memory."""

    track: Track
    turn_b: Vec3  # [rad] since the last look
    window: float  # [s] since the last look
    step: int  # number of this cycle
    isolated: int  # mask
    least_change: float  # [-] smallest change of any output from cycle to cycle: a step of the converter, or less


PHASE_LOOKING, PHASE_FOLLOWING, PHASE_SETTLED = 0, 1, 2


def new_memory(cells: int) -> CellHealthMemory:
    """Nothing read yet."""
    watched = np.zeros(cells, WATCHED)
    watched["first_step"] = -1
    hypotheses = 1 + cells + (cells * (cells - 1) // 2 if cells <= MOST_IN_PAIRS else 0)
    return CellHealthMemory(watched, np.zeros((hypotheses, DIRECTIONS)), *(np.zeros(cells) for _ in range(7)))
