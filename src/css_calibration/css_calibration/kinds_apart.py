# SPDX-License-Identifier: Apache-2.0
"""What kinds of faults a stretch does not tell apart: whole recordings are asked, where flight software has to decide.

A level that is added and a scale read alike where the light stays the same; a converter that ends low reads like a cell
that is stuck where there is never less light than that. The kind that explains the outputs best is the verdict, and
others that explain them nearly as well are named with it.
"""

from typing import NamedTuple

import numpy as np

from css_calibration.fault_stretches import Outputs
from css_common.health import (
    KIND_BIAS,
    KIND_DRIFTING,
    KIND_SATURATED,
    KIND_SCALED,
    KIND_STUCK,
    KIND_UNKNOWN,
)

_BY_LIGHT = (KIND_BIAS, KIND_SCALED, KIND_DRIFTING, KIND_UNKNOWN)
_CONSTANT = (KIND_STUCK, KIND_SATURATED)
_FEWEST = 10
_ALIKE, _FLOOR = 1.3, 0.015  # mean squares of what two kinds leave, and what is no difference [-]
_GROWN = 0.08  # [-] over a stretch, as a drift
_LOWER = 0.1  # [-] of light below a level, which a limit shows and a stuck cell does not


class Kinds(NamedTuple):
    """The best one, and others that are as good."""

    best: int  # of css_msgs/Faults
    others: tuple[int, ...] = ()


def kinds_in(outputs: Outputs, cell: int, first: int, last: int, kind: int) -> Kinds:
    """What a cell looks like from an instant to another, beside what flight software takes it for."""
    rows = slice(first, last + 1)
    v, e, time = outputs.voltages[rows, cell], outputs.expected[rows, cell], outputs.time[rows]
    known = np.isfinite(v + e)
    v, e, time = v[known], e[known], time[known]
    if len(v) < _FEWEST:
        return Kinds(kind)
    if kind in _CONSTANT:
        return _limited(kind, v, e)
    return _of_light(kind, v, e, time) if kind in _BY_LIGHT else Kinds(kind)


def _limited(kind: int, v: np.ndarray, e: np.ndarray) -> Kinds:
    bright = v[v > _LOWER]
    if not len(bright):
        return Kinds(kind)
    level = float(np.median(bright))
    below = e < level - _LOWER
    if below.any():
        # with less light than its level a cell that is stuck stays there
        follows = float(np.mean(v[below] < level - 0.5 * _LOWER))
        return Kinds(KIND_SATURATED if follows > 0.5 else KIND_STUCK)
    return Kinds(kind, tuple(other for other in _CONSTANT if other != kind))


def _of_light(kind: int, v: np.ndarray, e: np.ndarray, time: np.ndarray) -> Kinds:
    off = v - e
    slope, level = np.polyfit(time - time[0], off, 1)
    line = level + slope * (time - time[0])
    squares = {
        KIND_BIAS: _mean_square(off - np.median(off)),
        KIND_SCALED: _mean_square(v - _share(v, e) * e),
    }
    if abs(slope * (time[-1] - time[0])) > _GROWN:
        squares[KIND_DRIFTING] = _mean_square(off - line)
    best = min(squares, key=lambda one: squares[one])
    if kind in squares and squares[kind] <= _ALIKE * squares[best] + _FLOOR**2:
        best = kind
    limit = _ALIKE * squares[best] + _FLOOR**2
    return Kinds(best, tuple(one for one, square in squares.items() if one != best and square <= limit))


def _share(v: np.ndarray, e: np.ndarray) -> float:
    lit = e > 0.1
    return float(np.median(v[lit] / e[lit])) if lit.any() else 1.0


def _mean_square(off: np.ndarray) -> float:
    """Of what is left, outliers counted as 3 robust deviations."""
    limit = 3.0 * max(1.4826 * float(np.median(np.abs(off))), 1e-6)
    return float(np.mean(np.clip(off, -limit, limit) ** 2))
