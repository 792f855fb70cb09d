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
from css_design.layout.readings import Readings, read_cells
from css_design.layout.scenes import Scenes, scenes_of
from css_monte_carlo.coverage import layout_of_mission
from css_sensors.cells import IN_PLANE
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

    def of(self, error: HeadingError) -> float:
        """What a search makes small."""
        return math.degrees(self.mean * error.mean + self.worst * error.worst + self.failed * error.failed)


class LayoutJudge:
    """Layouts under the signal chain, view and Earth of a mission.

    Attributes:
        clip_normal_b: (3,) of the body plane that hides half of the sky; zeros: none.
        sigma: error of a cell [-], `cell_sigma`.
    """

    def __init__(self, mission: Mission, aims: Aims, pointing: float, prior_deg: float = PRIOR_DEG) -> None:
        """Prepares the scenes.

        Raises:
            DesignError: the mission has no cells to lay out.
        """
        array = next((node for node in mission.nodes if node.component is CssArray), None)
        if array is None:
            raise DesignError(f"{mission.origin}: graph.nodes has no css_sim/css_array, no cells to lay out")
        if np.any(array.values.collar.axis):
            raise DesignError(f"{mission.origin}: collar.axis: its cells have their place, expected a mission without")
        self.clip_normal_b = np.asarray(array.values.cells.clip_normal)
        self._scenes: Scenes = scenes_of(mission, pointing)
        self._chain = layout_of_mission(mission).chain
        self._earthlit = bool(array.values.albedo.enabled)
        self._aims = aims
        self.sigma = cell_sigma(array.values)
        self._knowledge = Knowledge(self.sigma, math.radians(prior_deg))

    def read(self, normals_b: np.ndarray) -> Readings:
        """Readings of cells (K, 3) in all scenes."""
        sides = normals_b @ self.clip_normal_b
        sides = np.where(np.abs(sides) < IN_PLANE, 0.0, sides)
        return read_cells(self._chain, nominal_cells(normals_b, sides), self._scenes, self._earthlit)

    def error(self, normals_b: np.ndarray, readings: Readings, chosen: Sequence[int]) -> HeadingError:
        """Error of the layout of some of cells (K, 3) that were read."""
        return heading_error(normals_b, readings, self._scenes, self._knowledge, np.array(chosen, dtype=np.int64))

    def error_of(self, normals_b: np.ndarray) -> HeadingError:
        """Error of the layout of cells (N, 3)."""
        return self.error(normals_b, self.read(normals_b), range(len(normals_b)))

    def cost(self, error: HeadingError) -> float:
        """What a search makes small [deg]."""
        return self._aims.of(error)


def cell_sigma(array: Values) -> float:
    """1 sigma of what a reading errs by that is not the same in all cases [-]: noise, losses, calibration, converter."""
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
