# SPDX-License-Identifier: Apache-2.0
"""Layouts judged by flights: the finalists of a search, the mission's own and what lies between, under the same draws.

The error of one estimate ranks layouts, and not what a filter makes of them over minutes. Each finalist flies the same
cases with the mission's own estimator; that with the smallest error in 95 % of the sunlit time after acquisition is
taken. The mission's own layout is a finalist where it has as many cells, so that by this measure and in these cases
nothing worse is taken.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from css_common.mission import Mission
from css_design.budget.measured import Estimate, Tell, bound, fly
from css_design.errors import DesignError
from css_design.layout.front import mission_with_cells
from css_design.layout.readings import Cells

SHARE = 0.95
_BETWEEN = (0.25, 0.5, 0.75)


class Flown(NamedTuple):
    """One layout in flight; heading errors in deg over sunlight after acquisition."""

    name: str
    cells: Cells
    mean: float
    bound: Estimate  # of 95 % of the errors, with its interval by resampled cases
    acquired: int  # cases that found the Sun for good
    cases: int

    @property
    def rank(self) -> tuple[int, float]:
        """What is small of a good one: cases that did not find the Sun, then the error."""
        return self.cases - self.acquired, self.bound.value


def between(first: Cells, second: Cells) -> list[Cells]:
    """Layouts on the way from one to another, each cell to the nearest of the other (the least sum of angles)."""
    if first.number != second.number or np.any(first.views_deg != second.views_deg[0]) or np.ptp(second.views_deg):
        return []
    angles = np.arccos(np.clip(first.normals_b @ second.normals_b.T, -1.0, 1.0))
    rows, columns = linear_sum_assignment(angles)
    a, b = first.normals_b[rows], second.normals_b[columns]
    found = []
    for share in _BETWEEN:
        normals = (1.0 - share) * a + share * b
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        if lengths.min() > 0.1:  # of two that look opposite ways nothing lies between
            found.append(Cells(normals / lengths, first.views_deg))
    return found


def fly_layouts(
    mission: Mission,
    layouts: Sequence[tuple[str, Cells]],
    blocked: Callable[[Cells], np.ndarray],
    cases: int,
    tell: Tell = lambda _, __: None,
) -> list[Flown]:
    """Flies layouts by name, all with the same draws, the best one first.

    Args:
        mission: whose cells they take the place of; it estimates the Sun.
        blocked: masks of what a structure blocks from cells.
        cases: of each, from 0 on.
        tell: told how many flights are done, and of how many.

    Raises:
        DesignError: none of them flies.
        MissionError: the compiled loop has no place for something of the mission.
    """
    flying, refused = {}, ""
    for name, cells in layouts:
        try:
            flying[name] = (cells, mission_with_cells(mission, cells, blocked(cells)))
        except DesignError as error:
            refused = str(error)
    if not flying:
        raise DesignError(refused or "no layout to fly")
    errors = fly({name: made for name, (_, made) in flying.items()}, cases, tell)
    flown = []
    for name, (cells, _) in flying.items():
        samples = [np.degrees(part) for part in errors[name].samples]
        everything = np.concatenate(samples)
        mean = float(everything.mean()) if len(everything) else np.nan
        acquired = int(np.count_nonzero(np.isfinite(errors[name].pointing)))
        flown.append(Flown(name, cells, mean, bound(samples, SHARE), acquired, cases))
    return sorted(flown, key=lambda one: one.rank)
