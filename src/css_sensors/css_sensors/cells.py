# SPDX-License-Identifier: Apache-2.0
"""The coarse sun sensor cells of a mission: where they look, how far, and what of their outputs is a reading."""

import math
from collections.abc import Iterator

import numpy as np

from css_common.schema import Table, Values, real, reals
from css_common.section import unit_rows

MOST_CELLS = 32

IN_PLANE = 1e-9
"""A normal this close to a plane lies in it: rounding must not hide half of such a cell's view."""

NORMALS = reals(
    "cells.normals",
    (),
    "-",
    f"outward normals of the coarse sun sensor cells in b, at most {MOST_CELLS} rows of x, y, z",
    columns=3,
    example="cells: {normals: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]}",
)
FIELD_OF_VIEW = real("cells.field_of_view_deg", 180.0, "deg", "full cone of view of a cell", low=1.0, high=180.0)
CLIP_NORMAL = reals(
    "cells.clip_normal",
    (0.0, 0.0, 0.0),
    "-",
    "normal of the body plane that hides the other half space from each cell; zeros: no such plane",
    length=3,
)
SMALLEST_READING = real(
    "cells.smallest_reading", -10.0, "-", "an output below it is no reading: the cell is missing", high=0.0
)
LARGEST_READING = real(
    "cells.largest_reading", 2.0, "-", "an output above it is no reading: the cell is missing", low=0.0
)

CELLS: Table = (
    NORMALS,
    FIELD_OF_VIEW,
    CLIP_NORMAL,
    SMALLEST_READING,
    LARGEST_READING,
)


def conflicts(cells: Values) -> Iterator[str]:
    """What is wrong between the values of the section, one message each."""
    if len(cells.normals):
        yield from unit_rows("cells.normals", cells.normals, 1, MOST_CELLS)
    clip = np.linalg.norm(cells.clip_normal)
    if clip != 0.0 and abs(clip - 1.0) > 1e-6:
        yield f"cells.clip_normal: length {clip:.6g} given, expected a unit vector or zeros"


def half_view_cosine(values: Values) -> float:
    """Cosine of half the cone of view."""
    return math.cos(math.radians(0.5 * values[FIELD_OF_VIEW]))


def plane_sides(values: Values) -> np.ndarray:
    """Component (N,) of each normal along the clip normal; 0 for a cell that the plane does not clip."""
    sides = values[NORMALS] @ values[CLIP_NORMAL]
    return np.where(np.abs(sides) < IN_PLANE, 0.0, sides)
