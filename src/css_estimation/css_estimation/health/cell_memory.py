# SPDX-License-Identifier: Apache-2.0
"""What the health of cells carries from cycle to cycle."""

from typing import NamedTuple

import numpy as np

from css_common.health import SORT_CELL, new_verdicts
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
        ("sure", np.int64),  # 1: left out while the direction had been sure for long
        ("vote", np.float64),  # contradiction by those that look the same way
        ("vote_step", np.int64),  # when that began
        ("line", np.float64),  # that it is dead, by lines that stand alone
        ("line_step", np.int64),  # when that began
        ("opposite", np.float64),  # by those that look another way
        ("opposite_step", np.int64),
        ("good", np.float64),  # [s] of agreement since it was left out
        ("times", np.int64),  # that it was left out
        # what tells kinds apart: all over the cycles since the first evidence
        ("predicted", np.float64),  # by the others at the last look; NaN: they do not know
        ("cycles", np.float64),
        ("seconds", np.float64),
        ("read", np.float64),  # sum of outputs
        ("read2", np.float64),  # of their squares
        ("zeros", np.float64),  # cycles in which it was dark
        ("least", np.float64),
        ("most", np.float64),
        ("tops", np.float64),  # cycles in which it read the most
        ("night", np.float64),  # cycles in which no Sun was predicted on it
        ("night_read", np.float64),  # sum of outputs in them
        ("night_read2", np.float64),  # of their squares
        ("compared", np.float64),  # cycles in which some was, and sums over them
        ("dark_seen", np.float64),  # cycles in which it was dark and should have been lit
        ("lit_seen", np.float64),  # in which it was lit and should have been
        ("agreed", np.float64),  # those of them in which it read what was predicted
        ("leaps", np.float64),  # cycles in which it leapt
        ("sun_read2", np.float64),  # of squares of outputs
        ("expected", np.float64),  # of predictions
        ("expected2", np.float64),
        ("cross", np.float64),  # of output times prediction
        ("sun_off", np.float64),  # of output less prediction
        ("sun_off2", np.float64),
        ("told", np.float64),  # cycles with any prediction, and sums over them
        ("off", np.float64),  # of output less prediction
        ("off2", np.float64),
        ("off_time", np.float64),  # of that times time
        ("time", np.float64),
        ("time2", np.float64),
    ],
    align=True,
)
"""One cell."""


class CellHealthMemory(NamedTuple):
    """Of N cells; all written by `cell_health.watch_cells`."""

    cells: np.ndarray  # (N,) of WATCHED
    verdicts: np.ndarray  # (N,) of css_common.health.VERDICT
    changes: np.ndarray  # (1,) of verdicts so far
    grid: np.ndarray  # (hypotheses, DIRECTIONS) logarithms of weights, see `cell_search`
    misfits: np.ndarray  # (N,) room
    against: np.ndarray  # (N,) evidence that a cell fails, as the search has it
    healthy: np.ndarray  # (N,) room
    means: np.ndarray  # (N,) outputs since the last look
    used: np.ndarray  # (N,) those of them that the direction rests on, NaN for others
    judged: (
        np.ndarray
    )  # (N,) those that rival directions are held against: also of cells left out for the direction's sake
    swaps: np.ndarray  # (N, N) sum of |output of i less what is predicted of j| while i is left out
    swap_looks: np.ndarray  # (N,) looks in it
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


class Darkness(NamedTuple):
    """Of all cells together; see `common_darkness`."""

    waning: float  # [s] since a cell that must see the Sun had most of its light
    time: float  # [s] for which all that must see the Sun have been dark
    mask: int  # those cells
    at_once: bool  # they went dark at once
    unlit: float  # [s] for which all looks have been dark, without a model; 0: the last was not
    unlit_step: int  # when a cell was last lit, or nobody looked for so long that one may have been
    unread: float  # [s] since a look at which a cell gave an output
    told: int  # mask of the cells that gave one at each dark look
    lasting: bool  # it has outlasted all eclipses


NO_DARKNESS = Darkness(0.0, 0.0, 0, False, 0.0, 0, 0.0, -1, False)


class CellHealthState(NamedTuple):
    """Beside the memory."""

    track: Track
    turn_b: Vec3  # [rad] since the last look
    window: float  # [s] since the last look
    night: float  # [s] for which the model of the orbit has had no Sun, as far as looks follow one another
    day: float  # [s] for which it has had all of it, likewise
    darkness: Darkness
    step: int  # number of this cycle
    isolated: int  # mask
    least_change: float  # [-] smallest change of any output from cycle to cycle: a step of the converter, or less


NO_SIGNAL, OUT_OF_RANGE, LEAPING, STUCK = 0, 1, 2, 3
"""What a cell shows by itself."""

PHASE_LOOKING, PHASE_FOLLOWING, PHASE_SETTLED = 0, 1, 2


def new_memory(cells: int) -> CellHealthMemory:
    """Nothing read yet."""
    watched = np.zeros(cells, WATCHED)
    watched["first_step"] = -1
    hypotheses = 1 + cells + (cells * (cells - 1) // 2 if cells <= MOST_IN_PAIRS else 0)
    misfits, against, healthy, means, used, judged, swap_looks, trusted = (np.zeros(cells) for _ in range(8))
    return CellHealthMemory(
        watched,
        new_verdicts(SORT_CELL, cells),
        np.zeros(1, np.int64),
        np.zeros((hypotheses, DIRECTIONS)),
        misfits,
        against,
        healthy,
        means,
        used,
        judged,
        np.zeros((cells, cells)),
        swap_looks,
        trusted,
    )
