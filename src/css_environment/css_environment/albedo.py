# SPDX-License-Identifier: Apache-2.0
"""Sunlight that the Earth reflects onto the cells of a spacecraft (O'Keefe & Schaub 2013, Eq. 17).

`earth_light.albedo_sources` reduces the sunlit Earth to 32 patches of light, once per instant for all cells and all
cases. `albedo_output` sums them for each cell of one attitude, within the cell's cone of view and on its side of a
screen. Light and mean direction of a patch make the sum exact for patches that a cell sees whole. One that is cut
by the edge of the cone or of the screen is taken as evenly bright over its size and cut in proportion, so that
outputs change smoothly with attitude and few patches are enough.

Largest and root-mean-square error of any cell against a fine quadrature of Eq. 17 with sharp edges, at random
attitudes and places 300 to 1000 km high, terminator included (full scale is 1, brightest output 0.32):

    cells and reflectivity                                                        largest   rms
    eight, 45 deg from z, 120 deg full view, body plane z; zonal means            0.0018    0.0006
    the same with each 5 deg grid cell drawn for itself                           0.0034    0.0010
    the same with 0.3 everywhere                                                  0.0020    0.0007
    faces of a box, 180 deg full view, no plane; zonal means                      0.0004    0.0001
    the same with each 5 deg grid cell drawn for itself                           0.0028    0.0007
    three behind an edge of 28 to 44.9 deg, 166 deg view;   zonal means           0.0043    0.0007

Errors are in proportion to the reflectivity. Eight cells take 0.16 us on one 2.5 GHz core.
"""

import math
from typing import NamedTuple

import numpy as np

from css_common.direction_grid import grid_cell
from css_common.kernel import kernel
from css_common.vectors import Mat3, Vec3, dot, multiply, multiply_transposed, scale, unit
from css_environment.earth_light import (
    DISC,
    DISC_COS,
    DISC_LIGHT,
    DISC_SIN,
    LIGHT,
    PATCHES,
    SIZE,
    X,
    Y,
    Z,
    aligned_rows,
)

# Single precision: seven digits are plenty for a sum good to three, and twice as many fit into a vector register.
_F = np.float32
_ZERO, _HALF, _ONE = _F(0.0), _F(0.5), _F(1.0)

# Rows of the workspace. For cells free of the screen, on its positive and on its negative side: light of each patch
# that passes the screen, and in the next row how far the cut moves the patch along the (mirrored) axis.
_FREE, _POSITIVE, _NEGATIVE = 0, 2 * PATCHES, 4 * PATCHES
_TERMS = 6 * PATCHES

# A cone narrower than the patches would need finer ones; its edge is not softened below this sine.
NARROWEST_SIN = 0.05


_SAME_VIEW = np.zeros(0)
_FREE_SKY = np.zeros(0, np.uint32)


class Screen(NamedTuple):
    """What hides part of the sky from cells: structure beyond an angle to an axis, structure anywhere, narrow views.

    A cell whose `side` is positive receives all of the light from directions whose cosine to the axis is at least
    `full_cos`, none below `dark_cos`, a linear part between. If `side` is negative the axis is mirrored; if zero
    nothing is hidden.

    `views` has the cosine of half the view of each cell (N,), where they are not all alike. `blocked` has for each cell
    of the grid of `css_common.direction_grid` a mask of the cells that see nothing there; both are empty where there is
    no such thing. A patch of the Earth's light is hidden when the middle of it is.
    """

    axis_b: Vec3  # unit vector, or zeros: no screen
    dark_cos: float
    full_cos: float
    views: np.ndarray = _SAME_VIEW
    blocked: np.ndarray = _FREE_SKY


def plane_screen(normal_b) -> Screen:
    """Body plane that hides the half space beyond it from each cell, with a sharp edge; zeros: no screen."""
    x, y, z = (float(c) for c in normal_b)
    return Screen((x, y, z), 0.0, 0.0)


def soft_screen(axis_b, full_angle: float, dark_angle: float) -> Screen:
    """Screen with a linear edge: all light within `full_angle` [rad] of an axis, none beyond `dark_angle`."""
    x, y, z = (float(c) for c in axis_b)
    return Screen((x, y, z), math.cos(dark_angle), math.cos(full_angle))


def new_workspace() -> np.ndarray:
    """Room for `albedo_output` to work in, (224,) float32; each thread needs its own."""
    return aligned_rows(7)


def with_views(screen: Screen, views: np.ndarray, blocked: np.ndarray) -> Screen:
    """The screen with the views of single cells and what is blocked from them; empty: as without."""
    views = np.ascontiguousarray(views, dtype=np.float64) if len(views) else _SAME_VIEW
    blocked = np.ascontiguousarray(blocked, dtype=np.uint32) if len(blocked) else _FREE_SKY
    return screen._replace(views=views, blocked=blocked)


