# SPDX-License-Identifier: Apache-2.0
"""Which cells can be trusted, judged by each other: a layer in front of every Sun estimator.

The cells together give a direction of their own (`sight`), apart from any estimator: found over the whole sphere so
that a few liars do not matter (`cell_search`), then followed by a Kalman filter that takes no cell which contradicts
it. Twice a second each cell is held against what the others make of the Sun (`cell_expectation`). What speaks against
it adds up to a score; beyond a threshold it is left out, unless another direction explains all cells as well: then the
direction was wrong, and is given up. Range, leaps and outputs that never change tell of a cell by themselves
(`cell_signals`). A cell that is left out is judged on, and used again when it has agreed for long enough while there
was something to agree about; twice as long after each time.

When all that should be lit is dark the Sun sets: that speaks against no cell.
"""

import math

from css_common.attitude import rotation_vector_to_dcm
from css_common.kernel import kernel
from css_common.matrices import IDENTITY
from css_common.vectors import Vec3, add, matmul, norm, scale
from css_estimation.health.cell_expectation import DOUBTFUL, HIDDEN, SEEN, contradiction, expected
from css_estimation.health.cell_kinds import add_look, forget_sums, kind_of
from css_estimation.health.cell_memory import (
    DIRECTIONS,
    PHASE_FOLLOWING,
    PHASE_LOOKING,
    PHASE_SETTLED,
    CellHealthMemory,
    CellHealthState,
)
from css_estimation.health.cell_options import CellHealthParameters
from css_estimation.health.cell_search import best_direction, cost, gather, refine
from css_estimation.health.cell_signals import (
    LEAPING,
    NO_SIGNAL,
    OUT_OF_RANGE,
    in_range,
    is_reading,
    note_outputs,
    signal_of,
    statistic_of,
)
from css_estimation.health.sight import Sight
from css_estimation.sun.direction_grid import mean_direction
from css_estimation.sun.sun_heading import Sky
from css_estimation.sun.sunline_filter import propagate
from css_estimation.symmetric import isotropic, trace

# The numbers of css_msgs/Health.
EVIDENCE_RANGE = 0
EVIDENCE_STUCK = 1
EVIDENCE_DEAD = 2
EVIDENCE_NOISE = 3
EVIDENCE_OPPOSITE = 4
EVIDENCE_VOTE = 5
EVIDENCE_RESIDUAL = 6
EVIDENCE_DRIFT = 7
EVIDENCE_DARK = 8

_LOOK = 0.499  # [s]
_LONGEST = 10.0  # [s] beyond it nothing is known of how the body turned
_FIRST_LOOKS = 1.0  # [s] of light before a direction is followed
_LONGEST_SEARCH = 20.0  # [s] after which the best there is has to do
_SPOT = 0.12  # [rad^2] of a direction that is found: 20 deg
_SETTLED_AFTER = 3.0  # [s]
_SETTLED = 0.03  # [rad^2] trace: 7 deg per axis
_USELESS = 0.5  # [rad^2] of a direction that has to be looked for anew
_LOST_AFTER = 4.0  # [s]
_FREE = 4.0  # squared sigmas that a healthy cell is off
_MOST_SCORE = 60.0
_BRIGHT = 0.45  # of the light: a cell above it sees the Sun, whatever is predicted
_NOISE, _NOISE_WITHOUT_RATE = 0.02**2, 0.1**2  # [rad^2/s]
_EARTH_ERROR = 0.1  # of an output, 1 sigma
_LARGEST_VARIANCE = 1.0  # [rad^2]
_BETTER = 10.0  # squared sigmas by which another direction has to explain all cells better
_WORTH = 60.0  # squared sigmas that a direction which was followed with a gyro is worth
_FADED = 0.75  # share of the light below which it sets
_DEAD = 0.05
_AGREES = 6.0  # squared sigmas
_SHOWS = 0.3  # [-] output or prediction from which agreement tells something
_LIGHT_MEMORY = 20.0  # [s]
_DARK_FOR_SURE = 30.0  # [s]
_MOST_TIMES = 4


@kernel
def sight(state: CellHealthState) -> Sight:
    """The direction that cells together give, for those who judge other sensors by it."""
    return Sight(state.sun_b, 0.5 * trace(state.covariance), state.phase == PHASE_SETTLED)


