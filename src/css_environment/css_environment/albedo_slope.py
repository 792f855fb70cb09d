# SPDX-License-Identifier: Apache-2.0
"""How the light of the Earth on each cell changes as the body turns: derivatives of `albedo.albedo_output`.

Turned by a small rotation vector dtheta (in b), the body sees a patch in direction d at d - dtheta x d. Of the light
that a cell with normal n takes from patch j, only the cosines n.d and a.d change, with the screen's axis a, so that

    d output / d dtheta = n x sum_j (dL_j / d(n.d_j)) d_j + a x sum_j (dL_j / d(a.d_j)) d_j,

with the derivatives of the patches' soft edges in closed form.
"""

import math

from css_common.kernel import kernel
from css_common.vectors import Mat3, Vec3, add, cross, dot, multiply, scale, unit
from css_environment.albedo import Screen, is_blocked, soft_edges, view_cosine
from css_environment.earth_light import DISC, DISC_LIGHT, LIGHT, PATCHES, SIZE, X, Y, Z


@kernel
def albedo_slopes(light, cells, screen: Screen, cos_half_view: float, dcm_bn: Mat3, slopes) -> None:
    """Derivative of each cell's light of the Earth to a turn of the body [1/rad].

    Args:
        light, cells, screen, cos_half_view, dcm_bn: as of `albedo.albedo_output`.
        slopes: (N, 3) written; of a rotation vector in b, A = (I - [dtheta x]) dcm_bn.
    """
    dark = light[DISC + DISC_LIGHT] <= 0.0
    for i in range(slopes.shape[0]):
        slope = (0.0, 0.0, 0.0)
        if not dark:
            cell = cells[i]
            normal_b = (float(cell.nx), float(cell.ny), float(cell.nz))
            edge = view_cosine(screen, i, cos_half_view)
            slope = _slope(light, normal_b, float(cell.side), i, screen, edge, dcm_bn)
        for k in range(3):
            slopes[i, k] = slope[k]


@kernel
def _slope(light, normal_b: Vec3, side: float, i: int, screen: Screen, edge: float, dcm_bn: Mat3) -> Vec3:
    edges = soft_edges(normal_b, side, screen, edge)
    edge_sin, axis_b, shift, middle, ramp = edges.edge_sin, edges.axis_b, edges.shift, edges.middle, edges.ramp
    by_normal, by_axis = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for j in range(PATCHES):
        direction_n = (float(light[X + j]), float(light[Y + j]), float(light[Z + j]))
        direction_b = multiply(dcm_bn, direction_n)
        width = float(light[SIZE + j]) * edge_sin
        part, part_slope, moved, moved_slope = 1.0, 0.0, 0.0, 0.0
        if edges.hidden:
            size2 = (float(light[SIZE + j]) * edges.screen_sin) ** 2
            inverse = 1.0 / math.sqrt(size2 + ramp * ramp)
            free = 0.5 + 0.5 * (dot(axis_b, direction_b) - middle) * inverse
            part = min(max(free, 0.0), 1.0)
            part_slope = 0.5 * inverse if 0.0 < free < 1.0 else 0.0
            moved = (1.0 - part) * size2 * inverse
            moved_slope = -part_slope * size2 * inverse
        mean = dot(normal_b, direction_b) + moved * shift
        high = mean + width
        if high <= edge:
            continue
        if screen.blocked.shape[0] > 0 and light[LIGHT + j] > 0.0 and is_blocked(screen, i, unit(direction_b)):
            continue
        low = max(mean - width, edge)
        brightness = float(light[LIGHT + j]) / edge_sin
        by_mean = 2.0 * brightness * (high - (low if mean - width > edge else 0.0))
        by_normal = add(by_normal, scale(part * by_mean, direction_b))
        screened = part_slope * brightness * (high * high - low * low) + part * by_mean * moved_slope * shift
        by_axis = add(by_axis, scale(screened, direction_b))
    return add(cross(normal_b, by_normal), cross(axis_b, by_axis))
