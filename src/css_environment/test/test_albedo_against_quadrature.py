# SPDX-License-Identifier: Apache-2.0
"""The fast albedo against a fine quadrature of O'Keefe & Schaub 2013, Eq. 17, with sharp edges."""

import math

import numpy as np
import pytest

from css_common.random_streams import random_key
from css_environment.albedo import albedo_output, new_workspace, plane_screen, soft_screen
from css_environment.constants import EARTH_RADIUS
from css_environment.earth_light import albedo_sources, new_earth_view, new_light
from css_environment.reflectivity import draw_reflectivity, zonal_reflectivity

CELL = np.dtype([(name, float) for name in ("nx", "ny", "nz", "side")], align=True)
IDENTITY = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

_AZIMUTHS = np.radians([0, 90, 180, 270])
PYRAMIDS = np.array([[np.cos(a), np.sin(a), z] for z in (1, -1) for a in _AZIMUTHS]) / math.sqrt(2.0)
FACES = np.vstack((np.eye(3), -np.eye(3)))
COLLAR_AXIS = np.array([0.0, -math.sin(math.radians(10)), -math.cos(math.radians(10))])
COLLARED = np.array(
    [
        math.sqrt(2 / 3) * (math.cos(f) * np.array([1.0, 0, 0]) + math.sin(f) * np.cross(COLLAR_AXIS, [1.0, 0, 0]))
        + COLLAR_AXIS / math.sqrt(3)
        for f in np.radians([0, 120, 240])
    ]
)
# Normals, sides of the screen, screen, full cone of view [deg], and the largest error that is allowed.
LAYOUTS = {
    "eight cells behind a body plane": (PYRAMIDS, PYRAMIDS[:, 2], plane_screen((0, 0, 1)), 120.0, 0.005),
    "faces of a box": (FACES, np.zeros(6), plane_screen((0, 0, 0)), 180.0, 0.002),
    "three cells in a collar": (
        COLLARED,
        np.ones(3),
        soft_screen(COLLAR_AXIS, math.radians(28), math.radians(44.9)),
        166.0,
        0.01,
    ),
}


def as_tuples(matrix):
    return tuple(tuple(float(v) for v in row) for row in matrix)


def rotation(rng):
    """Random orthogonal matrix; reflections serve as well here."""
    return np.linalg.qr(rng.normal(size=(3, 3)))[0]


def cells_of(normals, sides):
    cells = np.zeros(len(normals), CELL)
    cells["nx"], cells["ny"], cells["nz"] = np.transpose(normals)
    cells["side"] = sides
    return cells


def earth_patches(r_n, sun_n, dcm_en, reflectivity, circles=200, around=480):
    """Directions from the spacecraft to the lit, visible patches dA, and all factors of Eq. 17 but the cell's."""
    r_n = np.asarray(r_n)
    distance = np.linalg.norm(r_n)
    up = r_n / distance
    x = np.cross(up, np.eye(3)[np.argmin(np.abs(up))])
    x /= np.linalg.norm(x)
    y = np.cross(up, x)
    # Edges of the patches from the point below the spacecraft to the horizon, equidistant in the cosine of emission.
    emission = np.arccos(np.linspace(1.0, 0.0, circles + 1))
    central = emission - np.arcsin(EARTH_RADIUS / distance * np.sin(emission))
    area = EARTH_RADIUS**2 * (np.cos(central[:-1]) - np.cos(central[1:])) * 2.0 * np.pi / around
    middle = (0.5 * (central[1:] + central[:-1]))[:, None, None]
    azimuth = ((np.arange(around) + 0.5) * 2.0 * np.pi / around)[:, None]
    n_a = (np.sin(middle) * (np.cos(azimuth) * x + np.sin(azimuth) * y) + np.cos(middle) * up).reshape(-1, 3)
    area = np.repeat(area, around)
    lit = n_a @ sun_n > 0.0
    n_a, area = n_a[lit], area[lit]
    r_ab = r_n - EARTH_RADIUS * n_a
    length = np.linalg.norm(r_ab, axis=1)
    r_ab /= length[:, None]
    e = n_a @ np.transpose(dcm_en)
    rows, columns = reflectivity.shape
    row = ((np.arcsin(e[:, 2]) / np.pi + 0.5) * rows).astype(int)
    column = ((np.arctan2(e[:, 1], e[:, 0]) / (2.0 * np.pi) + 0.5) * columns).astype(int)
    alpha = reflectivity[np.clip(row, 0, rows - 1), np.clip(column, 0, columns - 1)]
    weight = alpha / np.pi * (n_a @ sun_n) * np.maximum(0.0, np.sum(n_a * r_ab, 1)) * area / length**2
    return -r_ab, weight


