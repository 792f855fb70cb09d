# SPDX-License-Identifier: Apache-2.0
"""When a cell fails: stretches of time by what each of its outputs says, and what it looks most like in them.

A cell is healthy or it fails, and seldom changes from one to the other: of all sequences the likeliest, given how often
an output contradicts the light on a healthy cell and on one that fails (Viterbi). The kind is told by the rules that
flight software goes by (`health.cell_kinds`), over all outputs of the stretch.
"""

import math
from typing import NamedTuple

import numpy as np

from css_calibration.two_states import two_states
from css_common.health import KIND_BIAS, KIND_DEAD, KIND_DRIFTING, KIND_SCALED, KIND_SWAPPED, KIND_UNKNOWN
from css_common.kernel import kernel, typed_call
from css_common.schema import default_values
from css_common.shared_sections import section_table
from css_estimation.health import cell_options
from css_estimation.health.cell_kinds import add_output, forget_sums, kind_of
from css_estimation.health.cell_memory import LEAPING, NO_SIGNAL, OUT_OF_RANGE, STUCK, WATCHED
from css_estimation.health.cell_options import CellHealthParameters

_BAD_HEALTHY, _BAD_FAILING = 0.02, 0.5
_CHANGE = 14.0  # -ln of the chance that a cell changes at an instant
_DIM = 0.1  # what an output that agrees says against a fault, where little light is expected
_SWAPPED, _OWN = 0.12, 0.24  # mean differences from the light of the other cell, and from its own
_LEAST_SWAPPED = 20
_MAY_GROW = (KIND_BIAS, KIND_SCALED, KIND_UNKNOWN)
_BLOCKS, _FEWEST = 6, 6
_GROWN = 0.08  # [-] over a stretch


class Outputs(NamedTuple):
    """Of N cells at M instants."""

    time: np.ndarray  # (M,) [s]
    voltages: np.ndarray  # (M, N), NaN where missing
    expected: np.ndarray  # (M, N) of healthy cells, NaN where nobody knows
    bad: np.ndarray  # (M, N) an output contradicts what is expected
    leaps: np.ndarray  # (M, N) it leaps, by the outputs next to it
    same: np.ndarray  # (M, N) it is that of the sample before, to the last bit, although others change
    at_edge: np.ndarray  # (M, N) the Sun may be in view or not: an output that agrees says little


class Stretch(NamedTuple):
    """A cell that fails."""

    cell: int
    first: int  # instant
    last: int
    kind: int  # of css_msgs/Faults
    bad: int  # outputs that contradict
    of: int  # outputs that could


def failing(outputs: Outputs, cell: int) -> list[tuple[int, int]]:
    """First and last instants of the stretches in which a cell fails."""
    known = np.isfinite(outputs.expected[:, cell]) & np.isfinite(outputs.voltages[:, cell])
    bad = outputs.bad[:, cell] & known
    lit = known & (outputs.expected[:, cell] > 0.2)
    for_fault = np.zeros(len(bad))
    for_fault[bad] = math.log(_BAD_FAILING / _BAD_HEALTHY)
    agreed = math.log((1.0 - _BAD_FAILING) / (1.0 - _BAD_HEALTHY))
    for_fault[lit & ~bad] = agreed
    for_fault[known & ~bad & (~lit | outputs.at_edge[:, cell])] = _DIM * agreed
    state = two_states(for_fault, _CHANGE)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], state, [0]])))
    stretches = []
    for first, end in zip(edges[::2], edges[1::2], strict=True):
        inside = first + np.flatnonzero(bad[first:end])
        if len(inside):
            stretches.append((int(inside[0]), int(inside[-1])))
    return stretches


@kernel
def _named(p: CellHealthParameters, watched, time, voltages, expected, leaps, signal: int) -> int:
    cell = watched[0]
    forget_sums(cell)
    for k in range(time.shape[0]):
        if math.isnan(voltages[k]):
            continue
        cell.predicted = expected[k]
        cell.leaps += 1.0 if leaps[k] else 0.0
        add_output(cell, voltages[k], time[k] - time[k - 1] if k > 0 else 0.0)
        cell.last = voltages[k]
    return kind_of(p, cell, signal)


