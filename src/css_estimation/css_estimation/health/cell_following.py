# SPDX-License-Identifier: Apache-2.0
"""The direction to the Sun that the cells together give, look after look, and the search beside it while in doubt."""

import math
from typing import NamedTuple

from css_common.attitude import rotation_vector_to_dcm
from css_common.kernel import kernel
from css_common.matrices import IDENTITY
from css_common.vectors import Vec3, matmul, multiply, scale
from css_estimation.health.cell_evidence import (
    SHOWS,
    by_others,
    forget_scores,
    leave_out,
    leave_out_scored,
    score_cells,
    trust_again,
)
from css_estimation.health.cell_expectation import DOUBTFUL, HIDDEN, SEEN, SURE, contradiction, expected
from css_estimation.health.cell_lines import judge_line
from css_estimation.health.cell_memory import (
    DIRECTIONS,
    PHASE_FOLLOWING,
    PHASE_LOOKING,
    PHASE_SETTLED,
    CellHealthMemory,
    Track,
)
from css_estimation.health.cell_options import CellHealthParameters
from css_estimation.health.cell_search import (
    begin_search,
    cost,
    judge_hypotheses,
    likelihood_far,
    likelihood_near,
    refine,
    weigh,
)
from css_estimation.sun.direction_grid import direction
from css_estimation.sun.sunline_filter import propagate
from css_estimation.symmetric import isotropic, trace

MOST_AT_ONCE = 0.5
"""Time [s] that one look counts for, however long after the last."""
LONGEST_STEP = 10.0
"""Time [s] from look to look beyond which nothing is known of how the body turned: each stands alone."""
_USELESS = 0.5  # [rad^2] of a direction that has to be looked for anew
_NOISE, _NOISE_WITHOUT_RATE = 0.02**2, 0.1**2  # [rad^2/s]
_SEARCH_EVERY = 0.999  # [s]
_FIRST_SEARCH, _LONGEST_SEARCH = 2.0, 5.0  # [s] of light before a direction is followed
_CLEAR = 2.0  # logarithm of likelihoods by which a direction is found
_ELSEWHERE = 6.0  # by which one is given up for another
_GUILTY = 10.0  # by which a cell fails
_KEPT, _KEPT_WITHOUT_RATE = 0.99, 0.8  # of weights from look to look of the search
_START_VARIANCE = 0.03  # [rad^2]
_SETTLED_AFTER = 3.0  # [s]
_SETTLED = 0.03  # [rad^2] trace: 7 deg per axis
_BRIGHT = 0.45  # of the light
_FADED = 0.75  # share of the light below which it sets
_LONGEST_FADE = 15.0  # [s] after which it does not
_LIGHT_MEMORY = 20.0  # [s]
_LINE = 2.0  # [s] of it, that a line is worth which stands alone
UNEXPLAINED = 5.0
"""Squared sigmas of all cells together beyond which a direction does not explain them."""
_DOUBT = 20.0  # [s]
_WORTH = 60.0  # squared sigmas that a direction is worth which has been sure for long
_CALM, _CALM_ENOUGH = 30.0, 10.0  # [s]


@kernel
def carried(track: Track, turn_b: Vec3, window: float, rate_sure: bool) -> Track:
    """The track at a look, before its outputs.

    Args:
        turn_b: [rad] of the body since the last look.
        window: [s] since then.
    """
    noise = _NOISE if rate_sure else _NOISE_WITHOUT_RATE
    mean_b = scale(1.0 / max(window, 1e-9), turn_b)
    sun_b, covariance = propagate(track.sun_b, track.covariance, mean_b, window, noise)
    phase, since, doubt = track.phase, track.since, track.doubt
    if phase != PHASE_LOOKING and (window > LONGEST_STEP or 0.5 * trace(covariance) > _USELESS):
        phase, since, doubt = PHASE_LOOKING, 0.0, 0.0
    frame = matmul(rotation_vector_to_dcm(turn_b), track.frame)
    return Track(
        phase, since, track.faded, track.calm, doubt, track.searched + window, sun_b, covariance, track.light, frame
    )


class _Seen(NamedTuple):
    """What the cells say of a direction."""

    support: int  # cells that see the Sun as expected
    against: int  # that contradict


