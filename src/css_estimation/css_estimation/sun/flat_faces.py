# SPDX-License-Identifier: Apache-2.0
"""Sun heading from cells mounted flat on the six faces of a body (Benton, section III).

Of each face the brightest cell counts, as the others may be shaded; of opposite faces the brighter, as the other may
see the Earth. The three outputs left are the components of the Sun vector. Light of the Earth errs it in two ways: it
adds to what the Sun gives a face, and where the Sun grazes a face it can make the opposite one the brighter, the
"wrong side", which turns the sign of a component.
"""

from collections.abc import Iterator

import numpy as np

from css_common.kernel import kernel
from css_common.schema import Values, integers
from css_common.vectors import Vec3, norm, scale
from css_estimation.sun.cell_layout import READABLE

FLAT_CELLS = integers(
    "flat.cells", (), "-", "numbers of the cells flat on the faces; empty: all with normals along body axes"
)

FACES = ("+x", "-x", "+y", "-y", "+z", "-z")

# A normal this close to a body axis lies along it.
_ALONG_AXIS_COS = np.cos(np.radians(1.0))

# Outputs that are together less than this leave no direction; a step of a 12-bit converter is far above it.
_NO_DIRECTION = 1e-6


def faces_of_cells(values: Values) -> np.ndarray:
    """Number in `FACES` of the face that each cell (N,) belongs to; -1: none."""
    normals_b = np.asarray(values.cells.normals, dtype=np.float64)
    faces = np.full(len(normals_b), -1, dtype=np.int64)
    chosen = [i for i in values[FLAT_CELLS] if 0 <= i < len(normals_b)] or range(len(normals_b))
    for i in chosen:
        axis = int(np.argmax(np.abs(normals_b[i])))
        if abs(normals_b[i, axis]) >= _ALONG_AXIS_COS:
            faces[i] = 2 * axis + (normals_b[i, axis] < 0.0)
    return faces


def conflicts(values: Values) -> Iterator[str]:
    """Faces without cells and cells that lie on no face, one message each."""
    faces = faces_of_cells(values)
    for i in values[FLAT_CELLS]:
        if not 0 <= i < len(faces):
            yield f"flat.cells: {i} given, expected numbers from 0 to {len(faces) - 1}"
        elif faces[i] < 0:
            yield f"flat.cells: cell {i} given, but its normal is along no body axis"
    missing = [name for number, name in enumerate(FACES) if number not in faces]
    if missing:
        yield f"flat.cells: no cell on {', '.join(missing)}; expected at least one with its normal along each"


@kernel
def flat_heading(faces, voltages) -> tuple[Vec3, int]:
    """Sun heading (unit, in b) and mask of the cells it uses; zeros and 0 when all are dark.

    Args:
        faces: (N,) result of `faces_of_cells`.
        voltages: (N,) cell outputs [-]; values that are not finite count as dark.
    """
    x, x_mask = _component(faces, voltages, 0)
    y, y_mask = _component(faces, voltages, 2)
    z, z_mask = _component(faces, voltages, 4)
    length = norm((x, y, z))
    if length < _NO_DIRECTION:
        return (0.0, 0.0, 0.0), 0
    return scale(1.0 / length, (x, y, z)), x_mask | y_mask | z_mask


@kernel
def _component(faces, voltages, face: int) -> tuple[float, int]:
    """Part along one axis: the brighter of `face` and its opposite, the next; `face` when they are equal."""
    bright = opposite = 0.0
    mask = opposite_mask = 0
    for i in range(voltages.shape[0]):
        v = voltages[i]
        # a NaN compares false
        if faces[i] == face and bright < v < READABLE:
            bright, mask = v, 1 << i
        elif faces[i] == face + 1 and opposite < v < READABLE:
            opposite, opposite_mask = v, 1 << i
    if opposite > bright:
        return -opposite, opposite_mask
    return bright, mask
