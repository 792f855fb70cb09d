# SPDX-License-Identifier: Apache-2.0
"""Searches layouts of 1, 2, ... cells: exchange of places on the faces, then normals moved freely within their tilt.

The exchange is that of optimal design of experiments (Fedorov 1972): from the best layout of one cell less, the best
place for one more; then each cell in turn to the place that is best for it, until none moves. What it ends with, and
layouts that are given to begin with, are refined by scipy (Powell's method in the tilts of all cells).
"""

from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

from css_design.errors import DesignError
from css_design.layout.heading_error import HeadingError
from css_design.layout.judge import LayoutJudge
from css_design.layout.placements import allowed
from css_design.layout.readings import Cells, Readings

_FORBIDDEN = 1e6
_STEP = 0.35  # [rad] by which the refinement moves a normal at the most
_ROUNDS = 8


class Found(NamedTuple):
    """The best layout of a number of cells."""

    cells: Cells
    error: HeadingError
    cost: float  # [deg]


class LayoutSearch:
    """A search whose best layouts so far are there at any time.

    Attributes:
        best: by number of cells.
        ends: by number of cells, what the ways to it ended with: other layouts that nothing near is better than.
    """

    def __init__(
        self,
        judge: LayoutJudge,
        faces: Sequence[np.ndarray],
        places: Cells,
        tilt_deg: float,
        progress: Callable[[str], None] = lambda _: None,
    ) -> None:
        """Reads all places once.

        Args:
            tilt_deg: largest tilt of a cell from its face.
            progress: told what is searched.
        """
        self._judge, self._faces, self._tilt_deg = judge, faces, tilt_deg
        free = [allowed(place[None], faces, tilt_deg, judge.clip_normal_b) for place in places.normals_b]
        self._places = places.chosen(np.flatnonzero(free).tolist())
        if not self._places.number:
            raise DesignError("--faces: no cell may be on them, as the body plane of the mission hides half of the sky")
        self._readings = judge.read(self._places)
        self._progress = progress
        self.best: dict[int, Found] = {}
        self.ends: dict[int, list[Found]] = {}

    def run(self, counts: Iterable[int], starts: Sequence[Cells] = ()) -> None:
        """Searches layouts of each number of cells.

        Args:
            starts: layouts to begin with, beside what the exchange finds.
        """
        chosen: list[int] = []
        for count in range(1, max(counts) + 1):
            self._progress(f"{count} cells: exchange")
            chosen = self._exchanged([*chosen, 0])
            if count not in counts:
                continue
            self._keep(self._places.chosen(chosen))
            grown = [self._grown(self.best[count - 1].cells)] if count - 1 in self.best else []
            for start in [self._places.chosen(chosen), *grown, *(s for s in starts if s.number == count)]:
                self._keep(start)
                self._progress(f"{count} cells: refinement")
                end = self._keep(self._refined(start))
                if end is not None:
                    self.ends.setdefault(count, []).append(end)

    def _keep(self, cells: Cells) -> Found | None:
        """What cells come to, the best so far if it is; None: they may not be where they are."""
        if not self.may_be(cells):
            return None
        error = self._judge.error_of(cells)
        found, known = Found(cells, error, self._judge.cost(error)), self.best.get(cells.number)
        if known is None or found.cost < known.cost:
            self.best[cells.number] = found
        return found

    def may_be(self, cells: Cells) -> bool:
        """Whether cells are on the faces, within the tilt."""
        return allowed(cells.normals_b, self._faces, self._tilt_deg, self._judge.clip_normal_b)

    def _cost(self, chosen: Sequence[int]) -> float:
        return self._judge.cost(self._judge.error(self._places, self._readings, chosen))

    def _exchanged(self, chosen: list[int]) -> list[int]:
        cost = np.inf
        # the newest cell first: it has no place yet
        for _ in range(_ROUNDS):
            before = cost
            for k in reversed(range(len(chosen))):
                others = [*chosen[:k], *chosen[k + 1 :]]
                costs = [self._cost([*others, place]) for place in range(self._places.number)]
                best = int(np.argmin(costs))
                if costs[best] < cost - 1e-9:
                    chosen, cost = [*others[:k], best, *others[k:]], costs[best]
            if cost >= before - 1e-9:
                break
        return chosen

    def _grown(self, cells: Cells) -> Cells:
        """A layout with one more cell, at the place that is best for it."""
        own = self._judge.read(cells)
        together = Cells(*(np.concatenate(part) for part in zip(cells, self._places, strict=True)))
        readings = Readings(*(np.concatenate(part) for part in zip(own, self._readings, strict=True)))
        numbers = list(range(cells.number))
        costs = [
            self._judge.cost(self._judge.error(together, readings, [*numbers, cells.number + place]))
            for place in range(self._places.number)
        ]
        return together.chosen([*numbers, cells.number + int(np.argmin(costs))])

    def _refined(self, cells: Cells) -> Cells:
        axes = [_across(normal) for normal in cells.normals_b]

        def moved(x: np.ndarray) -> Cells:
            shifted = np.array([n + a @ t for n, a, t in zip(cells.normals_b, axes, x.reshape(-1, 2), strict=True)])
            return Cells(shifted / np.linalg.norm(shifted, axis=1, keepdims=True), cells.views_deg)

        def cost(x: np.ndarray) -> float:
            tried = moved(x)
            if not allowed(tried.normals_b, self._faces, self._tilt_deg, self._judge.clip_normal_b):
                return _FORBIDDEN
            return self._judge.cost(self._judge.error_of(tried))

        size = 2 * cells.number
        found = minimize(
            cost,
            np.zeros(size),
            method="Powell",
            bounds=[(-_STEP, _STEP)] * size,
            options={"maxiter": 3, "xtol": 0.005, "ftol": 1e-4},
        )
        return moved(found.x)


def _across(normal: np.ndarray) -> np.ndarray:
    """(3, 2) axes across a normal."""
    first = np.cross(normal, np.eye(3)[int(np.argmin(np.abs(normal)))])
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(normal, first)], axis=1)