@kernel
def _brightest_share(p: CellHealthParameters, memory: CellHealthMemory, track: Track) -> float:
    """Largest share of what they should read that cells in the Sun read, at most 1; 1 when none is."""
    share, lit = 0.0, False
    for i in range(memory.used.shape[0]):
        e = expected(p, i, track.sun_b, track.covariance, track.light, SURE)
        output = memory.used[i]
        # a NaN compares false
        seen = e.sight == SEEN and output > -1.0
        if e.high > SHOWS * track.light and (seen or (e.sight == DOUBTFUL and output > SHOWS)):
            share, lit = max(share, output / e.high), True
    return min(share, 1.0) if lit else 1.0


@kernel
def _seen(p: CellHealthParameters, memory: CellHealthMemory, track: Track, share: float) -> _Seen:
    support = against = 0
    for i in range(memory.used.shape[0]):
        output = memory.used[i]
        if math.isnan(output):
            continue
        e = expected(p, i, track.sun_b, track.covariance, track.light, SURE)
        if abs(contradiction(p, e, output, share)) > p.gate:
            against += 1
        elif output > SHOWS * track.light and e.sight != HIDDEN:
            support += 1
    return _Seen(support, against)


@kernel
def _light(p: CellHealthParameters, memory: CellHealthMemory, track: Track, window: float) -> float:
    """Output over cosine in common after a look."""
    total = weight = 0.0
    for i in range(memory.used.shape[0]):
        e = expected(p, i, track.sun_b, track.covariance, track.light, SURE)
        # a NaN compares false
        sees = e.sight == SEEN and memory.used[i] > _BRIGHT * track.light
        if sees and abs(contradiction(p, e, memory.used[i], 1.0)) <= p.gate:
            total += memory.used[i] * e.high
            weight += e.high * e.high
    if not weight > 0.0:
        return track.light
    now = min(max(track.light * total / weight, 0.5), 1.3)
    return track.light + min(1.0, window / _LIGHT_MEMORY) * (now - track.light)


@kernel
def looked(
    p: CellHealthParameters,
    memory: CellHealthMemory,
    track: Track,
    window: float,
    rate_sure: bool,
    one_sun: bool,
    step: int,
) -> Track:
    """The track after a look in the Sun.

    Args:
        window: [s] since the last look.
        rate_sure: the turn since then is measured.
        one_sun: the cells that read leave one Sun; of two, only a turn that is measured tells which cell is wrong.
    """
    judges = rate_sure or one_sun
    if track.phase == PHASE_LOOKING:
        return _looking(p, memory, track, window, rate_sure, step)
    # a Sun that sets, or rises, is dimmer for all alike, and not for long
    share = _brightest_share(p, memory, track)
    faded = track.faded + window if share < _FADED else 0.0
    fades = 0.0 < faded < _LONGEST_FADE
    if faded >= _LONGEST_FADE:
        share = 1.0
    seen = _seen(p, memory, track, share)
    settled = track.phase == PHASE_SETTLED
    unexplained = cost(p, memory.used, track.sun_b, track.covariance, track.light) > UNEXPLAINED and not fades
    # a direction on which most agree stays as sure as it was
    calm = track.calm
    if not unexplained and seen.support >= 2 and rate_sure:
        calm += window
    elif seen.support < 2 or seen.against >= seen.support or not rate_sure:
        # along the ring that one cell leaves the direction slides
        calm -= window
    calm = min(max(calm, 0.0), _CALM)
    sun_b, covariance, light = track.sun_b, track.covariance, track.light
    if not fades:
        gate = p.gate if settled else 2.0 * p.gate
        sun_b, covariance = refine(p, memory.used, sun_b, covariance, light, gate, not settled)
        light = _light(p, memory, track, window)
    if settled and judges:
        beyond = score_cells(p, memory, track, min(window, MOST_AT_ONCE), step, share, seen.support > 0 and not fades)
        # a direction that has been right for long is
        if beyond > 0 and track.calm >= _CALM_ENOUGH:
            leave_out_scored(p, memory, step)
    wrong = seen.against > 0 and seen.against >= seen.support and not fades
    phase, since = track.phase, track.since + window
    if not settled and since > _SETTLED_AFTER and trace(covariance) < _SETTLED and not wrong:
        phase, since = PHASE_SETTLED, 0.0
    doubt, searched, frame = track.doubt, track.searched, track.frame
    if unexplained:
        if doubt == 0.0:
            worth = _WORTH * track.calm / _CALM
            begin_search(memory, track.sun_b, 0.5 * trace(track.covariance) + p.heading, worth)
            frame = IDENTITY
        doubt = _DOUBT
    else:
        doubt = max(0.0, doubt - window)
    after = Track(phase, since, faded, calm, doubt, searched, sun_b, covariance, light, frame)
    if doubt > 0.0 and searched > _SEARCH_EVERY and not fades:
        after = _searching(p, memory, after, rate_sure, judges, step, window)
    return after


