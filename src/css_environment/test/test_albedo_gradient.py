# SPDX-License-Identifier: Apache-2.0
"""The gradient of the Earth's light against the sum that studies use, and against finite differences."""

import numpy as np
import pytest

from css_common.attitude import rotation_vector_to_dcm
from css_common.matrices import IDENTITY
from css_common.vectors import matmul
from css_environment.albedo import albedo_output, new_workspace, plane_screen
from css_environment.albedo_gradient import albedo_gradient
from css_environment.earth_light import albedo_sources, new_earth_view, new_light

CELL = np.dtype([(name, np.float64) for name in ("nx", "ny", "nz", "side")], align=True)
FACES = np.vstack([np.eye(3), -np.eye(3)])
PYRAMIDS = np.array([(x, y, z) for z in (1, -1) for x, y in ((1, 0), (0, 1), (-1, 0), (0, -1))]) / np.sqrt(2.0)
STEP = 1e-3  # [rad] large enough for sums in single precision


def cells_of(normals, side=0.0):
    cells = np.zeros(len(normals), CELL)
    cells["nx"], cells["ny"], cells["nz"] = np.asarray(normals).T
    cells["side"] = side
    return cells


def light_at(sun_angle_deg):
    """Light of a uniform Earth below a spacecraft 500 km high on the x axis."""
    light, angle = new_light(), np.radians(sun_angle_deg)
    sun_n = (np.cos(angle), np.sin(angle), 0.0)
    albedo_sources(new_earth_view(), (6.878e6, 0.0, 0.0), sun_n, 1.0, IDENTITY, np.full((36, 72), 0.4), light)
    return light


def attitudes(count):
    dice = np.random.default_rng(5)
    return [rotation_vector_to_dcm(tuple(dice.normal(0.0, 2.0, 3))) for _ in range(count)]


def values(light, cells, screen, cos_half_view, dcm_bn):
    out = np.zeros((len(cells), 4))
    albedo_gradient(light, cells, screen, cos_half_view, dcm_bn, out)
    return out


@pytest.mark.parametrize("sun_angle_deg", [0.0, 60.0, 95.0])
@pytest.mark.parametrize(("normals", "cos_half_view"), [(FACES, 0.0), (PYRAMIDS, 0.5)])
def test_light_is_that_of_the_sum(sun_angle_deg, normals, cos_half_view):
    light, cells, screen = light_at(sun_angle_deg), cells_of(normals), plane_screen((0.0, 0.0, 0.0))
    output = np.zeros(len(cells))
    for dcm_bn in attitudes(50):
        albedo_output(light, cells, screen, cos_half_view, dcm_bn, new_workspace(), output)
        assert values(light, cells, screen, cos_half_view, dcm_bn)[:, 0] == pytest.approx(output, abs=2e-6)


def test_what_a_body_plane_hides_is_cut_as_in_the_sum():
    light, screen = light_at(40.0), plane_screen((0.0, 0.0, 1.0))
    cells = cells_of(PYRAMIDS, PYRAMIDS[:, 2])
    output = np.zeros(len(cells))
    for dcm_bn in attitudes(200):
        albedo_output(light, cells, screen, 0.5, dcm_bn, new_workspace(), output)
        assert values(light, cells, screen, 0.5, dcm_bn)[:, 0] == pytest.approx(output, abs=6e-3)


@pytest.mark.parametrize(("normals", "cos_half_view"), [(FACES, 0.0), (PYRAMIDS, 0.5)])
def test_the_gradient_is_the_change_with_the_normal(normals, cos_half_view):
    light, cells, screen = light_at(50.0), cells_of(normals), plane_screen((0.0, 0.0, 0.0))
    for dcm_bn in attitudes(30):
        out = values(light, cells, screen, cos_half_view, dcm_bn)
        normals_n = normals @ np.array(dcm_bn)
        for axis in np.eye(3):
            theta = tuple(STEP * axis)
            # dcm_bn (1 - [theta x]) and its inverse: normals in n turn by theta
            ahead = values(light, cells, screen, cos_half_view, matmul(dcm_bn, rotation_vector_to_dcm(theta)))
            behind = values(
                light, cells, screen, cos_half_view, matmul(dcm_bn, rotation_vector_to_dcm(tuple(-STEP * axis)))
            )
            change = (ahead[:, 0] - behind[:, 0]) / (2.0 * STEP)
            expected = np.einsum("ij,ij->i", out[:, 1:], np.cross(axis, normals_n))
            assert change == pytest.approx(expected, abs=5e-3)


def test_no_sunlit_earth_gives_nothing():
    dark = light_at(150.0)
    assert not values(dark, cells_of(FACES), plane_screen((0.0, 0.0, 0.0)), 0.0, IDENTITY).any()
