# SPDX-License-Identifier: Apache-2.0
"""What hides part of the sky from the cells: a body plane for all, or a collar around some."""

from collections.abc import Iterator

import numpy as np

from css_common.schema import Table, Values, integers, real, reals
from css_environment.albedo import Screen, plane_screen, soft_screen
from css_sensors.cells import plane_sides

PARAMETERS: Table = (
    reals("collar.axis", (0.0, 0.0, 0.0), "-", "axis of a collar around some cells, in b; zeros: none", length=3),
    integers("collar.cells", (), "-", "numbers of the cells inside the collar"),
    real("collar.full_deg", 28.0, "deg", "light within this angle of the axis passes whole", low=0.0, high=90.0),
    real("collar.dark_deg", 44.9, "deg", "light beyond this angle is hidden, with a linear edge", low=0.0, high=90.0),
)


def screen(values: Values) -> Screen:
    """The collar if there is one, else the body plane of the mission's cells."""
    if np.any(values.collar.axis):
        angles = np.radians([values.collar.full_deg, values.collar.dark_deg])
        return soft_screen(values.collar.axis, *angles.tolist())
    return plane_screen(values.cells.clip_normal)


def cell_sides(values: Values) -> np.ndarray:
    """Side (N,) of the screen on which each cell is: its nominal normal's part across the plane, 1 in the collar."""
    if np.any(values.collar.axis):
        side = np.zeros(len(values.cells.normals))
        side[values.collar.cells] = 1.0
        return side
    return plane_sides(values)


def conflicts(values: Values) -> Iterator[str]:
    """What is wrong between the values, one message each."""
    length = float(np.linalg.norm(values.collar.axis))
    count = len(values.cells.normals)
    if length == 0.0:
        if len(values.collar.cells):
            yield "collar.cells: given without collar.axis"
        return
    if abs(length - 1.0) > 1e-6:
        yield f"collar.axis: length {length:.6g} given, expected a unit vector or zeros"
    if np.any(values.cells.clip_normal):
        yield "collar.axis: given together with cells.clip_normal, expected one of the two"
    for cell in values.collar.cells:
        if not 0 <= cell < count:
            yield f"collar.cells: {cell} given, expected numbers from 0 to {count - 1}"
    if values.collar.full_deg > values.collar.dark_deg:
        yield f"collar.full_deg: {values.collar.full_deg:g} given, expected at most collar.dark_deg"
