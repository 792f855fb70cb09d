# SPDX-License-Identifier: Apache-2.0
"""The coarse sun sensor cells as an estimator knows them: normals, view cone, hidden half space."""

import math
from typing import NamedTuple

import numpy as np

from css_common.kernel import kernel
from css_common.schema import Values
from css_common.vectors import Vec3, vector_of
from css_environment.albedo import Screen, is_blocked, plane_screen, view_cosine, with_views
from css_estimation.sun.direction_grid import direction
from css_estimation.symmetric import Symmetric, product
from css_sensors.cells import (
    IN_PLANE,
    blocked_directions,
    half_view_cosine,
    known_normals,
    own_view_cosines,
    plane_sides,
)

READABLE = 2.0
"""From it on a number is no reading of a cell, 1 being the Sun at normal incidence.

No place gives a cell more than 2/sqrt(3) = 1.155 of the Sun's flux, 1.034 of the normal one at most: that is Sun and
white, diffuse Earth that fills the other half of the sky together, at the best angles of both. The rest is for cells
that are not calibrated."""

CELL = np.dtype([(name, np.float64) for name in ("nx", "ny", "nz", "side")], align=True)
"""One cell: outward unit normal in b, and its component along the clip normal; 0: the cell is not clipped."""


class CellLayout(NamedTuple):
    """Geometry of N cells."""

    cells: np.ndarray  # (N,) of CELL: one array, because each one in a parameter costs time at every call
    clip_normal_b: Vec3  # [-] normal of the plane that hides the other half space; zeros: none
    cos_half_view: float  # [-] cosine of half the view cone, the widest where they differ
    screen: Screen  # the plane again, with views of single cells and what structure blocks


def cell_layout(values: Values) -> CellLayout:
    """Layout of the mission's `cells` section."""
    normals_b = known_normals(values)
    cells = np.zeros(len(normals_b), CELL)
    cells["nx"], cells["ny"], cells["nz"] = normals_b.T
    cells["side"] = plane_sides(values)
    screen = with_views(plane_screen(values.cells.clip_normal), own_view_cosines(values), blocked_directions(values))
    return CellLayout(cells, vector_of(values.cells.clip_normal), half_view_cosine(values), screen)


@kernel
def half_view_of(layout: CellLayout, i: int) -> float:
    """Cosine of half the view cone of cell `i`."""
    return view_cosine(layout.screen, i, layout.cos_half_view)


@kernel
def sees(layout: CellLayout, i: int, direction_b: Vec3) -> bool:
    """True when a source in unit direction `direction_b` is in the view of cell `i`.

    It is inside the cone about the normal and on the cell's own side of the clipping plane
    (O'Keefe & Schaub 2013, Fig. 1).
    """
    cell, d = layout.cells[i], direction_b
    if cell.nx * d[0] + cell.ny * d[1] + cell.nz * d[2] < half_view_of(layout, i) or is_blocked(layout.screen, i, d):
        return False
    if cell.side == 0.0:
        return True
    c = layout.clip_normal_b
    return cell.side * (c[0] * d[0] + c[1] * d[1] + c[2] * d[2]) > 0.0


@kernel
def sees_all(layout: CellLayout, mask: int, level: float, directions: int) -> bool:
    """Whether the Sun lights a cell in `mask` above `level` wherever it stands, looked at in so many directions."""
    for g in range(directions):
        sun_b = direction(g, directions)
        lit = False
        for i in range(layout.cells.shape[0]):
            lit = lit or (mask >> i & 1 == 1 and sees(layout, i, sun_b) and cosine_on(layout, i, sun_b) > level)
        if not lit:
            return False
    return True


@kernel
def share_view(layout: CellLayout, i: int, mask: int) -> bool:
    """Whether there are directions that cell `i` sees in common with each cell in `mask`, taken one by one."""
    cell = layout.cells[i]
    half = max(half_view_of(layout, i), 0.0)
    for j in range(layout.cells.shape[0]):
        if mask >> j & 1:
            other, half_j = layout.cells[j], max(half_view_of(layout, j), 0.0)
            # cosine of both half views together: normals further apart have cones without a common direction
            apart = 2.0 * half * half - 1.0 + IN_PLANE
            if half_j != half:
                apart = half * half_j - math.sqrt((1.0 - half * half) * (1.0 - half_j * half_j)) + IN_PLANE
            if cell.nx * other.nx + cell.ny * other.ny + cell.nz * other.nz <= apart or cell.side * other.side < 0.0:
                return False
    return True


@kernel
def brightest(voltages) -> int:
    """Index of the largest readable output; -1 when none is above zero."""
    index = -1
    largest = 0.0
    for i in range(voltages.shape[0]):
        # a NaN compares false
        if voltages[i] > largest and voltages[i] < READABLE:
            largest = voltages[i]
            index = i
    return index


@kernel
def missing_cells(voltages) -> int:
    """Mask of the outputs that are missing: NaN, or what no cell reads."""
    mask = 0
    for i in range(voltages.shape[0]):
        if not -READABLE < voltages[i] < READABLE:
            mask |= 1 << i
    return mask


@kernel
def is_opposed(layout: CellLayout, i: int, mask: int) -> bool:
    """Whether a cell in `mask` looks away from cell `i`, by more than a right angle."""
    cell = layout.cells[i]
    for j in range(layout.cells.shape[0]):
        other = layout.cells[j]
        if mask >> j & 1 and cell.nx * other.nx + cell.ny * other.ny + cell.nz * other.nz < -IN_PLANE:
            return True
    return False


@kernel
def informs(
    layout: CellLayout, i: int, output: float, level: float, lit: bool, predicted_b: Vec3, margin: float, missing: int
) -> bool:
    """Whether a filter that expects the Sun in the unit direction `predicted_b` takes the output of cell `i`.

    A cell above `level` sees the Sun, and one that should see it says where the Sun is not, unless the cell that looks
    the other way is in `missing` (result of `missing_cells`). One that is `lit` below that level sees the Sun if the
    prediction allows it: what it knows is the Sun's cosine on the cell, with an error of `margin`.
    """
    if not -READABLE < output < READABLE:
        return False
    if output > level:
        return True
    if sees(layout, i, predicted_b):
        return not (missing != 0 and is_opposed(layout, i, missing))
    return lit and cosine_on(layout, i, predicted_b) > half_view_of(layout, i) - margin


@kernel
def cosine_on(layout: CellLayout, i: int, direction_b: Vec3) -> float:
    """Cosine of the angle between a unit vector and the normal of cell `i`."""
    cell = layout.cells[i]
    return cell.nx * direction_b[0] + cell.ny * direction_b[1] + cell.nz * direction_b[2]


@kernel
def view_margin(layout: CellLayout, i: int, covariance: Symmetric) -> float:
    """Largest error of the Sun's cosine on cell `i` that a direction with this covariance leaves, 3 sigma."""
    cell = layout.cells[i]
    n = (cell.nx, cell.ny, cell.nz)
    p = product(covariance, n)
    return 3.0 * math.sqrt(max(0.0, n[0] * p[0] + n[1] * p[1] + n[2] * p[2]))
