# SPDX-License-Identifier: Apache-2.0
"""What the health of cells carries from cycle to cycle."""

from typing import NamedTuple

import numpy as np

from css_common.vectors import Mat3, Vec3
from css_estimation.symmetric import Symmetric

DIRECTIONS = 500
"""Directions among which the Sun is looked for: 9 deg from one to the next."""

WATCHED = np.dtype(
    [
        ("last", np.float64),  # output of the last cycle
        ("before", np.float64),  # and of that before it
        ("sum", np.float64),  # of outputs since the last look
        ("readings", np.int64),  # in it
        ("same", np.float64),  # how unlikely it is that a healthy one has read the same for so long, -ln
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
    grid: np.ndarray  # (DIRECTIONS,) logarithms of the weights of directions to the Sun
    means: np.ndarray  # (N,) outputs since the last look
    used: np.ndarray  # (N,) those of them that the direction rests on, NaN for others
    trusted: np.ndarray  # (N,) outputs of this cycle, NaN for those that are left out


class CellHealthState(NamedTuple):
    """Beside the memory: the Sun as the cells together see it."""

    phase: int  # PHASE_*
    since: float  # [s] of light in this phase
    lost: float  # how long most cells have contradicted the direction [s]
    sun_b: Vec3
    covariance: Symmetric  # [rad^2]
    light: float  # [-] output over cosine, in common
    frame: Mat3  # from the frame in which directions of the grid are fixed to b
    turn_b: Vec3  # [rad] since the last look
    window: float  # [s] since the last look
    dark: float  # [s] without any light
    step: int  # number of this cycle
    isolated: int  # mask
    least_change: float  # [-] smallest change of any output from cycle to cycle: a step of the converter, or less


PHASE_LOOKING, PHASE_FOLLOWING, PHASE_SETTLED = 0, 1, 2


def new_memory(cells: int) -> CellHealthMemory:
    """Nothing read yet."""
    watched = np.zeros(cells, WATCHED)
    watched["first_step"] = -1
    return CellHealthMemory(watched, np.zeros(DIRECTIONS), *(np.zeros(cells) for _ in range(3)))