@kernel
def view_cosine(screen: Screen, i: int, of_all: float) -> float:
    """Cosine of half the view of cell `i`, which is `of_all` where the views are alike."""
    return screen.views[i] if screen.views.shape[0] > 0 else of_all


@kernel
def is_blocked(screen: Screen, i: int, direction_b: Vec3) -> bool:
    """Whether structure is in front of cell `i` in a unit direction."""
    if screen.blocked.shape[0] == 0:
        return False
    return (int(screen.blocked[grid_cell(direction_b)]) >> i) & 1 != 0


@kernel
def transmission(screen: Screen, side: float, direction_b: Vec3) -> float:
    """Part of the light of a point source that a screen lets pass to a cell of the given side, 0 to 1."""
    if side == 0.0 or dot(screen.axis_b, screen.axis_b) == 0.0:
        return 1.0
    cosine = dot(screen.axis_b, direction_b) * (1.0 if side > 0.0 else -1.0)
    if cosine >= screen.full_cos:
        return 1.0
    if cosine <= screen.dark_cos:
        return 0.0
    return (cosine - screen.dark_cos) / (screen.full_cos - screen.dark_cos)


class SoftEdges(NamedTuple):
    """Where the view of one cell ends: at the edge of its cone and at a screen.

    Attributes:
        edge_sin: sine of half the cone.
        hidden: a screen hides part of the sky.
        axis_b: of the screen, towards what the cell sees; a cell on its other side has it mirrored, with the same edge.
        shift: cosine between normal and axis.
        middle, ramp: cosine in the middle of the screen's edge, and half of what the edge takes.
        screen_sin: sine there.
    """

    edge_sin: float
    hidden: bool
    axis_b: Vec3
    shift: float
    middle: float
    ramp: float
    screen_sin: float


@kernel
def soft_edges(normal_b: Vec3, side: float, screen: Screen, edge: float) -> SoftEdges:
    """Edges of the view of a cell, whose half cone has the cosine `edge`."""
    axis_b = scale(1.0 if side > 0.0 else -1.0, screen.axis_b)
    middle = 0.5 * (screen.full_cos + screen.dark_cos)
    return SoftEdges(
        max(NARROWEST_SIN, math.sqrt(max(0.0, 1.0 - edge * edge))),
        side != 0.0 and dot(screen.axis_b, screen.axis_b) > 0.0,
        axis_b,
        dot(normal_b, axis_b),
        middle,
        0.5 * (screen.full_cos - screen.dark_cos),
        math.sqrt(max(0.0, 1.0 - middle * middle)),
    )


@kernel
def _output_of_one(light, normal_b: Vec3, side: float, i: int, screen: Screen, edge: float, dcm_bn: Mat3) -> float:
    """The same sum as of `albedo_output` for a cell with a view of its own, patch by patch."""
    edges = soft_edges(normal_b, side, screen, edge)
    edge_sin, axis_b, middle, ramp = edges.edge_sin, edges.axis_b, edges.middle, edges.ramp
    total = 0.0
    for j in range(PATCHES):
        if not light[LIGHT + j] > 0.0:
            continue
        direction_b = multiply(dcm_bn, (float(light[X + j]), float(light[Y + j]), float(light[Z + j])))
        if is_blocked(screen, i, unit(direction_b)):
            continue
        part, moved = 1.0, 0.0
        if edges.hidden:
            size2 = (float(light[SIZE + j]) * edges.screen_sin) ** 2
            inverse = 1.0 / math.sqrt(size2 + ramp * ramp)
            part = min(max(0.5 + 0.5 * (dot(axis_b, direction_b) - middle) * inverse, 0.0), 1.0)
            moved = (1.0 - part) * size2 * inverse
        mean, width = dot(normal_b, direction_b) + moved * edges.shift, float(light[SIZE + j]) * edge_sin
        high = mean + width
        low = min(max(mean - width, edge), high)
        total += part * float(light[LIGHT + j]) * (high - low) * (high + low)
    return total / edge_sin


