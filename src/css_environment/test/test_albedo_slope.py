# SPDX-License-Identifier: Apache-2.0
"""Slopes of the light of the Earth in closed form against differences of the light itself."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from css_common.attitude import rotation_vector_to_dcm
from css_common.vectors import mat3
from css_environment.albedo import albedo_output, new_workspace, plane_screen, soft_screen
from css_environment.albedo_slope import albedo_slopes
from css_environment.constants import EARTH_RADIUS
from css_environment.earth_light import albedo_sources, new_earth_view, new_light
from css_environment.reflectivity import zonal_reflectivity

CELL = np.dtype([(name, np.float64) for name in ("nx", "ny", "nz", "side")], align=True)
STEP = 3e-4
"""Large enough for the single precision of the light, small against the patches."""


@pytest.fixture(scope="module")
def light():
    """Above 30 deg of latitude with the Sun 50 deg from the zenith: the terminator is in sight."""
    light = new_light()
    r_n = (EARTH_RADIUS + 400e3) * np.array([np.cos(0.5), 0.0, np.sin(0.5)])
    sun_n = (float(np.cos(1.4)), 0.0, float(np.sin(1.4)))
    identity = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    albedo_sources(new_earth_view(), tuple(r_n.tolist()), sun_n, 1.0, identity, zonal_reflectivity(1).mean, light)
    return light


def cells_of(normals, sides):
    cells = np.zeros(len(normals), CELL)
    for name, column in zip(("nx", "ny", "nz"), np.asarray(normals, float).T, strict=True):
        cells[name] = column
    cells["side"] = sides
    return cells


FACES = cells_of(np.vstack([np.eye(3), -np.eye(3)]), 0.0)
R = np.sqrt(0.5)
PYRAMIDS = cells_of([(R, 0, R), (0, R, R), (-R, 0, R), (0, -R, R), (R, 0, -R), (0, R, -R)], [1, 1, 1, 1, -1, -1])


@pytest.mark.parametrize(
    ("cells", "screen", "half_view_deg"),
    [
        (FACES, plane_screen((0.0, 0.0, 0.0)), 90.0),
        (PYRAMIDS, plane_screen((0.0, 0.0, 1.0)), 60.0),
        (PYRAMIDS, soft_screen((0.0, 0.0, 1.0), np.radians(60.0), np.radians(80.0)), 83.0),
    ],
    ids=["faces of a box", "behind a plane", "behind a soft edge"],
)
def test_slopes_are_those_of_the_light(light, cells, screen, half_view_deg):
    work, slopes = new_workspace(), np.zeros((len(cells), 3))
    edge = float(np.cos(np.radians(half_view_deg)))
    rng = np.random.default_rng(1)
    off, size = [], []
    for _ in range(40):
        dcm = Rotation.random(random_state=rng).as_matrix()

        def output(turn, dcm=dcm):
            out = np.zeros(len(cells))
            turned = np.array(rotation_vector_to_dcm(tuple(turn))) @ dcm
            albedo_output(light, cells, screen, edge, mat3(turned), work, out)
            return out

        albedo_slopes(light, cells, screen, edge, mat3(dcm), slopes)
        steps = STEP * np.eye(3)
        numeric = np.stack([(output(step) - output(-step)) / (2.0 * STEP) for step in steps], axis=1)
        off.append(slopes - numeric)
        size.append(numeric)
    assert np.sqrt(np.mean(np.square(size))) > 0.015
    # soft edges have corners, where a difference lies between the slopes on both sides
    assert np.sqrt(np.mean(np.square(off))) < 0.01 * np.sqrt(np.mean(np.square(size)))
    assert np.abs(off).max() < 0.01


def test_a_dark_earth_has_no_slopes():
    slopes = np.ones((6, 3))
    identity = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    albedo_slopes(new_light(), FACES, plane_screen((0.0, 0.0, 0.0)), 0.0, identity, slopes)
    assert not slopes.any()