def quadrature(directions, weight, layout, dcm_bn):
    normals, sides, screen, view, _ = layout
    d_b = directions @ np.transpose(dcm_bn)
    cosine = d_b @ normals.T
    seen = np.where(cosine >= max(math.cos(math.radians(view / 2)), 0.0), cosine, 0.0)
    along = np.outer(d_b @ screen.axis_b, np.sign(sides))
    if screen.full_cos > screen.dark_cos:
        passed = np.clip((along - screen.dark_cos) / (screen.full_cos - screen.dark_cos), 0.0, 1.0)
    else:
        passed = (along > screen.full_cos).astype(float)
    return weight @ (seen * np.where(sides == 0.0, 1.0, passed))


def geometries(count, seed):
    """Positions 300 to 1000 km high and Suns within the tropics, some of the Earth in view lit by it."""
    rng = np.random.default_rng(seed)
    while count:
        up = rng.normal(size=3)
        up /= np.linalg.norm(up)
        declination, right_ascension = math.radians(rng.uniform(-23.4, 23.4)), rng.uniform(0, 2 * np.pi)
        sun = np.array(
            [
                math.cos(declination) * math.cos(right_ascension),
                math.cos(declination) * math.sin(right_ascension),
                math.sin(declination),
            ]
        )
        r = EARTH_RADIUS + rng.choice([300e3, 400e3, 600e3, 1000e3])
        if up @ sun > -math.sqrt(1.0 - (EARTH_RADIUS / r) ** 2) + 0.02:
            count -= 1
            yield r * up, sun, rng


class FastAlbedo:
    def __init__(self):
        self.view, self.light, self.work = new_earth_view(), new_light(), new_workspace()

    def look(self, r_n, sun_n, reflectivity, dcm_en=IDENTITY, flux=1.0):
        r_n, sun_n = as_tuples([r_n, sun_n])
        albedo_sources(self.view, r_n, sun_n, flux, as_tuples(dcm_en), reflectivity, self.light)
        return self

    def output(self, layout, dcm_bn):
        normals, sides, screen, view, _ = layout
        output = np.full(len(normals), np.nan)
        cos_half_view = math.cos(math.radians(view / 2))
        albedo_output(self.light, cells_of(normals, sides), screen, cos_half_view, as_tuples(dcm_bn), self.work, output)
        return output


@pytest.mark.parametrize("name", LAYOUTS)
def test_every_cell_at_random_attitudes(name):
    layout = LAYOUTS[name]
    reflectivity = zonal_reflectivity(1).mean
    fast = FastAlbedo()
    brightest = 0.0
    for r_n, sun_n, rng in geometries(12, seed=21):
        directions, weight = earth_patches(r_n, sun_n, IDENTITY, reflectivity)
        fast.look(r_n, sun_n, reflectivity)
        for _ in range(4):
            dcm_bn = rotation(rng)
            expected = quadrature(directions, weight, layout, dcm_bn)
            brightest = max(brightest, expected.max())
            np.testing.assert_allclose(fast.output(layout, dcm_bn), expected, atol=layout[-1])
    assert brightest > 0.05


def test_reflectivities_drawn_for_each_cell_of_the_grid():
    """Neighbouring grid cells differ by up to 0.9: what is smaller than a patch must still be weighed."""
    layout = LAYOUTS["faces of a box"]
    grid = zonal_reflectivity()
    reflectivity = np.empty_like(grid.mean)
    fast = FastAlbedo()
    for case, (r_n, sun_n, rng) in enumerate(geometries(8, seed=22)):
        draw_reflectivity(grid, random_key(5, case), False, reflectivity)
        dcm_en, dcm_bn = rotation(rng), rotation(rng)
        directions, weight = earth_patches(r_n, sun_n, dcm_en, reflectivity)
        expected = quadrature(directions, weight, layout, dcm_bn)
        np.testing.assert_allclose(
            fast.look(r_n, sun_n, reflectivity, dcm_en).output(layout, dcm_bn), expected, atol=0.003
        )


def test_turning_slowly_makes_no_jumps():
    """Patches fade in and out of view: a step of 0.1 deg never moves an output by more than it can in truth."""
    layout = LAYOUTS["eight cells behind a body plane"]
    fast = FastAlbedo()
    r_n, sun_n, rng = next(geometries(1, seed=23))
    fast.look(r_n, sun_n, np.full((1, 1), 0.8))
    start, axis = rotation(rng), np.array([0.36, 0.48, 0.8])
    skew = np.cross(np.eye(3), axis)
    turns = np.arange(0.0, 2.0 * np.pi, math.radians(0.1))
    outputs = []
    for angle in turns:
        turn = np.eye(3) + math.sin(angle) * skew + (1.0 - math.cos(angle)) * skew @ skew
        outputs.append(fast.output(layout, turn @ start))
    assert np.abs(np.diff(outputs, axis=0)).max() < 0.8 * math.radians(0.1)
