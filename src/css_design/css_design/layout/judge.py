# SPDX-License-Identifier: Apache-2.0
"""Judges layouts of a mission's cells: readings of any normals, and the error that they leave."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from css_common.mission import Mission
from css_common.schema import Values
from css_design.errors import DesignError
from css_design.layout.heading_error import HeadingError, Knowledge, heading_error
from css_design.layout.readings import Cells, Readings, read_cells
from css_design.layout.scenes import Scenes, scenes_of
from css_design.layout.structure import Blocking, Structure
from css_environment.albedo import with_views
from css_monte_carlo.coverage import layout_of_mission
from css_sensors.cells import IN_PLANE, MOST_CELLS, blocked_directions
from css_sim.cell_errors import nominal_cells
from css_sim.nodes.css_array import CssArray
from css_sim.sun_cells import OUTPUT_HIGH, OUTPUT_LOW

PRIOR_DEG = 20.0
_LEAST_SIGMA = 0.005  # [-] of cells that a mission takes for perfect


class Aims(NamedTuple):
    """What counts how much, on errors of a layout in deg."""

    mean: float = 1.0
    worst: float = 0.1
    failed: float = 0.5
    tail: float = 0.0

    def of(self, error: HeadingError) -> float:
        """What a search makes small."""
        parts = (self.mean * error.mean, self.worst * error.worst, self.failed * error.failed, self.tail * error.tail)
        return math.degrees(sum(parts))


class LayoutJudge:
    """Layouts under the signal chain, view and Earth of a mission.

    Attributes:
        clip_normal_b: (3,) of the body plane that hides half of the sky; zeros: none.
        sigma: error of a cell [-], `cell_sigma`.
        own, own_blocked: cells of the mission, and what is blocked from them where they are.
        blocking: by the structure, if there is one.
    """

    def __init__(
        self,
        mission: Mission,
        aims: Aims,
        pointing: float,
        prior_deg: float = PRIOR_DEG,
        structure: Structure | None = None,
    ) -> None:
        """Prepares the scenes.

        Raises:
            DesignError: the mission has no cells to lay out.
        """
        array = next((node for node in mission.nodes if node.component is CssArray), None)
        if array is None:
            raise DesignError(f"{mission.origin}: graph.nodes has no css_sim/css_array, no cells to lay out")
        if np.any(array.values.collar.axis):
            raise DesignError(
                f"{mission.origin}: {array.name}.collar.axis: a collar shades the cells that stand in it, none of "
                "those that are placed anew; expected a mission without, by "
                f"--set {array.name}.collar.axis=0,0,0 --set {array.name}.collar.cells=, and the collar as a part of "
                "--structure"
            )
        self.clip_normal_b = np.asarray(array.values.cells.clip_normal)
        self._scenes: Scenes = scenes_of(mission, pointing)
        self._chain = layout_of_mission(mission).chain
        self._earthlit = bool(array.values.albedo.enabled)
        if len(self._chain.responses) > 1:
            curves = np.reshape(array.values.response.outputs, (len(self._chain.responses), -1))
            mean = ",".join(f"{output:.4g}" for output in curves.mean(axis=0))
            raise DesignError(
                f"{mission.origin}: {array.name}.response.outputs: {len(self._chain.responses)} curves given, one for "
                "each cell that is there; expected one for all, as a cell that is placed anew has none, such as their "
                f"mean by --set {array.name}.response.outputs={mean}"
            )
        self.own = Cells(np.asarray(mission.values.cells.normals), _views_deg(array.values))
        self.own_blocked = blocked_directions(array.values)
        self.blocking = None if structure is None else Blocking(structure)
        if self.blocking is not None and structure is not None:
            places = structure.cells if len(structure.cells) else None
            if places is not None and len(places) != self.own.number:
                raise DesignError(
                    f"cells: {len(places)} places given, expected one for each of {self.own.number} cells"
                )
            self.own_blocked = self.blocking.table(self.own.normals_b, places)
        self._aims = aims
        self.sigma = cell_sigma(array.values)
        self._knowledge = Knowledge(self.sigma, math.radians(prior_deg))

    def read(self, cells: Cells, blocked: np.ndarray | None = None) -> Readings:
        """Readings of cells (K) in all scenes.

        Args:
            blocked: of `Blocking.table`; None: what the structure blocks from the faces that they are on.
        """
        parts = [self._read(cells.chosen(range(i, min(i + MOST_CELLS, cells.number))), blocked)
                 for i in range(0, cells.number, MOST_CELLS)]  # fmt: skip
        return Readings(*(np.concatenate(part) for part in zip(*parts, strict=True)))

    def _read(self, cells: Cells, blocked: np.ndarray | None) -> Readings:
        sides = cells.normals_b @ self.clip_normal_b
        sides = np.where(np.abs(sides) < IN_PLANE, 0.0, sides)
        if blocked is None:
            blocked = self.blocked(cells)
        screen = with_views(self._chain.screen, np.cos(np.radians(0.5 * cells.views_deg)), blocked)
        chain = self._chain._replace(screen=screen)
        return read_cells(chain, nominal_cells(cells.normals_b, sides), self._scenes, self._earthlit)

    def blocked(self, cells: Cells) -> np.ndarray:
        """What the structure blocks from cells on the middles of their faces; none without a structure."""
        return np.zeros(0, np.uint32) if self.blocking is None else self.blocking.table(cells.normals_b)

    def error(self, cells: Cells, readings: Readings, chosen: Sequence[int]) -> HeadingError:
        """Error of the layout of some cells that were read."""
        numbers = np.array(chosen, dtype=np.int64)
        return heading_error(cells.normals_b, readings, self._scenes, self._knowledge, numbers)

    def error_of(self, cells: Cells, blocked: np.ndarray | None = None) -> HeadingError:
        """Error of the layout of cells; `blocked` as of `read`."""
        return self.error(cells, self.read(cells, blocked), range(cells.number))

    def cost(self, error: HeadingError) -> float:
        """What a search makes small [deg]."""
        return self._aims.of(error)


def _views_deg(values: Values) -> np.ndarray:
    own = values.cells.fields_of_view_deg
    return np.array(own) if len(own) else np.full(len(values.cells.normals), values.cells.field_of_view_deg)


def cell_sigma(array: Values) -> float:
    """1 sigma [-] of what a reading errs by from case to case: noise, losses, calibration, converter."""
    step = array[OUTPUT_HIGH] - array[OUTPUT_LOW]
    parts = (
        array.noise,
        array.degradation / math.sqrt(12.0),
        array.fixed_degradation / math.sqrt(12.0),
        array.scale_common_error,
        array.scale_cell_error,
        array.bias,
        math.radians(array.misalignment_deg),
        step / 2**array.bits / math.sqrt(12.0) if array.bits else 0.0,
    )
    return max(math.hypot(*parts), _LEAST_SIGMA)
