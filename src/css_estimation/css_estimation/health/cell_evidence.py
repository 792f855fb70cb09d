# SPDX-License-Identifier: Apache-2.0
"""What speaks against each cell adds up; beyond a threshold it is left out, and used again when it has agreed for long.

Agreement counts while there is something to agree about, a cell in the Sun; the time that it takes doubles each time
that a cell has failed.
"""

import math

from css_common.health import (
    EVIDENCE_DARK,
    EVIDENCE_DEAD,
    EVIDENCE_NOISE,
    EVIDENCE_RANGE,
    EVIDENCE_RESIDUAL,
    EVIDENCE_STUCK,
    KIND_DEAD,
    KIND_SWAPPED,
    hold,
    release,
    rename,
)
from css_common.kernel import kernel
from css_estimation.health.cell_expectation import DOUBTFUL, MOST_SQUARED, SEEN, SURE, Expected, contradiction, expected
from css_estimation.health.cell_kinds import forget_sums, is_swapped, kind_of
from css_estimation.health.cell_memory import (
    LEAPING,
    NO_SIGNAL,
    OUT_OF_RANGE,
    CellHealthMemory,
    Track,
)
from css_estimation.health.cell_options import CellHealthParameters
from css_estimation.health.cell_signals import signal_of, statistic_of

FREE = 4.0
"""Squared sigmas that a healthy cell is off."""
MOST_SCORE = 60.0
_DEAD = 0.05
_AGREES = 6.0  # squared sigmas
SHOWS = 0.3
"""Output or prediction from which agreement tells something."""
_MOST_TIMES = 4


@kernel
def in_use(memory: CellHealthMemory, i: int) -> bool:
    """Whether the common direction rests on a cell."""
    return memory.verdicts[i].held == 0 and memory.cells[i].out_of_range == 0.0


@kernel
def by_others(memory: CellHealthMemory, i: int) -> bool:
    """Whether a cell is left out for what others read, not for what it shows by itself."""
    verdict = memory.verdicts[i]
    return verdict.held == 1 and (verdict.evidence == EVIDENCE_DEAD or verdict.evidence == EVIDENCE_RESIDUAL)


@kernel
def isolated_mask(memory: CellHealthMemory) -> int:
    """Bit i: cell i is left out."""
    mask = 0
    for i in range(memory.verdicts.shape[0]):
        if memory.verdicts[i].held == 1:
            mask |= 1 << i
    return mask


@kernel
def _leave_out(
    p: CellHealthParameters,
    memory: CellHealthMemory,
    i: int,
    evidence: int,
    statistic: float,
    threshold: float,
    since_step: int,
) -> None:
    cell = memory.cells[i]
    _hold(memory, i, kind_of(p, cell, signal_of(cell)), evidence, statistic, threshold, since_step)


@kernel
def hold_for_dead(
    memory: CellHealthMemory, i: int, evidence: int, statistic: float, threshold: float, since_step: int
) -> None:
    """Leaves a cell out that gives nothing."""
    _hold(memory, i, KIND_DEAD, evidence, statistic, threshold, since_step)


@kernel
def _hold(
    memory: CellHealthMemory, i: int, kind: int, evidence: int, statistic: float, threshold: float, since_step: int
) -> None:
    cell = memory.cells[i]
    cell.good, cell.sure = 0.0, 0
    cell.times = min(cell.times + 1, _MOST_TIMES)
    memory.changes[0] += 1
    hold(memory.verdicts[i], kind, evidence, statistic, threshold, since_step)


@kernel
def _begin_sums(memory: CellHealthMemory, i: int) -> None:
    forget_sums(memory.cells[i])
    memory.swap_looks[i] = 0.0
    for j in range(memory.cells.shape[0]):
        memory.swaps[i, j] = 0.0


@kernel
def begin_evidence(memory: CellHealthMemory, i: int, step: int) -> None:
    """Something begins to speak against a cell."""
    memory.cells[i].first_step = step
    _begin_sums(memory, i)


@kernel
def drop_evidence(memory: CellHealthMemory, i: int) -> None:
    """Forgets what has begun to speak against a cell."""
    cell = memory.cells[i]
    cell.score, cell.first_step = 0.0, -1


@kernel
def trust_again(memory: CellHealthMemory, i: int) -> None:
    """Uses a cell as if nothing had been."""
    release(memory.verdicts[i])
    memory.changes[0] += 1
    drop_evidence(memory, i)
    cell = memory.cells[i]
    cell.same = cell.vote = cell.opposite = 0.0


@kernel
def agreed_long(cell, first_time: float) -> bool:
    """Whether a cell that is left out has agreed for long enough: twice as long each time that it has failed before.

    Args:
        first_time: [s] that it takes after the first time.
    """
    # a real exponent: numba raises a number to a whole one by a loop that can raise an exception
    return cell.good >= first_time * 2.0 ** float(cell.times - 1)


@kernel
def forget_scores(memory: CellHealthMemory) -> None:
    """The direction was wrong: forgets what has begun to speak against cells for its sake."""
    for i in range(memory.cells.shape[0]):
        drop_evidence(memory, i)


