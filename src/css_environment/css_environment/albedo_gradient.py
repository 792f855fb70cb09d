# SPDX-License-Identifier: Apache-2.0
"""Light of the Earth on cells and how it changes with attitude, in closed form, for filters that estimate attitude.

The sum is that of `albedo.albedo_output`, patch by patch and cut at the same edges. A cell's output depends on attitude
through its normal alone, but for the screen: where that cuts a patch, what the cut takes away changes with attitude
too, which is left out of the gradient. Values agree with `albedo_output` to single precision but where a screen cuts a
patch: what the cut moves is left out as well, at most 0.005 of full scale.
"""

import math

from css_common.kernel import kernel
from css_common.vectors import Mat3, dot, multiply_transposed
from css_environment.albedo import NARROWEST_SIN, Screen
from css_environment.earth_light import DISC, DISC_COS, DISC_LIGHT, DISC_SIN, LIGHT, PATCHES, SIZE, X, Y, Z


@kernel
def albedo_gradient(light, cells, screen: Screen, cos_half_view: float, dcm_bn: Mat3, out) -> None:
    """Light that each cell receives [-] and its gradient by the cell's normal in n.

    Args:
        light, cells, screen, cos_half_view, dcm_bn: as of `albedo.albedo_output`.
        out: (N, 4) written: light, and the three components of the gradient.
    """
    for i in range(out.shape[0]):
        for j in range(4):
            out[i, j] = 0.0
    if light[DISC + DISC_LIGHT] <= 0.0:
        return
    nadir_n = (float(light[DISC]), float(light[DISC + 1]), float(light[DISC + 2]))
    sin_half_view = math.sqrt(max(0.0, 1.0 - cos_half_view * cos_half_view))
    reach_cos = cos_half_view * light[DISC + DISC_COS] - sin_half_view * light[DISC + DISC_SIN]
    edge_sin = max(NARROWEST_SIN, sin_half_view)
    axis_n = multiply_transposed(dcm_bn, screen.axis_b)
    has_screen = dot(axis_n, axis_n) > 0.0
    ramp = 0.5 * (screen.full_cos - screen.dark_cos)
    middle = 0.5 * (screen.full_cos + screen.dark_cos)
    screen_sin = math.sqrt(max(0.0, 1.0 - middle * middle))
    for i in range(out.shape[0]):
        normal_n = multiply_transposed(dcm_bn, (cells[i].nx, cells[i].ny, cells[i].nz))
        if dot(normal_n, nadir_n) <= reach_cos:
            continue
        side = cells[i].side if has_screen else 0.0
        sign = 1.0 if side > 0.0 else -1.0
        value = gx = gy = gz = 0.0
        for j in range(PATCHES):
            x, y, z = float(light[X + j]), float(light[Y + j]), float(light[Z + j])
            mean = x * normal_n[0] + y * normal_n[1] + z * normal_n[2]
            width = float(light[SIZE + j]) * edge_sin
            high = mean + width
            if high <= cos_half_view:
                continue
            passed = float(light[LIGHT + j])
            if side != 0.0:
                cosine = sign * (x * axis_n[0] + y * axis_n[1] + z * axis_n[2])
                size = float(light[SIZE + j]) * screen_sin
                soft = math.sqrt(size * size + ramp * ramp)
                passed *= min(max(0.5 + 0.5 * (cosine - middle) / soft, 0.0), 1.0)
            if mean - width >= cos_half_view:
                value += passed * 4.0 * mean * width
                slope = passed * 4.0 * width
            else:
                value += passed * (high * high - cos_half_view * cos_half_view)
                slope = passed * 2.0 * high
            gx += slope * x
            gy += slope * y
            gz += slope * z
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = value / edge_sin, gx / edge_sin, gy / edge_sin, gz / edge_sin
