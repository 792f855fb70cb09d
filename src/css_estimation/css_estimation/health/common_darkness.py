# SPDX-License-Identifier: Apache-2.0
"""Cells that go dark together while there is a Sun: a dead board, told from an eclipse and from cells that age.

With a model of the orbit: all cells that must see the Sun are dark, while the model has had all of it for so long that
it cannot be late any more. The Sun sets in some seconds, as the shortest penumbra of an orbit takes 8 s; a board dies
from one reading to the next. Darkness that came at once is therefore no late model, and a few seconds of it decide;
darkness that came slowly has to outlast what a model may be late. Cells that age fade together but give light, and that
ends it.

Without a model a dead board is an eclipse until no eclipse lasts so long. Then no cell that is dark is believed any
more, unless the cells leave a part of the sky unseen, where the Sun may be. Time counts between looks at which cells
gave an output, and none of which is so long that the Sun may have risen and set unseen.
"""

import math
from typing import NamedTuple

from css_common.health import EVIDENCE_COMMON, EVIDENCE_DEAD
from css_common.kernel import kernel
from css_estimation.health.cell_evidence import agreed_long, begin_evidence, drop_evidence, hold_for_dead, trust_again
from css_estimation.health.cell_expectation import SEEN, SURE, expected
from css_estimation.health.cell_following import MOST_AT_ONCE
from css_estimation.health.cell_memory import DIRECTIONS, NO_SIGNAL, PHASE_SETTLED, CellHealthMemory, Darkness, Track
from css_estimation.health.cell_options import CellHealthParameters
from css_estimation.health.cell_signals import signal_of
from css_estimation.sun.cell_layout import sees_all
from css_estimation.sun.sun_heading import Sky

LATE = 60.0
"""Time [s] by which a model of the orbit may be late or early about the shadow."""
SHORTEST_DAY = 2600.0
"""Time [s] of Sun between two shadows, at least: half of the shortest orbit. Darkness before and after a longer time
without a look may be that of two shadows."""
_DARK_TIME = 10.0  # [s]
_AT_ONCE = 1.5  # [s] from most of the light to darkness: three looks
_MOST_OF_IT = 0.75  # of what a cell should read
_BACK = 5.0  # [s] of light after which a cell that was dark is used again; twice as long after each time that it failed


@kernel
def _darkest(p: CellHealthParameters) -> float:
    """Output below which a cell gives nothing [-]."""
    return math.sqrt(p.gate * (p.floor + p.noise * p.noise))


class _Told(NamedTuple):
    """What the cells that must see the Sun tell."""

    dark: int  # mask of those that give nothing
    lit: bool  # one of them gives something, or another cell may see the Sun
    share: float  # largest part of what they should read


@kernel
def _told(p: CellHealthParameters, memory: CellHealthMemory, track: Track) -> _Told:
    dark, lit, share = 0, False, 0.0
    darkest = _darkest(p)
    for i in range(memory.used.shape[0]):
        output = memory.used[i]
        if math.isnan(output):
            continue
        e = expected(p, i, track.sun_b, track.covariance, track.light, SURE)
        if output > p.minimum:
            lit = True
        # where nothing would be no contradiction, it tells nothing
        if e.sight == SEEN and e.low * e.low > p.gate * e.variance:
            share = max(share, output / e.high)
            memory.cells[i].predicted = e.high
            if abs(output) < darkest:
                dark |= 1 << i
            else:
                lit = True
    return _Told(dark, lit, share)


@kernel
def _given_up(memory: CellHealthMemory, darkness: Darkness, waning: float) -> Darkness:
    """No darkness of all cells, or not any more: what has begun to speak against them is forgotten."""
    for i in range(memory.cells.shape[0]):
        if darkness.mask >> i & 1 and memory.verdicts[i].held == 0:
            drop_evidence(memory, i)
    d = darkness
    return Darkness(waning, 0.0, 0, False, d.unlit, d.unlit_step, d.unread, d.told, d.lasting)


@kernel
def judge_darkness(
    p: CellHealthParameters,
    memory: CellHealthMemory,
    track: Track,
    darkness: Darkness,
    day: float,
    window: float,
    rate_sure: bool,
    step: int,
) -> Darkness:
    """A look at cells that must see the Sun; holds for failed those that have been dark together for long enough.

    Args:
        track: before the outputs of this look.
        day: [s] for which the model of the orbit has had all of the Sun.
        window: [s] since the look before.
        rate_sure: a gyro or the wheels tell how the body turns: nothing else does in the dark.
        step: number of this cycle.
    """
    if track.phase != PHASE_SETTLED or not rate_sure or day <= LATE:
        return _given_up(memory, darkness, darkness.waning + window)
    told = _told(p, memory, track)
    waning = 0.0 if told.share >= _MOST_OF_IT else darkness.waning + window
    if told.lit:
        return _given_up(memory, darkness, waning)
    at_once = darkness.at_once if darkness.mask != 0 else waning <= _AT_ONCE
    mask = darkness.mask | told.dark
    for i in range(memory.cells.shape[0]):
        if told.dark >> i & 1 and memory.cells[i].first_step < 0:
            begin_evidence(memory, i, step)
    # while no cell must see the Sun there is nothing to wait for
    time = darkness.time + (min(window, MOST_AT_ONCE) if told.dark != 0 else 0.0)
    needed = _DARK_TIME if at_once else LATE + _DARK_TIME
    if time > needed:
        _hold_dark(memory, mask, time, needed)
    d = darkness
    return Darkness(waning, time, mask, at_once, d.unlit, d.unlit_step, d.unread, d.told, d.lasting)


