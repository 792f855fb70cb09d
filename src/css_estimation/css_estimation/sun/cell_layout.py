# SPDX-License-Identifier: Apache-2.0
"""The coarse sun sensor cells as an estimator knows them: normals, view cone, hidden half space."""

from typing import NamedTuple

import numpy as np

from css_common.kernel import kernel
from css_common.schema import Values
from css_common.vectors import Vec3, vector_of
from css_sensors.cells import IN_PLANE, half_view_cosine, plane_sides

# Beyond it a number is no reading of a cell, and its square would overflow.
READABLE = 1e100

CELL = np.dtype([(name, np.float64) for name in ("nx", "ny", "nz", "side")], align=True)
"""One cell: outward unit normal in b, and its component along the clip normal; 0: the cell is not clipped."""


class CellLayout(NamedTuple):
    """Geometry of N cells."""

    cells: np.ndarray  # (N,) of CELL: one array, because each one in a parameter costs time at every call
    clip_normal_b: Vec3  # [-] normal of the plane that hides the other half space; zeros: none
    cos_half_view: float  # [-] cosine of half the view cone


def cell_layout(values: Values) -> CellLayout:
    """Layout of the mission's `cells` section."""
    normals_b = np.asarray(values.cells.normals, dtype=np.float64)
    cells = np.zeros(len(normals_b), CELL)
    cells["nx"], cells["ny"], cells["nz"] = normals_b.T
    cells["side"] = plane_sides(values)
    return CellLayout(cells, vector_of(values.cells.clip_normal), half_view_cosine(values))


@kernel
def sees(layout: CellLayout, i: int, direction_b: Vec3) -> bool:
    """True when a source in unit direction `direction_b` is in the view of cell `i`.

    It is inside the cone about the normal and on the cell's own side of the clipping plane
    (O'Keefe & Schaub 2013, Fig. 1).
    """
    cell, d = layout.cells[i], direction_b
    if cell.nx * d[0] + cell.ny * d[1] + cell.nz * d[2] < layout.cos_half_view:
        return False
    if cell.side == 0.0:
        return True
    c = layout.clip_normal_b
    return cell.side * (c[0] * d[0] + c[1] * d[1] + c[2] * d[2]) > 0.0


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
    """Mask of the outputs that are missing (NaN)."""
    mask = 0
    for i in range(voltages.shape[0]):
        if voltages[i] != voltages[i]:
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
def informs(layout: CellLayout, i: int, output: float, level: float, predicted_b: Vec3, missing: int) -> bool:
    """Whether a filter that expects the Sun in the unit direction `predicted_b` takes the output of cell `i`.

    A cell above `level` sees the Sun, and one that should see it says where the Sun is not, unless the cell that looks
    the other way is in `missing` (result of `missing_cells`).
    """
    if not (-READABLE < output < READABLE and (output > level or sees(layout, i, predicted_b))):
        return False
    return not (missing != 0 and output <= level and is_opposed(layout, i, missing))