def initial_state() -> CellHealthState:
    """Nothing seen yet."""
    zero = (0.0, 0.0, 0.0)
    return CellHealthState(
        PHASE_LOOKING, 0.0, 0.0, (0.0, 0.0, 1.0), isotropic.py_func(1.0), 1.0, IDENTITY, zero, 0.0, 0.0, 0, 0, math.inf
    )


@kernel
def watch_cells(
    p: CellHealthParameters,
    state: CellHealthState,
    memory: CellHealthMemory,
    dt: float,
    voltages,
    omega_bn_b: Vec3,
    rate_known: bool,
    sky: Sky,
) -> CellHealthState:
    """One cycle; writes the outputs that can be trusted to `memory.trusted`.

    Args:
        dt: [s] since the last cycle; 0 when it is not known.
        voltages: (N,) [-], NaN where one is missing.
        omega_bn_b, rate_known: body rate [rad/s], by a gyro or an estimator.
        sky: of the flight's models.
    """
    least_change = note_outputs(p, memory, voltages, dt, norm(omega_bn_b) if rate_known else 0.0, state.least_change)
    turn_b = add(state.turn_b, scale(dt, omega_bn_b)) if rate_known else state.turn_b
    window = state.window + dt
    state = CellHealthState(
        state.phase,
        state.since,
        state.lost,
        state.sun_b,
        state.covariance,
        state.light,
        state.frame,
        turn_b,
        window,
        state.dark,
        state.step + 1,
        state.isolated,
        least_change,
    )
    if window > _LOOK or state.step == 1:
        state = _look(p, state, memory, rate_known, sky)
    for i in range(voltages.shape[0]):
        v = voltages[i]
        left_out = memory.cells[i].isolated == 1 or (is_reading(v) and not in_range(p, v))
        memory.trusted[i] = math.nan if left_out else v
    return state


@kernel
def _look(
    p: CellHealthParameters, state: CellHealthState, memory: CellHealthMemory, rate_known: bool, sky: Sky
) -> CellHealthState:
    """Judges all cells by what they read since the last look."""
    means = memory.means
    top = 0.0
    for i in range(means.shape[0]):
        cell = memory.cells[i]
        means[i] = cell.sum / cell.readings if cell.readings > 0 else math.nan
        cell.sum, cell.readings = 0.0, 0
        # a NaN compares false
        if means[i] > top and _in_use(memory, i):
            top = means[i]
        memory.used[i] = means[i] if _in_use(memory, i) else math.nan
    window = state.window
    noise = _NOISE if rate_known else _NOISE_WITHOUT_RATE
    sun_b, covariance = propagate(state.sun_b, state.covariance, scale(1.0 / max(window, 1e-9), state.turn_b), window, noise)
    frame = matmul(rotation_vector_to_dcm(state.turn_b), state.frame)
    phase, since, lost, light = state.phase, state.since, state.lost, state.light
    if window > _LONGEST:
        phase, since, lost = PHASE_LOOKING, 0.0, 0.0
    lit = top > p.minimum
    dark = 0.0 if lit else state.dark + window
    night = sky.known and sky.illumination <= 0.0
    if phase != PHASE_LOOKING and (0.5 * trace(covariance) > _USELESS):
        phase, since, lost = PHASE_LOOKING, 0.0, 0.0
    if lit and not night:
        since += window
        if phase == PHASE_LOOKING:
            phase, since, sun_b, covariance, frame = _find(p, memory, means, since, sun_b, covariance, frame, light, rate_known)
        else:
            phase, since, lost, sun_b, covariance, light = _follow(
                p, memory, means, phase, since, lost, sun_b, covariance, light, window, rate_known, state.step
            )
    _judge_signals(p, memory, means, state.step, phase, sun_b, covariance, light, lit)
    if night and (dark if not lit else window) > 0.0:
        _judge_in_the_dark(p, memory, means, window, state.step, sky)
    isolated = 0
    for i in range(means.shape[0]):
        if memory.cells[i].isolated == 1:
            isolated |= 1 << i
    return CellHealthState(
        phase,
        since,
        lost,
        sun_b,
        covariance,
        light,
        frame,
        (0.0, 0.0, 0.0),
        0.0,
        dark,
        state.step,
        isolated,
        state.least_change,
    )


