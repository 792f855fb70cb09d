# SPDX-License-Identifier: Apache-2.0
"""What hides part of the sky from the cells: a body plane for all, or a collar around some."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from css_common.declared import builder, given, table_of
from css_common.schema import Values, integers, real, reals
from css_environment.albedo import Screen, plane_screen, soft_screen, with_views
from css_sensors.cells import CLIP_NORMAL, NORMALS, blocked_directions, own_view_cosines, plane_sides


class Collar(NamedTuple):
    """A collar around some cells."""

    axis_b: np.ndarray = given(
        reals("collar.axis", (0.0, 0.0, 0.0), "-", "axis of a collar around some cells, in b; zeros: none", length=3)
    )
    cells: np.ndarray = given(integers("collar.cells", (), "-", "numbers of the cells inside the collar"))
    full_deg: float = given(
        real("collar.full_deg", 28.0, "deg", "light within this angle of the axis passes whole", low=0.0, high=90.0)
    )
    dark_deg: float = given(
        real(
            "collar.dark_deg", 44.9, "deg", "light beyond this angle is hidden, with a linear edge", low=0.0, high=90.0
        )
    )


PARAMETERS = table_of(Collar)
_collar = builder(Collar)


def screen(values: Values) -> Screen:
    """The collar if there is one, else the body plane of the mission's cells; and what single cells do not see."""
    collar = _collar(values)
    if np.any(collar.axis_b):
        angles = np.radians([collar.full_deg, collar.dark_deg])
        around = soft_screen(collar.axis_b, *angles.tolist())
    else:
        around = plane_screen(values[CLIP_NORMAL])
    return with_views(around, own_view_cosines(values), blocked_directions(values))


def cell_sides(values: Values) -> np.ndarray:
    """Side (N,) of the screen on which each cell is: its nominal normal's part across the plane, 1 in the collar."""
    collar = _collar(values)
    if np.any(collar.axis_b):
        side = np.zeros(len(values[NORMALS]))
        side[collar.cells] = 1.0
        return side
    return plane_sides(values)


def conflicts(values: Values) -> Iterator[str]:
    """What is wrong between the values, one message each."""
    collar, count = _collar(values), len(values[NORMALS])
    length = float(np.linalg.norm(collar.axis_b))
    if length == 0.0:
        if len(collar.cells):
            yield "collar.cells: given without collar.axis"
        return
    if abs(length - 1.0) > 1e-6:
        yield f"collar.axis: length {length:.6g} given, expected a unit vector or zeros"
    if np.any(values[CLIP_NORMAL]):
        yield "collar.axis: given together with cells.clip_normal, expected one of the two"
    for cell in collar.cells:
        if not 0 <= cell < count:
            yield f"collar.cells: {cell} given, expected numbers from 0 to {count - 1}"
    if collar.full_deg > collar.dark_deg:
        yield f"collar.full_deg: {collar.full_deg:g} given, expected at most collar.dark_deg"
