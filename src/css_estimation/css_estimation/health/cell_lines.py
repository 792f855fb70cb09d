# SPDX-License-Identifier: Apache-2.0
"""A dead cell by lines that stand alone: in telemetry so coarse that nobody knows how the body turned in between.

Each line says where the Sun is with all cells healthy, and where it is with one of them dead (`cell_search`). By how
much fewer squared sigmas the outputs of a line are off with a dead cell than without adds up from line to line, less
what a healthy cell that happens to be dark gains, and fades with the lines; one in which the cell gives light takes it
back. Of two cells that explain the same lines, as two on opposite sides do until the Sun is on one of them, neither is
named.
"""

import math

from css_common.health import EVIDENCE_DEAD
from css_common.kernel import kernel
from css_estimation.health.cell_evidence import FREE, MOST_SCORE, SHOWS, agreed_long, hold_for_dead, trust_again
from css_estimation.health.cell_expectation import MOST_SQUARED
from css_estimation.health.cell_memory import CellHealthMemory
from css_estimation.health.cell_options import CellHealthParameters
from css_estimation.health.cell_search import gain_without

_COUNTS = 0.5
"""Time [s] that a line counts for: as one look of many."""
_KEPT = 0.99  # from line to line
_APART = 0.5  # of the threshold, by which a cell must be ahead of each other


@kernel
def judge_line(p: CellHealthParameters, memory: CellHealthMemory, step: int) -> None:
    """Judges all cells by a line; the search has just weighed it alone.

    Args:
        step: number of this cycle.
    """
    worst, next_worst = -1, 0.0
    for i in range(memory.cells.shape[0]):
        cell, output = memory.cells[i], memory.used[i]
        if math.isnan(output):
            _see_again(p, memory, i)
            continue
        dark = min(output * output / (p.floor + p.noise * p.noise), MOST_SQUARED)
        gain = min(gain_without(memory, i), MOST_SQUARED) - dark
        told = gain - FREE if gain > FREE or gain < -FREE else 0.0
        cell.line = min(max(0.0, _KEPT * cell.line + told * _COUNTS), MOST_SCORE)
        if cell.line == 0.0:
            cell.line_step = step
        if worst < 0 or cell.line > memory.cells[worst].line:
            next_worst = memory.cells[worst].line if worst >= 0 else 0.0
            worst = i
        else:
            next_worst = max(next_worst, cell.line)
    if worst < 0:
        return
    cell = memory.cells[worst]
    if cell.line > p.threshold and cell.line > next_worst + _APART * p.threshold:
        hold_for_dead(memory, worst, EVIDENCE_DEAD, cell.line, p.threshold, cell.line_step)
        memory.used[worst] = math.nan
        # what spoke against others may have been this one
        for i in range(memory.cells.shape[0]):
            memory.cells[i].line = 0.0


@kernel
def _see_again(p: CellHealthParameters, memory: CellHealthMemory, i: int) -> None:
    """A cell that was left out as dead: light brings it back."""
    cell, verdict = memory.cells[i], memory.verdicts[i]
    # a NaN compares false
    if verdict.held == 0 or verdict.evidence != EVIDENCE_DEAD or not memory.means[i] > SHOWS:
        return
    cell.good += _COUNTS
    if agreed_long(cell, p.return_time):
        trust_again(memory, i)