_kind = typed_call(_named)
_PARAMETERS = cell_options.parameters(
    default_values((*section_table("cells"), *cell_options.PARAMETERS), cells__normals=[1.0, 0.0, 0.0])
)


def kind_in(outputs: Outputs, cell: int, first: int, last: int) -> int:
    """What a cell looks most like from an instant to another."""
    rows = slice(first, last + 1)
    voltages = np.ascontiguousarray(outputs.voltages[rows, cell])
    leaps = np.ascontiguousarray(outputs.leaps[rows, cell])
    if not np.isfinite(voltages).any():
        return KIND_DEAD
    signal = NO_SIGNAL
    if np.mean(leaps) > 0.05:
        signal = LEAPING
    elif np.mean(outputs.same[rows, cell]) > 0.9:
        signal = STUCK
    elif np.nanmean(voltages) < _PARAMETERS.smallest:
        signal = OUT_OF_RANGE
    expected = np.ascontiguousarray(outputs.expected[rows, cell])
    return int(_kind(_PARAMETERS, np.zeros(1, WATCHED), outputs.time[rows], voltages, expected, leaps, signal))


def with_swapped(outputs: Outputs, found: list[Stretch]) -> dict[int, int]:
    """Cells that read what is expected of each other while both fail: the one to the other."""
    pairs: dict[int, int] = {}
    for a in found:
        for b in found:
            first, last = max(a.first, b.first), min(a.last, b.last)
            if a.cell >= b.cell or last <= first:
                continue
            rows = slice(first, last + 1)
            v, e = outputs.voltages[rows], outputs.expected[rows]
            both = np.isfinite(v[:, [a.cell, b.cell]]).all(axis=1) & np.isfinite(e[:, [a.cell, b.cell]]).all(axis=1)
            both &= e[:, [a.cell, b.cell]].max(axis=1) > 0.1
            if both.sum() < _LEAST_SWAPPED:
                continue
            crossed = max(
                np.abs(v[both, a.cell] - e[both, b.cell]).mean(), np.abs(v[both, b.cell] - e[both, a.cell]).mean()
            )
            own = min(
                np.abs(v[both, a.cell] - e[both, a.cell]).mean(), np.abs(v[both, b.cell] - e[both, b.cell]).mean()
            )
            if crossed < _SWAPPED and own > max(_OWN, 2.0 * crossed):
                pairs |= {a.cell: b.cell, b.cell: a.cell}
    return pairs


def _grows(outputs: Outputs, cell: int, first: int, last: int) -> bool:
    """Whether what a cell reads beyond the light on it grows evenly over a stretch, from little on."""
    inside = slice(first, last + 1)
    rows = first + np.flatnonzero(np.isfinite(outputs.expected[inside, cell] + outputs.voltages[inside, cell]))
    if len(rows) < _BLOCKS * _FEWEST:
        return False
    off = outputs.voltages[rows, cell] - outputs.expected[rows, cell]
    blocks = np.array_split(np.arange(len(rows)), _BLOCKS)
    time = np.array([outputs.time[rows[b]].mean() for b in blocks])
    median = np.array([np.median(off[b]) for b in blocks])
    slope, level = np.polyfit(time - time[0], median, 1)
    change = slope * (time[-1] - time[0])
    left = float(np.var(median - level - slope * (time - time[0])))
    return abs(change) > _GROWN and abs(level) < 1.5 * abs(change) and left < 0.15 * float(np.var(median))


def stretches_of(outputs: Outputs) -> list[Stretch]:
    """All stretches of all cells, those with too few contradictions left out."""
    found = []
    for cell in range(outputs.voltages.shape[1]):
        for first, last in failing(outputs, cell):
            rows = slice(first, last + 1)
            known = np.isfinite(outputs.expected[rows, cell]) & np.isfinite(outputs.voltages[rows, cell])
            bad = int((outputs.bad[rows, cell] & known).sum())
            kind = kind_in(outputs, cell, first, last)
            if kind in _MAY_GROW and _grows(outputs, cell, first, last):
                kind = KIND_DRIFTING
            found.append(Stretch(cell, first, last, kind, bad, int(known.sum())))
    swapped = with_swapped(outputs, found)
    return [s._replace(kind=KIND_SWAPPED) if s.cell in swapped else s for s in found]