@kernel
def _found(track: Track, sun_b: Vec3, phase: int) -> Track:
    """Another direction to follow."""
    covariance = isotropic(_START_VARIANCE)
    return Track(phase, 0.0, 0.0, 0.0, _DOUBT, 0.0, sun_b, covariance, track.light, track.frame)


@kernel
def _weighed(
    p: CellHealthParameters, memory: CellHealthMemory, outputs, track: Track, rate_sure: bool
) -> tuple[float, Vec3]:
    """Likelihood of the best hypothesis after a look of the search, and its direction to the Sun."""
    kept = _KEPT if rate_sure else _KEPT_WITHOUT_RATE
    weigh(p, memory, outputs, track.frame, track.light, kept)
    best, g = judge_hypotheses(memory)
    return best, multiply(track.frame, direction(g, DIRECTIONS))


@kernel
def _looking(
    p: CellHealthParameters, memory: CellHealthMemory, track: Track, window: float, rate_sure: bool, step: int
) -> Track:
    """A look without a direction to follow."""
    frame, since, searched = track.frame, track.since, track.searched
    alone = window > LONGEST_STEP
    if since == 0.0 or alone:
        begin_search(memory, track.sun_b, 1.0, 0.0)
        since, frame, searched = 0.0, IDENTITY, _SEARCH_EVERY + window
    since += window
    track = Track(track.phase, since, 0.0, 0.0, _DOUBT, searched, track.sun_b, track.covariance, track.light, frame)
    if searched <= _SEARCH_EVERY:
        return track
    # whether cells that are left out are right again many looks tell, not one
    best, sun_b = _weighed(p, memory, memory.used if alone else memory.judged, track, rate_sure)
    light = track.light
    if alone:
        at = Track(track.phase, since, 0.0, 0.0, _DOUBT, 0.0, sun_b, isotropic(_START_VARIANCE), light, track.frame)
        light = _light(p, memory, at, _LINE)
        judge_line(p, memory, step)
    track = Track(track.phase, since, 0.0, 0.0, _DOUBT, searched, track.sun_b, track.covariance, light, track.frame)
    elsewhere = likelihood_far(memory, track.frame, sun_b)
    if since >= _FIRST_SEARCH and (best - elsewhere > _CLEAR or since > _LONGEST_SEARCH):
        return _found(track, sun_b, PHASE_FOLLOWING)
    return Track(track.phase, since, 0.0, 0.0, _DOUBT, 0.0, track.sun_b, track.covariance, track.light, frame)


@kernel
def _searching(
    p: CellHealthParameters,
    memory: CellHealthMemory,
    track: Track,
    rate_sure: bool,
    judges: bool,
    step: int,
    window: float,
) -> Track:
    """A look of the search beside a direction that is followed."""
    best, sun_b = _weighed(p, memory, memory.judged, track, rate_sure)
    for i in range(memory.cells.shape[0]):
        if judges and memory.verdicts[i].held == 0 and memory.against[i] > _GUILTY:
            leave_out(p, memory, i, memory.against[i], _GUILTY, step)
        elif by_others(memory, i) and memory.against[i] < -_GUILTY:
            trust_again(memory, i)
    if best - likelihood_near(memory, track.frame, track.sun_b) > _ELSEWHERE:
        forget_scores(memory)
        return _found(track, sun_b, PHASE_FOLLOWING)
    return Track(
        track.phase,
        track.since,
        track.faded,
        track.calm,
        track.doubt,
        0.0,
        track.sun_b,
        track.covariance,
        track.light,
        track.frame,
    )
