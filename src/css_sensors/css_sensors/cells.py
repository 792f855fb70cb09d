# SPDX-License-Identifier: Apache-2.0
"""The coarse sun sensor cells of a mission: where they look, how far, and what of their outputs is a reading."""

import math
from collections.abc import Iterator

import numpy as np

from css_common.direction_grid import SIZE
from css_common.schema import Table, Values, integers, real, reals
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
FIELDS_OF_VIEW = reals(
    "cells.fields_of_view_deg",
    (),
    "deg",
    "full cone of view of each cell; empty: cells.field_of_view_deg for all",
    low=1.0,
    high=180.0,
)
BLOCKED = integers(
    "cells.blocked",
    (),
    "-",
    "for each direction of a grid of 5 deg in b (rings from +z to -z, azimuths from -180 deg) the sum of 2^i over the "
    "cells i that structure blocks there, as `layout --block` writes it; empty: nothing is blocked",
    low=0,
    high=2**MOST_CELLS - 1,
)
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
    FIELDS_OF_VIEW,
    CLIP_NORMAL,
    BLOCKED,
    SMALLEST_READING,
    LARGEST_READING,
    *MEASURED,
)


def conflicts(cells: Values) -> Iterator[str]:
    """What is wrong between the values of the section, one message each."""
    count = len(cells.normals)
    if count:
        yield from unit_rows("cells.normals", cells.normals, 1, MOST_CELLS)
    if len(cells.fields_of_view_deg) not in (0, len(cells.normals)):
        yield f"cells.fields_of_view_deg: {len(cells.fields_of_view_deg)} given, expected one for each of {count} cells"
    if len(cells.blocked) not in (0, SIZE):
        yield f"cells.blocked: {len(cells.blocked)} given, expected {SIZE}, one for each direction of the grid"
    elif len(cells.blocked) and int(np.max(cells.blocked)) >> count:
        yield f"cells.blocked: has a cell beyond {count - 1}, expected sums of 2^0 to 2^{count - 1}"
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
    """Cosine of half the cone of view, of the widest where cells differ in theirs."""
    own: np.ndarray = values[FIELDS_OF_VIEW]
    widest = float(np.max(own)) if len(own) else values[FIELD_OF_VIEW]
    return math.cos(math.radians(0.5 * widest))


def own_view_cosines(values: Values) -> np.ndarray:
    """Cosine (N,) of half the cone of view of each cell; none where they are alike."""
    views: np.ndarray = values[FIELDS_OF_VIEW]
    return np.array([math.cos(math.radians(0.5 * view)) for view in views.tolist()])


def blocked_directions(values: Values) -> np.ndarray:
    """Mask (SIZE,) of the cells that are blocked in each direction of `css_common.direction_grid`, uint32; or none."""
    return np.asarray(values[BLOCKED], dtype=np.uint32)


def plane_sides(values: Values) -> np.ndarray:
    """Component (N,) of each normal along the clip normal; 0 for a cell that the plane does not clip."""
    sides = values[NORMALS] @ values[CLIP_NORMAL]
    return np.where(np.abs(sides) < IN_PLANE, 0.0, sides)