@kernel
def _in_use(memory: CellHealthMemory, i: int) -> bool:
    """Whether the direction rests on a cell."""
    return memory.cells[i].isolated == 0 and memory.cells[i].out_of_range == 0.0


@kernel
def _find(p, memory, means, since, sun_b, covariance, frame, light, rate_known):
    """A look without a direction to follow."""
    if since <= 2.0 * _LOOK:
        for g in range(DIRECTIONS):
            memory.grid[g] = 0.0
        frame = IDENTITY
    kept = 1.0 if rate_known else 0.5
    gather(p, memory, memory.used, frame, light, kept)
    mean_n, variance = mean_direction(memory.grid)
    if since >= _FIRST_LOOKS and (variance < _SPOT or since > _LONGEST_SEARCH):
        found = frame
        sun_b = (
            found[0][0] * mean_n[0] + found[0][1] * mean_n[1] + found[0][2] * mean_n[2],
            found[1][0] * mean_n[0] + found[1][1] * mean_n[1] + found[1][2] * mean_n[2],
            found[2][0] * mean_n[0] + found[2][1] * mean_n[1] + found[2][2] * mean_n[2],
        )
        return PHASE_FOLLOWING, 0.0, sun_b, isotropic(max(variance, 0.02)), frame
    return PHASE_LOOKING, since, sun_b, covariance, frame


@kernel
def _follow(p, memory, means, phase, since, lost, sun_b, covariance, light, window, rate_known, step):
    """A look with a direction to follow."""
    # who sees the Sun, who contradicts, and what is left of the light where it should be
    support = against = lit_ones = 0
    ratio = 0.0
    for i in range(means.shape[0]):
        if math.isnan(memory.used[i]):
            continue
        e = expected(p, i, sun_b, covariance, light)
        c = contradiction(p, e, means[i])
        if abs(c) > p.gate:
            against += 1
        elif means[i] > _SHOWS * light and e.sight != HIDDEN:
            support += 1
        if e.sight == SEEN and e.high > _SHOWS * light:
            lit_ones += 1
            ratio = max(ratio, means[i] / e.high)
    fades = support == 0 and lit_ones > 0 and ratio < _FADED
    prior_b, prior_covariance = sun_b, covariance
    settled = phase == PHASE_SETTLED
    if not fades:
        sun_b, covariance = refine(p, memory.used, sun_b, covariance, light, p.gate if settled else 2.0 * p.gate)
    ratio_sum = ratio_weight = 0.0
    for i in range(means.shape[0]):
        e = expected(p, i, prior_b, prior_covariance, light)
        # a NaN compares false
        sees = e.sight == SEEN and memory.used[i] > _BRIGHT * light
        if sees and abs(contradiction(p, e, means[i])) <= p.gate:
            ratio_sum += means[i] * e.high
            ratio_weight += e.high * e.high
    if ratio_weight > 0.0:
        now = light * ratio_sum / ratio_weight
        light += min(1.0, window / _LIGHT_MEMORY) * (min(max(now, 0.5), 1.3) - light)
    wrong = against > 0 and against >= support and not fades
    lost = lost + window if wrong else max(0.0, lost - window)
    if phase == PHASE_FOLLOWING and since > _SETTLED_AFTER and trace(covariance) < _SETTLED and not wrong:
        phase, since = PHASE_SETTLED, 0.0
    if phase == PHASE_SETTLED:
        beyond = _score(p, memory, means, prior_b, prior_covariance, light, window, step, fades, support)
        if beyond > 0:
            here = cost(p, memory.used, prior_b, prior_covariance, light)
            worth = _WORTH if rate_known else 0.0
            there, best = best_direction(
                p, memory.used, light, prior_b, 0.5 * trace(prior_covariance) + p.heading, worth
            )
            if there + _BETTER < here:
                _clear_scores(memory)
                return PHASE_FOLLOWING, 0.0, 0.0, best, isotropic(0.03), light
            _isolate(p, memory, step, window)
    if lost > _LOST_AFTER:
        _clear_scores(memory)
        return PHASE_LOOKING, 0.0, 0.0, sun_b, covariance, light
    return phase, since, lost, sun_b, covariance, light


