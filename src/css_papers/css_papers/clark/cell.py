# SPDX-License-Identifier: Apache-2.0
"""Figure 3 of Benton: output of one cell over its angle to the light, and the angle that a converter cannot tell."""

from typing import NamedTuple

import numpy as np

from css_analysis.cell_outputs import Cells
from css_common.attitude import rotation_vector_to_mrp
from css_common.mission import Mission
from css_common.vectors import vector_of
from css_environment.mission_environment import MissionEnvironment
from css_papers.cell_outputs import ARRAY
from css_papers.rows import Row, row

_QUIET = (f"{ARRAY}.noise=0", f"{ARRAY}.albedo.enabled=false")
_ANGLES_DEG = np.linspace(0.0, 90.0, 361)
PRINTED_DEG = {0.0: 1.27, 30.0: 0.03, 63.0: 0.016}
"""Angles from the normal to what the paper has for their uncertainty, all in deg."""
CLOSEST_DEG = 26.7
"""Angle [deg] from a pyramid cell's normal that light within the collar's whole view comes closest to."""
_TOLERANCE_DEG = 1e-6


class Response(NamedTuple):
    """Output of a cell without noise over the angle from its normal."""

    angle_deg: np.ndarray  # (A,)
    output: np.ndarray  # (A,) [-]


class Cell:
    """The first flat cell of a mission in the light of the Sun at 1 AU alone."""

    def __init__(self, mission: Mission) -> None:
        self._cells = Cells(mission, ARRAY, *_QUIET)
        self._normal = mission.values.cells.normals[0]
        around = MissionEnvironment(mission.values, field=False).at(0.0)
        self._around = around._replace(sun_n=vector_of(self._normal), solar_flux=1.0, illumination=1.0)
        across = np.cross(self._normal, np.roll(self._normal, 1))
        self._axis = across / np.linalg.norm(across)

    def output(self, angle_deg: float) -> float:
        """Output [-] with the light so far off the normal."""
        x, y, z = (float(c) for c in np.radians(angle_deg) * self._axis)
        return float(self._cells.outputs(0.0, self._around, np.array(rotation_vector_to_mrp((x, y, z))))[0])

    def response(self) -> Response:
        """The whole curve."""
        return Response(_ANGLES_DEG, np.array([self.output(float(angle)) for angle in _ANGLES_DEG]))

    def uncertainty_deg(self, angle_deg: float) -> float:
        """Width [deg] of the angles, on one side of the normal, with the output of a given angle."""
        level = self.output(angle_deg)
        low = 0.0 if self.output(0.0) == level else self._edge(angle_deg, 0.0, level)
        return self._edge(angle_deg, 90.0, level) - low

    def _edge(self, inside: float, outside: float, level: float) -> float:
        while abs(outside - inside) > _TOLERANCE_DEG:
            middle = 0.5 * (inside + outside)
            if self.output(middle) == level:
                inside = middle
            else:
                outside = middle
        return inside


def cell_rows(cell: Cell) -> list[Row]:
    """What 12 bits leave open, at the paper's angles and where the pyramid is worst."""
    rows = [
        row(f"one count at {angle:g} deg", "deg", paper, cell.uncertainty_deg(angle))
        for angle, paper in PRINTED_DEG.items()
    ]
    note = (
        "the paper takes 63 deg for the closest that light comes to a pyramid cell's normal; that is the angle above "
        "the cell's face, to the normal it is 54.74 - 28 = 26.7 deg"
    )
    worst = cell.uncertainty_deg(CLOSEST_DEG)
    rows.append(row(f"one count at {CLOSEST_DEG:g} deg", "deg", None, worst, note=note))
    return rows
