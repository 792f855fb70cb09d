# SPDX-License-Identifier: Apache-2.0
"""Safe-hold Sun estimator that changes between flat cells and a collared pyramid (Benton, section IV and appendix).

The pyramid carries three cells with orthogonal normals, so its outputs are the Sun vector in a frame of its own. A
collar keeps the light of the Earth from it, and most of the sky: it serves once the panels face the Sun.

    PFMIN   each of its cells reads at least a minimum
    PFCSS   the pyramid gives the Sun vector

PFCSS is set when PFMIN holds and the flat cells too have the Sun near the panel normal: a pyramid that stares at the
lit Earth is so not adopted. It is cleared when PFMIN fails, and for nothing else, as the flat cells err most where the
pyramid is needed. The paper leaves it as it is in the shadow; here it is cleared, so that each sunrise begins with the
flat cells.

Modes are in `safe_hold`: `MODE_PYRAMID` while PFCSS is set; `MODE_PYRAMID_DENIED` while PFMIN holds but not PFCSS.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from css_common.conversions import cosine_of_degrees
from css_common.declared import builder, computed, made, part, table_of
from css_common.kernel import kernel
from css_common.schema import Values, integers, real
from css_common.vectors import Vec3, add, dot, norm, scale, unit, vector_of
from css_estimation.sun import flat_faces, sun_tracking
from css_estimation.sun.cell_layout import READABLE, brightest
from css_estimation.sun.eclipse_detector import detect_eclipse
from css_estimation.sun.flat_faces import FLAT_CELLS, faces_of_cells, flat_heading
from css_estimation.sun.safe_hold import (
    DEFAULTS,
    MODE_FLAT,
    MODE_NO_SUN,
    MODE_PYRAMID,
    MODE_PYRAMID_DENIED,
    CellsVerdict,
    finish_safe_hold,
)
from css_estimation.sun.sun_algorithm import no_memory
from css_estimation.sun.sun_heading import ECLIPSE_SUNLIT, Aiding, SunHeading
from css_estimation.sun.sun_tracking import TrackingParameters, TrackingState, elapsed

_CELLS = integers("pyramid.cells", (), "-", "numbers of its three cells; empty: those with normals along no body axis")
_MINIMUM = real(
    "pyramid.minimum", 0.15, "-", "least output of each of its cells (PFMIN)", low=0.0, high=1.0, tunable=True
)

# Cosine between two normals that still count as orthogonal: outputs and components then differ by 0.1 %.
_ORTHOGONAL = 1e-3


class Pyramid(NamedTuple):
    """Three cells with orthogonal normals."""

    cells: tuple[int, int, int]  # -1: no pyramid
    normals_b: tuple[Vec3, Vec3, Vec3]
    minimum: float


def _pyramid_cells(values: Values) -> list[int]:
    if len(values[_CELLS]):
        return [int(i) for i in values[_CELLS]]
    return np.flatnonzero(faces_of_cells(values) < 0).tolist()


def _pyramid(values: Values) -> Pyramid:
    """The pyramid; without three cells that can be one, which `conflicts` reports, there is none."""
    cells = _pyramid_cells(values)
    if len(cells) != 3 or not all(0 <= i < len(values.cells.normals) for i in cells):
        zero = (0.0, 0.0, 0.0)
        return Pyramid((-1, -1, -1), (zero, zero, zero), values[_MINIMUM])
    a, b, c = (vector_of(values.cells.normals[i]) for i in cells)
    return Pyramid((cells[0], cells[1], cells[2]), (a, b, c), values[_MINIMUM])


def _array_normal(values: Values) -> Vec3:
    return vector_of(values.spacecraft.array_normal)


class PyramidParameters(NamedTuple):
    """All of the estimator."""

    pyramid: Pyramid = computed(_pyramid, _CELLS, _MINIMUM)
    entry_cos: float = made(
        cosine_of_degrees,
        real(
            "pyramid.entry_deg",
            25.0,
            "deg",
            "it is taken while the flat cells have the Sun within this angle of the array normal",
            low=0.0,
            high=180.0,
            tunable=True,
        ),
    )
    faces: np.ndarray = computed(faces_of_cells, FLAT_CELLS)  # (N,) face of each flat cell
    array_normal_b: Vec3 = computed(_array_normal)
    tracking: TrackingParameters = part(TrackingParameters)


PARAMETERS = table_of(PyramidParameters, **DEFAULTS)
parameters = builder(PyramidParameters)


class PyramidState(NamedTuple):
    """Carried from cycle to cycle."""

    adopted: bool  # PFCSS
    tracking: TrackingState


def conflicts(values: Values) -> Iterator[str]:
    """What is wrong between the values, one message each."""
    yield from flat_faces.conflicts(values)
    cells, count = _pyramid_cells(values), len(values.cells.normals)
    if len(cells) != 3 or len(set(cells)) != 3 or not all(0 <= i < count for i in cells):
        yield f"pyramid.cells: cells {cells} of {count}, expected three different ones"
        return
    n = values.cells.normals[cells]
    largest = np.abs(n @ n.T - np.eye(3)).max()
    if largest > _ORTHOGONAL:
        yield f"pyramid.cells: normals of cells {cells} have cosines up to {largest:.3g}, expected orthogonal ones"


initial_memory = no_memory


def initial_state(p: PyramidParameters) -> PyramidState:
    """On the flat cells, no estimate yet."""
    return PyramidState(False, sun_tracking.initial_state())


@kernel
def pyramid_heading(pyramid: Pyramid, voltages) -> tuple[Vec3, bool]:
    """Sun heading (unit, in b) of the pyramid alone, and PFMIN; zeros without it.

    Args:
        voltages: (N,) cell outputs [-].
    """
    sun_b = (0.0, 0.0, 0.0)
    for k in range(3):
        i = pyramid.cells[k]
        # a NaN compares false
        if i < 0 or not pyramid.minimum <= voltages[i] < READABLE:
            return (0.0, 0.0, 0.0), False
        sun_b = add(sun_b, scale(voltages[i], pyramid.normals_b[k]))
    if not norm(sun_b) > 0.0:
        return (0.0, 0.0, 0.0), False
    return unit(sun_b), True


@kernel
def select_cells(p: PyramidParameters, adopted: bool, voltages) -> tuple[bool, CellsVerdict]:
    """PFCSS after this cycle, in sunlight, and what the cells that it chooses say.

    Args:
        adopted: PFCSS of the cycle before.
        voltages: (N,) cell outputs [-].
    """
    sun_b, bright = pyramid_heading(p.pyramid, voltages)
    flat_b, flat_mask = flat_heading(p.faces, voltages)
    near = flat_mask != 0 and dot(flat_b, p.array_normal_b) >= p.entry_cos
    if bright and (adopted or near):
        cells = p.pyramid.cells
        mask = 1 << cells[0] | 1 << cells[1] | 1 << cells[2]
        return True, CellsVerdict(sun_b, mask, MODE_PYRAMID, not adopted)
    mode = MODE_NO_SUN
    if flat_mask != 0:
        mode = MODE_PYRAMID_DENIED if bright else MODE_FLAT
    return False, CellsVerdict(flat_b, flat_mask, mode, adopted)


@kernel
def step(
    p: PyramidParameters,
    state: PyramidState,
    memory: None,
    dt: float,
    voltages,
    aiding: Aiding,
) -> tuple[PyramidState, SunHeading]:
    """One cycle; arguments in `css_estimation.sun.sun_algorithm`."""
    dt = elapsed(dt)
    top = brightest(voltages)
    largest = voltages[top] if top >= 0 else 0.0
    shadow = detect_eclipse(p.tracking.eclipse, state.tracking.eclipse, dt, largest, aiding.sky.predicted)
    adopted, verdict = select_cells(p, state.adopted, voltages)
    tracking, heading = finish_safe_hold(p.tracking, state.tracking, dt, aiding, shadow, verdict)
    return PyramidState(adopted and shadow[1] == ECLIPSE_SUNLIT, tracking), heading
