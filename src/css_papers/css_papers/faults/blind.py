# SPDX-License-Identifier: Apache-2.0
"""What two failed cells take from a layout: parts of the sky from which those that are left do not see the Sun."""

import math
from collections.abc import Iterator
from itertools import combinations
from typing import NamedTuple

import numpy as np

from css_common.mission import Mission
from css_monte_carlo.coverage import Grid, grid_about, layout_of_mission, map_cells
from css_papers.page import Section, Table

# no direction lies in a plane of two axes, where cells on faces are neither lit nor dark
_POLAR, _AZIMUTH = 60, 88
_POWER = math.radians(30.0)
DIM = 0.2
"""Output [-] of a cell that looks at nothing but the Earth, where it is bright: no less tells of the Sun."""
_SINGLE = 1  # cell in the Sun: a cone of directions, but no direction


class Sight(NamedTuple):
    """What the cells that are left see, in shares of the sky and of directions within 30 deg of the array normal."""

    cells: tuple[int, ...]  # that fail
    blind: float  # no cell sees the Sun
    cone: float  # one cell does
    blind_in_power: float
    cone_in_power: float


def sights(mission: Mission, failing: int, dim: float = DIM) -> list[Sight]:
    """Of each set of so many cells, of which those count that read more than `dim` in the light of the Sun."""
    layout, grid = layout_of_mission(mission), _grid(mission)
    layout = layout._replace(chain=layout.chain._replace(dropout=dim))
    count = len(layout.cells)
    return [_sight(layout, grid, cells) for cells in combinations(range(count), failing)]


def harmless_pairs(mission: Mission) -> list[frozenset[int]]:
    """The pairs of cells without which two cells or more see the Sun from as many directions in power as with them."""
    (whole,) = sights(mission, 0)
    seen = (whole.blind_in_power, whole.cone_in_power)
    return [frozenset(pair.cells) for pair in sights(mission, 2) if (pair.blind_in_power, pair.cone_in_power) == seen]


def _grid(mission: Mission) -> Grid:
    x, y, z = mission.values.spacecraft.array_normal
    return grid_about((x, y, z), _POLAR, _AZIMUTH)


def _sight(layout, grid: Grid, cells: tuple[int, ...]) -> Sight:
    seen = map_cells(layout, grid, dead=cells).seen_by
    near = grid.polar <= _POWER
    weight = grid.ring_weight / seen.shape[1]

    def share(which: np.ndarray, rings: np.ndarray) -> float:
        whole = weight[rings].sum() * seen.shape[1]
        return float((which[rings].sum(axis=1) * weight[rings]).sum() / whole)

    everywhere = np.ones_like(near)
    return Sight(
        cells,
        share(seen == 0, everywhere),
        share(seen == _SINGLE, everywhere),
        share(seen == 0, near),
        share(seen == _SINGLE, near),
    )


def blind_section(missions: dict[str, Mission]) -> Section:
    """The section of the page: without a fault, and over all pairs of cells."""
    heading = ["layout", "cells gone", "no cell", "one cell", "no cell, 30 deg", "one cell, 30 deg", "worst pair"]
    return Section("What two failed cells leave to be seen", [_ARGUMENT, Table(heading, list(_lines(missions)))])


def _lines(missions: dict[str, Mission]) -> Iterator[list[str]]:
    for name, mission in _by_layout(missions).items():
        (whole,) = sights(mission, 0)
        yield [name, "none", *_shares(whole), ""]
        pairs = sights(mission, 2)
        mean = Sight((), *np.mean([pair[1:] for pair in pairs], axis=0).tolist())
        yield [name, f"two, mean of {len(pairs)} pairs", *_shares(mean), ""]
        worst = max(pairs, key=lambda pair: (pair.blind_in_power, pair.cone_in_power, pair.blind, pair.cone))
        yield [name, "two, the worst", *_shares(worst), " and ".join(map(str, worst.cells))]


def _by_layout(missions: dict[str, Mission]) -> dict[str, Mission]:
    """A mission for each layout, by the names of all that have it."""
    names: dict[str, list[str]] = {}
    for name, mission in missions.items():
        names.setdefault(str((mission.values.cells, mission.values.spacecraft.array_normal)), []).append(name)
    return {"; ".join(same): missions[same[0]] for same in names.values()}


def _shares(sight: Sight) -> list[str]:
    return [f"{100.0 * value:.1f} %" for value in sight[1:]]


_ARGUMENT = (
    "Share of the sky, and of the directions within 30 deg of the array normal, from which no cell or only one of "
    f"those that are left sees the Sun with more than {DIM:g} of full output, which the Earth alone may give. One cell "
    "gives a cone of directions, two give two directions: where these shares are large in power, no flight can be "
    "asked to stay there by its cells alone, whatever it knows of them."
)
