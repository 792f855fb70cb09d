# SPDX-License-Identifier: Apache-2.0
"""Which cells can be trusted, judged by each other: a layer in front of every Sun estimator.

The cells together give a direction of their own (`sight`), apart from any estimator: found over the whole sphere
together with the cells that lie (`cell_search`), then followed by a Kalman filter that takes no cell which contradicts
it (`cell_following`). Twice a second each cell is held against what the others make of the Sun (`cell_expectation`);
what speaks against it adds up (`cell_evidence`). Range, leaps and outputs that never change tell of a cell by
themselves (`cell_signals`). While the cells are not explained, the search goes on beside: it finds out whether a cell
is wrong or the direction.

When all that should be lit is dark the Sun sets: that speaks against no cell, unless the model of the orbit has a Sun
(`common_darkness`).
"""

import math

from css_common.kernel import kernel
from css_common.matrices import IDENTITY
from css_common.vectors import Vec3, add, norm, scale
from css_estimation.health.cell_evidence import (
    SHOWS,
    by_others,
    in_use,
    isolated_mask,
    judge_in_the_dark,
    judge_signals,
)
from css_estimation.health.cell_following import MOST_AT_ONCE, carried, looked
from css_estimation.health.cell_memory import (
    NO_DARKNESS,
    PHASE_LOOKING,
    PHASE_SETTLED,
    CellHealthMemory,
    CellHealthState,
    Darkness,
    Track,
)
from css_estimation.health.cell_options import CellHealthParameters
from css_estimation.health.cell_signals import in_range, note_outputs
from css_estimation.health.cell_votes import judge_votes
from css_estimation.health.common_darkness import (
    LATE,
    SHORTEST_DAY,
    judge_darkness,
    judge_lasting_darkness,
    lasted,
    see_light_again,
)
from css_estimation.health.sight import Sight
from css_estimation.sun.left_open import tell_one_sun
from css_estimation.sun.sun_heading import RATE_GYRO, RATE_MOMENTUM, RATE_NONE, Sky
from css_estimation.symmetric import isotropic, trace

_LOOK = 0.499  # [s]
_ZERO: Vec3 = (0.0, 0.0, 0.0)


@kernel
def sight(state: CellHealthState) -> Sight:
    """The direction that cells together give, for those who judge other sensors by it."""
    track = state.track
    return Sight(track.sun_b, 0.5 * trace(track.covariance), track.phase == PHASE_SETTLED)


def initial_state() -> CellHealthState:
    """Nothing seen yet."""
    covariance = isotropic.py_func(1.0)
    track = Track(PHASE_LOOKING, 0.0, 0.0, 0.0, 0.0, 0.0, (0.0, 0.0, 1.0), covariance, 1.0, IDENTITY)
    return CellHealthState(track, _ZERO, 0.0, 0.0, 0.0, NO_DARKNESS, 0, 0, math.inf)


@kernel
def watch_cells(
    p: CellHealthParameters,
    state: CellHealthState,
    memory: CellHealthMemory,
    dt: float,
    voltages,
    omega_bn_b: Vec3,
    rate_source: int,
    sky: Sky,
) -> CellHealthState:
    """One cycle; writes the outputs that can be trusted to `memory.trusted`, NaN for the others.

    Args:
        dt: [s] since the last cycle; 0 when it is not known.
        voltages: (N,) [-], NaN where one is missing.
        omega_bn_b, rate_source: body rate [rad/s] and where it comes from, RATE_*.
        sky: of the flight's models.
    """
    rate_known = rate_source != RATE_NONE
    rate = norm(omega_bn_b) if rate_known else 0.0
    least_change = note_outputs(p, memory, voltages, dt, rate, state.least_change)
    turn_b = add(state.turn_b, scale(dt, omega_bn_b)) if rate_known else state.turn_b
    window, step = state.window + dt, state.step + 1
    track, isolated = state.track, state.isolated
    night = lasted(state.night, dt, SHORTEST_DAY) if sky.known and sky.illumination <= 0.0 else 0.0
    # a shadow that is only touched may be as short as it likes
    day = lasted(state.day, dt, LATE) if sky.known and sky.illumination >= 1.0 else 0.0
    darkness = state.darkness
    if window > _LOOK or step == 1:
        # What successive directions to the Sun make of the rate is no news of it. Where each Sun has a twin momentum
        # goes by the Sun that is followed, and the cells do not contradict one another.
        one_sun = tell_one_sun(p.layout.cells, memory.trusted)
        rate_sure = rate_source == RATE_GYRO or (rate_source == RATE_MOMENTUM and one_sun)
        track = carried(track, turn_b, window, rate_sure)
        track, darkness = _look(p, memory, track, darkness, day, window, rate_sure, one_sun, step, sky, night > LATE)
        isolated = isolated_mask(memory)
        turn_b, window = _ZERO, 0.0
    for i in range(voltages.shape[0]):
        v = voltages[i]
        left_out = memory.verdicts[i].held == 1 or not in_range(p, v)
        memory.trusted[i] = math.nan if left_out else v
    return CellHealthState(track, turn_b, window, night, day, darkness, step, isolated, least_change)


@kernel
def trust_cells(
    judges: bool,
    p: CellHealthParameters,
    state: CellHealthState,
    memory: CellHealthMemory,
    dt: float,
    voltages,
    omega_bn_b: Vec3,
    rate_source: int,
    sky: Sky,
) -> CellHealthState:
    """As `watch_cells` if it `judges`; else all outputs are trusted."""
    if judges:
        return watch_cells(p, state, memory, dt, voltages, omega_bn_b, rate_source, sky)
    for i in range(voltages.shape[0]):
        memory.trusted[i] = voltages[i]
    return state


@kernel
def _look(
    p: CellHealthParameters,
    memory: CellHealthMemory,
    track: Track,
    darkness: Darkness,
    day: float,
    window: float,
    rate_sure: bool,
    one_sun: bool,
    step: int,
    sky: Sky,
    night: bool,
) -> tuple[Track, Darkness]:
    """Judges all cells by what they read since the last look."""
    top, bright = 0.0, 0
    for i in range(memory.cells.shape[0]):
        cell = memory.cells[i]
        mean = cell.sum / cell.readings if cell.readings > 0 else math.nan
        cell.sum, cell.readings = 0.0, 0
        used = in_use(memory, i)
        memory.means[i] = mean
        memory.used[i] = mean if used else math.nan
        memory.judged[i] = mean if used or by_others(memory, i) else math.nan
        # a NaN compares false
        if used and mean > top:
            top = mean
        if used and mean > SHOWS:
            bright += 1
    judge_votes(p, memory, track, min(window, MOST_AT_ONCE), step)
    darkness = judge_darkness(p, memory, track, darkness, day, window, rate_sure, step)
    darkness = judge_lasting_darkness(p, memory, darkness, window, top > p.minimum, sky, step)
    # one cell that is bright in the shadow fails; of several, the model of the orbit does
    if night and bright < 2:
        judge_in_the_dark(p, memory, min(window, MOST_AT_ONCE), step)
    elif top > p.minimum and (bright > 1 or not (sky.known and sky.illumination < 1.0)):
        track = looked(p, memory, track, window, rate_sure, one_sun, step)
    else:
        darkness = see_light_again(p, memory, darkness, window)
    judge_signals(p, memory, step)
    return track, darkness