@kernel
def albedo_output(light, cells, screen: Screen, cos_half_view: float, dcm_bn: Mat3, work, output) -> None:
    """Light of the Earth that each cell receives [-], 1.0 being the Sun at normal incidence at 1 AU.

    Args:
        light: patches from `earth_light.albedo_sources`.
        cells: (N,) records with the fields nx, ny, nz (outward unit normal in b) and side (see `Screen`).
        screen: what hides part of the sky.
        cos_half_view: cosine of half the full cone of view, 0 to 1, of cells that have none of their own.
        dcm_bn: rotation from n to b.
        work: room from `new_workspace`.
        output: (N,) written.
    """
    if light[DISC + DISC_LIGHT] <= 0.0:
        for i in range(output.shape[0]):
            output[i] = 0.0
        return
    if screen.views.shape[0] > 0 or screen.blocked.shape[0] > 0:
        for i in range(output.shape[0]):
            cell, edge_cos = cells[i], view_cosine(screen, i, cos_half_view)
            normal_b = (float(cell.nx), float(cell.ny), float(cell.nz))
            output[i] = _output_of_one(light, normal_b, float(cell.side), i, screen, edge_cos, dcm_bn)
        return
    nadir_n = (float(light[DISC]), float(light[DISC + 1]), float(light[DISC + 2]))
    sin_half_view = math.sqrt(max(0.0, 1.0 - cos_half_view * cos_half_view))
    # Cells that look away from nadir by more than half their view and half the Earth's see nothing of it.
    reach_cos = cos_half_view * light[DISC + DISC_COS] - sin_half_view * light[DISC + DISC_SIN]
    edge_sin = max(NARROWEST_SIN, sin_half_view)

    # What passes the screen to cells on either side. All loops over patches stand in this one function: apart, each
    # call would count references to its arrays, which takes longer than the arithmetic.
    axis_n = multiply_transposed(dcm_bn, screen.axis_b)
    has_screen = dot(axis_n, axis_n) > 0.0
    ax, ay, az = _F(axis_n[0]), _F(axis_n[1]), _F(axis_n[2])
    middle_cos = 0.5 * (screen.full_cos + screen.dark_cos)
    screen_sin = _F(math.sqrt(max(0.0, 1.0 - middle_cos * middle_cos)))
    ramp = _F(0.5 * (screen.full_cos - screen.dark_cos))
    middle = _F(middle_cos)
    for j in range(PATCHES):
        cosine = light[X + j] * ax + light[Y + j] * ay + light[Z + j] * az
        size = light[SIZE + j] * screen_sin
        size2 = size * size
        inverse = _ONE / np.sqrt(size2 + ramp * ramp)
        part = min(max(_HALF + _HALF * (cosine - middle) * inverse, _ZERO), _ONE)
        work[_POSITIVE + j] = light[LIGHT + j] * part
        work[_POSITIVE + PATCHES + j] = (_ONE - part) * size2 * inverse
        part = min(max(_HALF - _HALF * (cosine + middle) * inverse, _ZERO), _ONE)
        work[_NEGATIVE + j] = light[LIGHT + j] * part
        work[_NEGATIVE + PATCHES + j] = (_ONE - part) * size2 * inverse
        work[_FREE + j] = light[LIGHT + j]
        work[_FREE + PATCHES + j] = _ZERO

    # A patch spreads over cosines mean - width to mean + width; those above the edge of the cone count.
    edge, spread = _F(cos_half_view), _F(edge_sin)
    for i in range(output.shape[0]):
        normal_n = multiply_transposed(dcm_bn, (cells[i].nx, cells[i].ny, cells[i].nz))
        output[i] = 0.0
        if dot(normal_n, nadir_n) > reach_cos:
            x, y, z = _F(normal_n[0]), _F(normal_n[1]), _F(normal_n[2])
            side = cells[i].side if has_screen else 0.0
            shift = _F(dot(normal_n, axis_n))
            if side < 0.0:
                shift = -shift
            for j in range(PATCHES):
                if side > 0.0:
                    passed, moved = work[_POSITIVE + j], work[_POSITIVE + PATCHES + j]
                elif side < 0.0:
                    passed, moved = work[_NEGATIVE + j], work[_NEGATIVE + PATCHES + j]
                else:
                    passed, moved = work[_FREE + j], work[_FREE + PATCHES + j]
                mean = light[X + j] * x + light[Y + j] * y + light[Z + j] * z + moved * shift
                width = light[SIZE + j] * spread
                high = mean + width
                low = min(max(mean - width, edge), high)
                work[_TERMS + j] = passed * (high - low) * (high + low)
            # The terms are added apart, in a fixed order: a sum inside the loop would keep it from vector instructions.
            a, b, c, d = _ZERO, _ZERO, _ZERO, _ZERO
            for j in range(0, PATCHES, 4):
                a += work[_TERMS + j]
                b += work[_TERMS + j + 1]
                c += work[_TERMS + j + 2]
                d += work[_TERMS + j + 3]
            total = (a + b) + (c + d)
            output[i] = float(total) / edge_sin
