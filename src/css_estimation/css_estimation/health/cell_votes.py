# SPDX-License-Identifier: Apache-2.0
"""Cells that contradict each other by where they look, whatever the direction to the Sun: no search, no filter.

Vote. Outputs of cells that look nearly the same way differ by no more than light times the distance of their normals,
and where the edge of one view may lie between, by what a cell reads at it. Two that agree outvote a third. Light of the
Earth, intensity and eclipse are the same for all three: less tells than against an unknown Earth.

Opposite. The Sun is in one place, and the Earth throws no more than a bound. Of cells whose views have no direction in
common, one alone is lit beyond that, while two that do have one are: the one is wrong.
"""

import math

from css_common.health import EVIDENCE_OPPOSITE, EVIDENCE_VOTE
from css_common.kernel import kernel
from css_common.vectors import Vec3, dot
from css_estimation.health.cell_evidence import FREE, MOST_SCORE, leave_out_by
from css_estimation.health.cell_expectation import DOUBTFUL, MOST_SQUARED, SURE, expected
from css_estimation.health.cell_memory import PHASE_SETTLED, CellHealthMemory, Track
from css_estimation.health.cell_options import CellHealthParameters
from css_estimation.sun.cell_layout import half_view_of, share_view
from css_sensors.cells import IN_PLANE

_USEFUL = 0.6  # difference [-] beyond which two cells say nothing about each other


@kernel
def judge_votes(p: CellHealthParameters, memory: CellHealthMemory, track: Track, window: float, step: int) -> None:
    """A look: leaves out cells that others outvote for long enough.

    Args:
        track: before the outputs of this look.
        window: [s] that it counts for.
        step: number of this cycle.
    """
    # to hand parameters to a function takes longer than what it would find out of healthy cells
    layout, used, bound = p.layout.cells, memory.used, track.light + p.earth
    half = max(p.layout.cos_half_view, 0.0)
    together = 2.0 * half * half - 1.0 + IN_PLANE if p.layout.screen.views.shape[0] == 0 else 1.0
    least = math.sqrt(FREE * 2.0 * (p.floor + p.heading * track.light * track.light))  # that adds to a score
    for i in range(used.shape[0]):
        cell, output = memory.cells[i], used[i]
        if math.isnan(output):
            continue
        near = lit = False
        one = layout[i]
        for j in range(used.shape[0]):
            other = layout[j]
            cosine = one.nx * other.nx + one.ny * other.ny + one.nz * other.nz
            # a NaN compares false
            off = abs(output - used[j]) - least
            if off > 0.0:
                near = near or bound * bound * (2.0 - 2.0 * cosine) < min(off * off, _USEFUL * _USEFUL)
            if output > p.earth and used[j] > p.earth:
                lit = lit or cosine <= together or one.side * other.side < 0.0
        cell.vote = _added(cell.vote, _outvoted(p, memory, track, i) if near else 0.0, window)
        cell.opposite = _added(cell.opposite, _alone(p, memory, i) if lit else 0.0, window)
        if cell.vote == 0.0:
            cell.vote_step = step
        if cell.opposite == 0.0:
            cell.opposite_step = step
        if cell.vote > p.threshold:
            leave_out_by(p, memory, i, EVIDENCE_VOTE, cell.vote, p.threshold, cell.vote_step)
        elif cell.opposite > p.threshold:
            leave_out_by(p, memory, i, EVIDENCE_OPPOSITE, cell.opposite, p.threshold, cell.opposite_step)


@kernel
def _added(score: float, squared: float, window: float) -> float:
    return min(max(0.0, score + (squared - FREE) * window), MOST_SCORE)


@kernel
def _normal(p: CellHealthParameters, i: int) -> Vec3:
    cell = p.layout.cells[i]
    return cell.nx, cell.ny, cell.nz


@kernel
def _in_view(p: CellHealthParameters, track: Track, i: int) -> int:
    """Whether the Sun is in the view of a cell, DOUBTFUL while nobody knows."""
    if track.phase != PHASE_SETTLED:
        return DOUBTFUL
    return expected(p, i, track.sun_b, track.covariance, track.light, SURE).sight


