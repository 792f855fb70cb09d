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

MEASURED_NORMALS = reals(
    "cells.measured.normals",
    (),
    "-",
    "normals as calibrated, for flight software; empty: those of the layout",
    columns=3,
)
MEASURED_SCALES = reals(
    "cells.measured.scales",
    (),
    "-",
    "output of each cell at full light, as calibrated; empty: all 1",
    low=0.01,
    high=100.0,
)
MEASURED_DARKS = reals(
    "cells.measured.darks",
    (),
    "-",
    "output of each cell in the dark, as calibrated; empty: all 0",
    low=-10.0,
    high=10.0,
)
MEASURED_COEFFICIENTS = reals(
    "cells.measured.temperature_coefficients",
    (),
    "1/K",
    "relative change of each scale with temperature, as calibrated; empty: none known",
    low=-1.0,
    high=1.0,
)
MEASURED_TEMPERATURE = real(
    "cells.measured.temperature", 20.0, "deg C", "temperature at which the scales hold", low=-273.15, high=1000.0
)

MEASURED: Table = (
    MEASURED_NORMALS,
    MEASURED_SCALES,
    MEASURED_DARKS,
    MEASURED_COEFFICIENTS,
    MEASURED_TEMPERATURE,
)
"""What a calibration found of the cells."""

CELLS: Table = (
    NORMALS,
    FIELD_OF_VIEW,
    CLIP_NORMAL,
    SMALLEST_READING,
    LARGEST_READING,
    *MEASURED,
)


def conflicts(cells: Values) -> Iterator[str]:
    """What is wrong between the values of the section, one message each."""
    if len(cells.normals):
        yield from unit_rows("cells.normals", cells.normals, 1, MOST_CELLS)
    yield from _measured_conflicts(cells)
    clip = np.linalg.norm(cells.clip_normal)
    if clip != 0.0 and abs(clip - 1.0) > 1e-6:
        yield f"cells.clip_normal: length {clip:.6g} given, expected a unit vector or zeros"


def _measured_conflicts(cells: Values) -> Iterator[str]:
    measured, count = cells.measured, len(cells.normals)
    if len(measured.normals):
        yield from unit_rows("cells.measured.normals", measured.normals, 1, MOST_CELLS)
    for key in ("normals", "scales", "darks", "temperature_coefficients"):
        given = len(getattr(measured, key))
        if given and given != count:
            yield f"cells.measured.{key}: {given} given, expected one for each of the {count} cells of cells.normals"


def known_normals(values: Values) -> np.ndarray:
    """(N, 3) normals as flight software knows them: calibrated ones if there are, else those of the layout."""
    measured = values[MEASURED_NORMALS]
    return np.asarray(measured if len(measured) else values[NORMALS], dtype=np.float64).reshape(-1, 3)


def half_view_cosine(values: Values) -> float:
    """Cosine of half the cone of view."""
    return math.cos(math.radians(0.5 * values[FIELD_OF_VIEW]))


def plane_sides(values: Values) -> np.ndarray:
    """Component (N,) of each normal along the clip normal; 0 for a cell that the plane does not clip."""
    sides = values[NORMALS] @ values[CLIP_NORMAL]
    return np.where(np.abs(sides) < IN_PLANE, 0.0, sides)
