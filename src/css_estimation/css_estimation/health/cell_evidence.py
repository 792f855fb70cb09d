# SPDX-License-Identifier: Apache-2.0
"""What speaks against each cell adds up; beyond a threshold it is left out, and used again when it has agreed for long.

Agreement counts while there is something to agree about, a cell in the Sun; the time that it takes doubles each time
that a cell has failed.
"""

import math

from css_common.kernel import kernel
from css_estimation.health.cell_expectation import SEEN, SURE, contradiction, expected
from css_estimation.health.cell_kinds import add_look, forget_sums, kind_of
from css_estimation.health.cell_memory import PHASE_SETTLED, CellHealthMemory, Track
from css_estimation.health.cell_options import CellHealthParameters
from css_estimation.health.cell_signals import LEAPING, NO_SIGNAL, OUT_OF_RANGE, signal_of, statistic_of

# The numbers of css_msgs/Health.
EVIDENCE_RANGE = 0
EVIDENCE_STUCK = 1
EVIDENCE_DEAD = 2
EVIDENCE_NOISE = 3
EVIDENCE_RESIDUAL = 6
EVIDENCE_DARK = 8

_FREE = 4.0  # squared sigmas that a healthy cell is off
_MOST_SCORE = 60.0
_DEAD = 0.05
_AGREES = 6.0  # squared sigmas
SHOWS = 0.3
"""Output or prediction from which agreement tells something."""
_MOST_TIMES = 4


@kernel
def in_use(cell) -> bool:
    """Whether the common direction rests on a cell."""
    return cell.isolated == 0 and cell.out_of_range == 0.0


@kernel
def by_others(cell) -> bool:
    """Whether a cell is left out for what others read, not for what it shows by itself."""
    return cell.isolated == 1 and (cell.evidence == EVIDENCE_DEAD or cell.evidence == EVIDENCE_RESIDUAL)


@kernel
def isolated_mask(memory: CellHealthMemory) -> int:
    """Bit i: cell i is left out."""
    mask = 0
    for i in range(memory.cells.shape[0]):
        if memory.cells[i].isolated == 1:
            mask |= 1 << i
    return mask


@kernel
def _leave_out(cell, evidence: int, statistic: float, threshold: float, since_step: int) -> None:
    cell.isolated, cell.good = 1, 0.0
    cell.times = min(cell.times + 1, _MOST_TIMES)
    cell.evidence, cell.statistic, cell.threshold, cell.since_step = evidence, statistic, threshold, since_step


@kernel
def trust_again(cell) -> None:
    """Uses a cell as if nothing had been."""
    cell.isolated, cell.score, cell.first_step, cell.same = 0, 0.0, -1, 0.0


@kernel
def forget_scores(memory: CellHealthMemory) -> None:
    """The direction was wrong: forgets what spoke against cells for its sake."""
    for i in range(memory.cells.shape[0]):
        cell = memory.cells[i]
        if by_others(cell):
            trust_again(cell)
        cell.score, cell.first_step = 0.0, -1


@kernel
def score_cells(
    p: CellHealthParameters, memory: CellHealthMemory, track: Track, window: float, step: int, share: float, dark_tells: bool
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
        if cell.isolated == 1:
            _judge_on(p, cell, output, e.high, e.sight == SEEN, abs(c), window)
            continue
        cell.score = min(max(0.0, cell.score + (abs(c) - _FREE) * window), _MOST_SCORE)
        if cell.score == 0.0:
            cell.first_step = -1
            continue
        if cell.first_step < 0:
            cell.first_step = step
            forget_sums(cell)
        add_look(p, cell, output, e.high)
        if cell.score > p.threshold:
            beyond += 1
    return beyond


@kernel
def _judge_on(
    p: CellHealthParameters, cell, output: float, predicted: float, seen: bool, off: float, window: float
) -> None:
    """A cell that is left out: what it looks like, and whether it agrees again."""
    add_look(p, cell, output, predicted)
    signal = signal_of(cell)
    cell.kind = kind_of(cell, signal)
    if signal != NO_SIGNAL or off > _AGREES:
        cell.good = 0.0
    elif seen and max(output, predicted) > SHOWS:
        cell.good += window
    if cell.good >= p.return_time * 2.0 ** (cell.times - 1):
        trust_again(cell)


@kernel
def leave_out(cell, statistic: float, threshold: float, step: int, window: float) -> None:
    """Leaves a cell out for what the others read."""
    evidence = EVIDENCE_DEAD if cell.read / max(cell.weight, 1.0) < _DEAD else EVIDENCE_RESIDUAL
    since = cell.first_step if cell.first_step >= 0 else step
    _leave_out(cell, evidence, statistic, threshold, since)
    cell.onset = cell.weight * window
    cell.kind = kind_of(cell, signal_of(cell))


@kernel
def leave_out_scored(p: CellHealthParameters, memory: CellHealthMemory, step: int, window: float) -> None:
    """Leaves out all cells whose score is beyond the threshold."""
    for i in range(memory.cells.shape[0]):
        cell = memory.cells[i]
        if cell.isolated == 0 and cell.score > p.threshold:
            leave_out(cell, cell.score, p.threshold, step, window)


@kernel
def judge_signals(p: CellHealthParameters, memory: CellHealthMemory, track: Track, step: int) -> None:
    """Leaves out cells that show by themselves that they fail."""
    for i in range(memory.cells.shape[0]):
        cell = memory.cells[i]
        # one that others spoke against may show what it is later
        if (cell.isolated == 1 and not by_others(cell)) or math.isnan(cell.last):
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
        if cell.isolated == 0:
            forget_sums(cell)
            settled = track.phase == PHASE_SETTLED
            predicted = expected(p, i, track.sun_b, track.covariance, track.light, SURE).high if settled else 0.0
            add_look(p, cell, cell.last, predicted)
            cell.onset = 0.0
        _leave_out(cell, evidence, statistic, threshold, step)
        cell.kind = kind_of(cell, signal)


@kernel
def judge_in_the_dark(p: CellHealthParameters, memory: CellHealthMemory, window: float, step: int) -> None:
    """Light where there is none, neither of the Sun nor of the Earth."""
    for i in range(memory.cells.shape[0]):
        cell, output = memory.cells[i], memory.means[i]
        if cell.isolated == 1 or math.isnan(output):
            continue
        squared = min(output * output / (p.floor + p.noise * p.noise), 25.0)
        cell.score = min(max(0.0, cell.score + (squared - _FREE) * window), _MOST_SCORE)
        if cell.score == 0.0:
            cell.first_step = -1
            continue
        if cell.first_step < 0:
            cell.first_step = step
            forget_sums(cell)
        add_look(p, cell, output, 0.0)
        if cell.score > p.threshold:
            _leave_out(cell, EVIDENCE_DARK, cell.score, p.threshold, cell.first_step)
            cell.onset = 0.0
            cell.kind = kind_of(cell, signal_of(cell))