@kernel
def _at_edges(p: CellHealthParameters, track: Track, i: int, j: int) -> float:
    """What the outputs of two healthy cells may differ by for the edges of their views [-]; infinite: any."""
    first = _in_view(p, track, i)
    if first != DOUBTFUL and first == _in_view(p, track, j):
        return 0.0
    sides_differ = p.layout.cells[i].side != p.layout.cells[j].side
    if sides_differ or p.layout.screen.blocked.shape[0] > 0:
        return math.inf
    return track.light * max(half_view_of(p.layout, i), half_view_of(p.layout, j), 0.0)


@kernel
def _off(p: CellHealthParameters, track: Track, memory: CellHealthMemory, i: int, j: int) -> float:
    """Sigmas by which output `i` is above output `j` beyond what is possible, negative if below; NaN: no telling."""
    one, other = memory.used[i], memory.used[j]
    apart = 2.0 - 2.0 * dot(_normal(p, i), _normal(p, j))
    bound = track.light + p.earth
    # a NaN compares false
    if not bound * bound * apart < _USEFUL * _USEFUL or not abs(one - other) >= 0.0:
        return math.nan
    most = bound * math.sqrt(max(apart, 0.0))
    if abs(one - other) <= most:
        return 0.0
    if (p.screened >> i | p.screened >> j) & 1 == 1:
        return math.nan
    excess = abs(one - other) - most - _at_edges(p, track, i, j)
    if math.isinf(excess):
        return math.nan
    # the errors of both
    variance = 2.0 * (p.floor + p.heading * track.light * track.light) + p.share * (one * one + other * other)
    sigmas = max(0.0, excess) / math.sqrt(variance)
    return sigmas if one > other else -sigmas


@kernel
def _outvoted(p: CellHealthParameters, memory: CellHealthMemory, track: Track, i: int) -> float:
    """Squared sigmas by which two cells that agree are both off a third, in the same sense; the nearer one's."""
    best, count = 0.0, memory.used.shape[0]
    for j in range(count):
        first = _off(p, track, memory, i, j) if j != i else math.nan
        # a NaN compares false
        if not abs(first) > 0.0:
            continue
        for k in range(j):
            second = _off(p, track, memory, i, k) if k != i else math.nan
            if not first * second > 0.0:
                continue
            between = _off(p, track, memory, j, k)
            if between * between < FREE:
                best = max(best, min(first * first, second * second))
    return min(best, MOST_SQUARED)


@kernel
def _beyond_earth(p: CellHealthParameters, memory: CellHealthMemory, i: int) -> float:
    """Sigmas by which a cell is lit by more than an Earth; 0 if it is not."""
    output = memory.used[i]
    # a NaN compares false
    if not output > p.earth:
        return 0.0
    return (output - p.earth) / math.sqrt(p.floor + p.share * output * output)


@kernel
def _alone(p: CellHealthParameters, memory: CellHealthMemory, i: int) -> float:
    """Squared sigmas by which a cell and two others are lit that cannot all see the Sun; 0 if another stands by it."""
    own, count = _beyond_earth(p, memory, i), memory.used.shape[0]
    if own == 0.0:
        return 0.0
    best = 0.0
    for j in range(count):
        first = _beyond_earth(p, memory, j) if j != i else 0.0
        if first == 0.0 or share_view(p.layout, i, 1 << j):
            continue
        for k in range(j):
            second = _beyond_earth(p, memory, k) if k != i else 0.0
            if second == 0.0 or not share_view(p.layout, j, 1 << k) or share_view(p.layout, i, 1 << k):
                continue
            if not _stood_by(p, memory, i, j, k):
                best = max(best, min(own, first, second))
    return min(best * best, MOST_SQUARED)


@kernel
def _stood_by(p: CellHealthParameters, memory: CellHealthMemory, i: int, j: int, k: int) -> bool:
    """Whether a fourth cell is lit that may see the Sun of cell `i`, but not that of cells `j` and `k`."""
    for m in range(memory.used.shape[0]):
        if m in (i, j, k) or _beyond_earth(p, memory, m) == 0.0:
            continue
        if share_view(p.layout, i, 1 << m) and not share_view(p.layout, m, 1 << j | 1 << k):
            return True
    return False