@kernel
def _add_score(
    p: CellHealthParameters, memory: CellHealthMemory, i: int, squared: float, window: float, step: int
) -> bool:
    """Adds squared sigmas that a cell was off for `window` [s] to its score; whether that is beyond the threshold."""
    cell = memory.cells[i]
    cell.score = min(max(0.0, cell.score + (squared - FREE) * window), MOST_SCORE)
    if cell.score == 0.0:
        cell.first_step = -1
    elif cell.first_step < 0:
        begin_evidence(memory, i, step)
    return cell.score > p.threshold


@kernel
def score_cells(
    p: CellHealthParameters,
    memory: CellHealthMemory,
    track: Track,
    window: float,
    step: int,
    share: float,
    dark_tells: bool,
) -> int:
    """Adds a look to what speaks against each cell, and for those left out; how many are beyond the threshold.

    Args:
        track: before the update by this look.
        window: [s] since the look before.
        share: of the light that is left on all cells.
        dark_tells: that a cell reads too little is not the light's fault.
    """
    beyond = 0
    for i in range(memory.cells.shape[0]):
        cell, output = memory.cells[i], memory.means[i]
        if math.isnan(output):
            continue
        e = expected(p, i, track.sun_b, track.covariance, track.light, SURE)
        c = contradiction(p, e, output, share)
        if c < 0.0 and not dark_tells:
            continue
        cell.predicted = e.high if e.sight != DOUBTFUL else math.nan
        if memory.verdicts[i].held == 1:
            _judge_on(p, memory, i, output, e, abs(c), window)
            continue
        if _add_score(p, memory, i, abs(c), window, step):
            beyond += 1
    return beyond


@kernel
def leave_out_by(
    p: CellHealthParameters,
    memory: CellHealthMemory,
    i: int,
    evidence: int,
    statistic: float,
    threshold: float,
    since_step: int,
) -> None:
    """Leaves a cell out by what other cells read, whatever the direction to the Sun."""
    _begin_sums(memory, i)
    memory.used[i] = math.nan
    _leave_out(p, memory, i, evidence, statistic, threshold, since_step)


@kernel
def _judge_on(
    p: CellHealthParameters, memory: CellHealthMemory, i: int, output: float, e: Expected, off: float, window: float
) -> None:
    """A cell that is left out: what it looks like, and whether it agrees again."""
    cell = memory.cells[i]
    memory.swap_looks[i] += 1.0
    for j in range(memory.cells.shape[0]):
        predicted = memory.cells[j].predicted
        # where nothing is known of the other, nothing can be compared
        memory.swaps[i, j] += abs(output - predicted) if not math.isnan(predicted) else 0.0
    signal = signal_of(cell)
    kind = KIND_SWAPPED if is_swapped(memory, i) else kind_of(p, cell, signal)
    if kind != memory.verdicts[i].kind:
        rename(memory.verdicts[i], kind)
        memory.changes[0] += 1
    if signal != NO_SIGNAL or off > _AGREES:
        cell.good = 0.0
    elif e.sight == SEEN and max(output, e.high) > SHOWS:
        cell.good += window
    if agreed_long(cell, p.return_time):
        trust_again(memory, i)


@kernel
def leave_out(
    p: CellHealthParameters, memory: CellHealthMemory, i: int, statistic: float, threshold: float, step: int
) -> None:
    """Leaves a cell out for what the others read."""
    cell = memory.cells[i]
    mean = cell.read / cell.cycles if cell.cycles > 0.0 else memory.means[i]
    evidence = EVIDENCE_DEAD if mean < _DEAD else EVIDENCE_RESIDUAL
    since = cell.first_step if cell.first_step >= 0 else step
    _leave_out(p, memory, i, evidence, statistic, threshold, since)


@kernel
def leave_out_scored(p: CellHealthParameters, memory: CellHealthMemory, step: int) -> None:
    """Leaves out all cells whose score is beyond the threshold."""
    for i in range(memory.cells.shape[0]):
        score = memory.cells[i].score
        if memory.verdicts[i].held == 0 and score > p.threshold:
            leave_out(p, memory, i, score, p.threshold, step)
            memory.cells[i].sure = 1


@kernel
def judge_signals(p: CellHealthParameters, memory: CellHealthMemory, step: int) -> None:
    """Leaves out cells that show by themselves that they fail."""
    for i in range(memory.cells.shape[0]):
        cell, held = memory.cells[i], memory.verdicts[i].held == 1
        # one that others spoke against may show what it is later
        if (held and not by_others(memory, i)) or math.isnan(cell.last):
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
        if not held:
            _begin_sums(memory, i)
        _leave_out(p, memory, i, evidence, statistic, threshold, step)


@kernel
def judge_in_the_dark(p: CellHealthParameters, memory: CellHealthMemory, window: float, step: int) -> None:
    """Light where there is none, neither of the Sun nor of the Earth."""
    for i in range(memory.cells.shape[0]):
        cell, output = memory.cells[i], memory.means[i]
        if memory.verdicts[i].held == 1 or math.isnan(output):
            continue
        cell.predicted = 0.0
        squared = min(output * output / (p.floor + p.noise * p.noise), MOST_SQUARED)
        if _add_score(p, memory, i, squared, window, step):
            _leave_out(p, memory, i, EVIDENCE_DARK, cell.score, p.threshold, cell.first_step)