@kernel
def _hold_dark(memory: CellHealthMemory, mask: int, time: float, needed: float) -> None:
    """Holds for failed the cells of a mask that have each been dark for long; several of them failed together."""
    together = mask & (mask - 1) != 0
    evidence = EVIDENCE_COMMON if together else EVIDENCE_DEAD
    for i in range(memory.cells.shape[0]):
        if mask >> i & 1 == 0:
            continue
        verdict = memory.verdicts[i]
        if verdict.held == 0 and memory.cells[i].seconds > _DARK_TIME:
            hold_for_dead(memory, i, evidence, time, needed, memory.cells[i].first_step)
            memory.used[i] = math.nan
        elif verdict.held == 1 and together and verdict.evidence == EVIDENCE_DEAD:
            verdict.evidence = EVIDENCE_COMMON
            memory.changes[0] += 1


@kernel
def judge_lasting_darkness(
    p: CellHealthParameters, memory: CellHealthMemory, darkness: Darkness, window: float, lit: bool, sky: Sky, step: int
) -> Darkness:
    """A look without a model of the orbit: darkness that outlasts all eclipses.

    Args:
        lit: a cell in use sees light.
        others: as of `judge_darkness`.
    """
    d = darkness
    if lit or sky.known:
        return Darkness(d.waning, d.time, d.mask, d.at_once, 0.0, step, 0.0, -1, d.lasting and not lit)
    since, told = d.unread + window, _given(memory)
    if told == 0:
        return Darkness(d.waning, d.time, d.mask, d.at_once, d.unlit, d.unlit_step, since, d.told, d.lasting)
    unlit, unlit_step, lasting = lasted(d.unlit, since, SHORTEST_DAY), d.unlit_step, d.lasting
    if since > SHORTEST_DAY:
        unlit_step = step
    else:
        told &= d.told
    if unlit > p.longest_eclipse and not lasting:
        if sees_all(p.layout, told & ~p.screened, p.minimum, DIRECTIONS):
            for i in range(memory.cells.shape[0]):
                # a NaN compares false
                dark = told >> i & 1 == 1 and abs(memory.used[i]) < _darkest(p)
                if memory.verdicts[i].held == 0 and dark:
                    begin_evidence(memory, i, step)
                    hold_for_dead(memory, i, EVIDENCE_COMMON, unlit, p.longest_eclipse, unlit_step)
                    memory.used[i] = math.nan
            lasting = True
        else:
            unlit, unlit_step, told = 0.0, step, -1
    return Darkness(d.waning, d.time, d.mask, d.at_once, unlit, unlit_step, 0.0, told, lasting)


@kernel
def lasted(before: float, since: float, longest: float) -> float:
    """Time [s] for which something has been so at each look, at one at which it is.

    Args:
        before: the same at the look before; 0: it was not so.
        since: [s] since that look.
        longest: [s] without a look within which nothing else can have been.
    """
    return before + since if before > 0.0 and since <= longest else min(since, MOST_AT_ONCE)


@kernel
def _given(memory: CellHealthMemory) -> int:
    """Mask of the cells in use that gave an output."""
    mask = 0
    for i in range(memory.used.shape[0]):
        if not math.isnan(memory.used[i]):
            mask |= 1 << i
    return mask


@kernel
def see_light_again(p: CellHealthParameters, memory: CellHealthMemory, darkness: Darkness, window: float) -> Darkness:
    """A look at cells held for dead while no other sees the Sun: those that give light for long are used again."""
    d, back = darkness, False
    for i in range(memory.cells.shape[0]):
        verdict, cell = memory.verdicts[i], memory.cells[i]
        if verdict.held == 0 or (verdict.evidence != EVIDENCE_COMMON and verdict.evidence != EVIDENCE_DEAD):
            continue
        # a NaN compares false
        if memory.means[i] > p.minimum and signal_of(cell) == NO_SIGNAL:
            cell.good += min(window, MOST_AT_ONCE)
        else:
            cell.good = 0.0
        if agreed_long(cell, _BACK):
            trust_again(memory, i)
            back = True
    if not (back and d.lasting):
        return d
    # there is a Sun, so that the others may as well have been in the shade
    for i in range(memory.cells.shape[0]):
        if memory.verdicts[i].held == 1 and memory.verdicts[i].evidence == EVIDENCE_COMMON:
            trust_again(memory, i)
    return Darkness(d.waning, d.time, d.mask, d.at_once, 0.0, d.unlit_step, 0.0, -1, False)