@kernel
def _score(p, memory, means, sun_b, covariance, light, window, step, fades, support) -> int:
    """Adds a look to what speaks against each cell, and for those left out; how many are beyond the threshold."""
    beyond = 0
    for i in range(means.shape[0]):
        cell = memory.cells[i]
        if math.isnan(means[i]):
            continue
        e = expected(p, i, sun_b, covariance, light)
        c = contradiction(p, e, means[i])
        # that the light is gone, or that nobody else sees it, says nothing of who is dark
        if c < 0.0 and (fades or support == 0):
            continue
        change = (abs(c) - _FREE) * window
        if cell.isolated == 1:
            add_look(p, cell, means[i], e.high)
            cell.kind = kind_of(cell, signal_of(cell))
            healthy = signal_of(cell) == NO_SIGNAL and abs(c) < _AGREES
            if not healthy:
                cell.good = 0.0
            elif e.sight == SEEN and max(means[i], e.high) > _SHOWS:
                cell.good += window
            if cell.good >= p.return_time * 2.0 ** (cell.times - 1):
                cell.isolated, cell.score, cell.first_step, cell.same = 0, 0.0, -1, 0.0
            continue
        cell.score = min(max(0.0, cell.score + change), _MOST_SCORE)
        if cell.score == 0.0:
            cell.first_step = -1
        else:
            if cell.first_step < 0:
                cell.first_step = step
                forget_sums(cell)
            add_look(p, cell, means[i], e.high)
        if cell.score > p.threshold:
            beyond += 1
    return beyond


@kernel
def _clear_scores(memory: CellHealthMemory) -> None:
    for i in range(memory.cells.shape[0]):
        memory.cells[i].score, memory.cells[i].first_step = 0.0, -1


@kernel
def _isolate(p, memory, step, window) -> None:
    """Leaves out all whose score is beyond the threshold."""
    for i in range(memory.cells.shape[0]):
        cell = memory.cells[i]
        if cell.isolated == 0 and cell.score > p.threshold:
            evidence = EVIDENCE_DEAD if cell.read / max(cell.weight, 1.0) < _DEAD else EVIDENCE_RESIDUAL
            _leave_out(cell, evidence, cell.score, p.threshold, cell.first_step, step)
            cell.onset = cell.weight * window
            cell.kind = kind_of(cell, signal_of(cell))


@kernel
def _leave_out(cell, evidence, statistic, threshold, since_step, step) -> None:
    cell.isolated, cell.good = 1, 0.0
    cell.times = min(cell.times + 1, _MOST_TIMES)
    cell.evidence, cell.statistic, cell.threshold, cell.since_step = evidence, statistic, threshold, since_step


@kernel
def _judge_signals(p, memory, means, step, phase, sun_b, covariance, light, lit) -> None:
    """Leaves out cells that tell by themselves that they fail."""
    for i in range(means.shape[0]):
        cell = memory.cells[i]
        if cell.isolated == 1 or math.isnan(cell.last):
            continue
        signal = signal_of(cell)
        if signal == NO_SIGNAL:
            continue
        statistic, threshold = statistic_of(cell, signal)
        evidence = EVIDENCE_STUCK
        if signal == OUT_OF_RANGE:
            evidence = EVIDENCE_RANGE
        elif signal == LEAPING:
            evidence = EVIDENCE_NOISE
        forget_sums(cell)
        predicted = expected(p, i, sun_b, covariance, light).high if phase == PHASE_SETTLED else 0.0
        add_look(p, cell, cell.last, predicted)
        _leave_out(cell, evidence, statistic, threshold, step, step)
        cell.onset = 0.0
        cell.kind = kind_of(cell, signal)


@kernel
def _judge_in_the_dark(p, memory, means, window, step, sky) -> None:
    """Light where there is none: neither Sun nor Earth."""
    for i in range(means.shape[0]):
        cell = memory.cells[i]
        if cell.isolated == 1 or math.isnan(cell.last):
            continue
        off = abs(cell.last)
        squared = min(off * off / (p.floor + p.noise * p.noise), 25.0)
        cell.score = min(max(0.0, cell.score + (squared - _FREE) * window), _MOST_SCORE)
        if cell.score == 0.0:
            cell.first_step = -1
            continue
        if cell.first_step < 0:
            cell.first_step = step
            forget_sums(cell)
        add_look(p, cell, cell.last, 0.0)
        if cell.score > p.threshold:
            _leave_out(cell, EVIDENCE_DARK, cell.score, p.threshold, cell.first_step, step)
            cell.kind = kind_of(cell, signal_of(cell))
