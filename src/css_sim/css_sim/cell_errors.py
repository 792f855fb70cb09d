# SPDX-License-Identifier: Apache-2.0
"""What differs from cell to cell and lasts for a flight: normals, and errors of scale, offset and alignment.

The table of cells is one record array, because kernels pay for every array that a parameter holds.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from css_common.attitude import rotation_vector_to_dcm
from css_common.declared import builder, given, made, table_of
from css_common.kernel import kernel
from css_common.normal_distribution import normal_quantile
from css_common.random_streams import RandomKey, Stream, normal4, uniform4
from css_common.schema import real
from css_common.vectors import Vec3, add, axes_across, multiply_transposed, scale

CELL = np.dtype([(name, np.float64) for name in ("nx", "ny", "nz", "side", "gain", "bias")], align=True)
"""One cell: true outward unit normal in b; side of the screen that hides part of its sky, by the nominal normal, 0
for none; gain [-] and offset [-] of its output."""


class CellErrorModel(NamedTuple):
    """Statistics of the errors."""

    fixed_degradation: float = given(
        real("fixed_degradation", 0.0, "-", "largest lasting loss of a cell, uniform", low=0.0, high=1.0)
    )
    scale_common_error: float = given(
        real("scale_common_error", 0.0, "-", "1 sigma of the scale error of all cells", low=0.0, high=1.0)
    )
    scale_cell_error: float = given(
        real("scale_cell_error", 0.0, "-", "1 sigma of the scale error of each cell", low=0.0, high=1.0)
    )
    scale: float = given(  # the same in every case
        real("scale", 1.0, "-", "output of all cells, relative to what they are calibrated to", low=0.0, high=10.0)
    )
    misalignment: float = made(  # [rad] 1 sigma about each of two axes across the normal
        math.radians,
        real("misalignment_deg", 0.0, "deg", "1 sigma of the tilt of each normal, per axis", low=0.0, high=45.0),
    )
    bias: float = given(real("bias", 0.0, "-", "1 sigma of the constant offset of each cell", low=0.0, high=1.0))


PARAMETERS = table_of(CellErrorModel)
error_model = builder(CellErrorModel)


def nominal_cells(normals_b: np.ndarray, side: ArrayLike = 0.0) -> np.ndarray:
    """Array (N,) of CELL without errors.

    Args:
        normals_b: (N, 3) outward unit normals.
        side: (N,) side of the screen on which each cell is; 0: nothing hides its view.
    """
    cells = np.zeros(len(normals_b), CELL)
    cells["nx"], cells["ny"], cells["nz"] = np.asarray(normals_b, dtype=np.float64).T
    cells["side"] = side
    cells["gain"] = 1.0
    return cells


@kernel
def tilted(normal_b: Vec3, a: float, b: float) -> Vec3:
    """Unit vector after one rotation whose vector has parts a and b [rad] along two axes across `normal_b`."""
    e1, e2 = axes_across(normal_b)
    turn = rotation_vector_to_dcm(add(scale(a, e1), scale(b, e2)))
    return multiply_transposed(turn, normal_b)


@kernel
def draw_cells(p: CellErrorModel, key: RandomKey, nominal, cells_out) -> None:
    """Draw the cells of one case into `cells_out` from the `nominal` ones, both (N,) of CELL."""
    common = p.scale * (1.0 + p.scale_common_error * normal4(key, Stream.CELL_SCALE, 1, 0)[0])
    for i in range(nominal.shape[0]):
        cell = nominal[i]
        u = uniform4(key, Stream.CELL_SCALE, 0, i)
        gain = common * (1.0 + p.scale_cell_error * normal_quantile(u[0])) * (1.0 - p.fixed_degradation * u[1])
        tilt = normal4(key, Stream.CELL_MISALIGNMENT, 0, i)
        n = (cell.nx, cell.ny, cell.nz)
        if p.misalignment > 0.0:
            n = tilted(n, p.misalignment * tilt[0], p.misalignment * tilt[1])
        drawn = cells_out[i]
        drawn.nx, drawn.ny, drawn.nz = n
        drawn.side = cell.side
        drawn.gain = cell.gain * max(0.0, gain)
        drawn.bias = cell.bias + p.bias * normal_quantile(u[2])
