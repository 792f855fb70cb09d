# SPDX-License-Identifier: Apache-2.0
"""The orbit that positions follow over months: one set of elements after the other, each for as long as it holds.

Drag, the Moon and manoeuvres move a spacecraft away from any one set. A stretch of positions that no set follows is
halved until one does; the next stretch is a quarter longer than the one that held before.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from css_telemetry.orbit_fit import Elements, fit_orbit
from css_telemetry.places import Place

LONGEST_S = 7 * 86_400.0
"""Span [s] over which one set of elements is tried: later, drag and the Moon have moved the spacecraft."""

SHORTEST_S = 5_400.0
"""Span [s], about an orbit, of positions that follow an orbit if they are positions at all."""

FAR_S = 3 * 86_400.0
"""So long [s] after the last position that its elements were fitted to, a place is a guess."""

_FIRST_S = 2 * 86_400.0  # of more than the longest span the first stretch
_FEWEST = 3
_GROWS = 1.25  # what the next stretch is longer by
_HOPELESS = 3  # of the shortest stretches, the first ones, that follow no orbit

Tell = Callable[[float, float], None]


class Arc(NamedTuple):
    """Elements from an instant on."""

    start_s: float  # after the first stamp
    end_s: float  # of the positions that they were fitted to
    elements: Elements
    rms_m: float
    worst_m: float


class Arcs(NamedTuple):
    """All of them."""

    arcs: list[Arc]
    lost_s: list[tuple[float, float]]  # stretches whose positions follow no orbit


def fit_arcs(place: Place, stamps_ns: np.ndarray, tell: Tell = lambda _, __: None) -> Arcs:
    """The elements through positions; the first ones hold at the first stamp.

    Args:
        place: positions and velocities, NaN where they are not known.
        stamps_ns: of the rows.
        tell: is told how many days are done, and how many there are.

    Raises:
        ValueError: they follow no orbit, or there are too few; says so.
    """
    known = np.flatnonzero(np.isfinite(place.r_n).all(axis=1))
    elapsed = (stamps_ns - stamps_ns[0]) * 1e-9
    if len(known) < _FEWEST:
        raise ValueError(f"{len(known)} positions are known, expected at least {_FEWEST}")
    end_s = float(elapsed[known[-1]])
    arcs: list[Arc] = []
    lost: list[tuple[float, float]] = []
    first, span = 0, LONGEST_S if end_s <= LONGEST_S else _FIRST_S
    while first < len(known):
        began = float(elapsed[known[first]])
        # a rest that is no stretch of its own goes with the one before it
        reach = end_s if end_s - began <= min(LONGEST_S, 1.25 * span) else began + span
        last = int(np.searchsorted(elapsed[known], reach, side="right"))
        rows = known[first:last]
        # the first elements are those at the first stamp, known or not
        whole = np.arange(0 if not arcs and not lost else rows[0], rows[-1] + 1)
        try:
            fit = fit_orbit(Place(place.r_n[whole], place.v_n[whole]), stamps_ns[whole])
        except ValueError:
            if span > SHORTEST_S and len(rows) > 2 * _FEWEST:
                span = max(SHORTEST_S, 0.5 * (float(elapsed[rows[-1]]) - began))
                continue
            lost.append((began, float(elapsed[rows[-1]])))
            if not arcs and (len(lost) == _HOPELESS or last == len(known)):
                raise
        else:
            start = float(elapsed[whole[0]])
            arcs.append(Arc(start if arcs else 0.0, float(elapsed[rows[-1]]), fit.elements, fit.rms_m, fit.worst_m))
            tell(float(elapsed[rows[-1]]) / 86_400.0, end_s / 86_400.0)
            span = min(LONGEST_S, _GROWS * span)
        first = last
    return Arcs(arcs, lost)
