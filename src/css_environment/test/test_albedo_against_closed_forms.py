# SPDX-License-Identifier: Apache-2.0
"""Albedo against closed forms of a Lambert sphere, its symmetries, and the figures of the paper."""

import math

import numpy as np
import pytest
from celestial import orbit_period
from scipy.integrate import quad

from css_common.vectors import mat3
from css_environment.albedo import Screen, albedo_output, new_workspace, plane_screen, soft_screen, transmission
from css_environment.constants import EARTH_RADIUS
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
    albedo_sources,
    gather_light,
    look_at_earth,
    new_earth_view,
    new_light,
    write_patch,
)
from css_environment.ephemeris import at, build_ephemeris
from css_environment.orbit import keplerian_orbit
from css_environment.reflectivity import zonal_reflectivity

CELL = np.dtype([(name, float) for name in ("nx", "ny", "nz", "side")], align=True)
IDENTITY = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
NO_SCREEN = plane_screen((0.0, 0.0, 0.0))
WHITE = np.ones((1, 1))
EPOCH_NS = 1_370_044_800 * 10**9


def cells_of(normals, sides=0.0):
    cells = np.zeros(len(normals), CELL)
    cells["nx"], cells["ny"], cells["nz"] = np.transpose(normals)
    cells["side"] = sides
    return cells


def light_from(r_n, sun_n, reflectivity=WHITE, flux=1.0):
    light = new_light()
    albedo_sources(new_earth_view(), tuple(r_n), tuple(sun_n), flux, IDENTITY, reflectivity, light)
    return light


def output(light, normals, sides=0.0, screen=NO_SCREEN, cos_half_view=0.0, dcm_bn=IDENTITY):
    result = np.full(len(normals), np.nan)
    albedo_output(light, cells_of(normals, sides), screen, cos_half_view, dcm_bn, new_workspace(), result)
    return result


def sun_at(zenith_angle_deg):
    a = math.radians(zenith_angle_deg)
    return (math.sin(a), 0.0, math.cos(a))


@pytest.mark.parametrize("altitude", [300e3, 475e3, 1000e3])
@pytest.mark.parametrize("zenith_angle", [0.0, 30.0, 59.0])
def test_plate_facing_a_fully_lit_earth(altitude, zenith_angle):
    """With all of the disc lit, only the vertical part of n_A counts: one integral over the angle of emission."""
    r = EARTH_RADIUS + altitude
    k = EARTH_RADIUS / r
    assert zenith_angle < 90.0 - math.degrees(math.acos(k))
    integral, _ = quad(lambda m: 2 * k * k * m * (m * math.sqrt(1 - k * k * (1 - m * m)) + k * (1 - m * m)), 0, 1)
    light = light_from((0.0, 0.0, r), sun_at(zenith_angle))
    expected = math.cos(math.radians(zenith_angle)) * integral
    assert output(light, [[0.0, 0.0, -1.0]])[0] == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize(
    ("zenith_angle", "magnitude"), [(0, 0.862), (30, 0.747), (60, 0.433), (68, 0.326), (75, 0.228)]
)
def test_vector_sum_of_the_light(zenith_angle, magnitude):
    """Irradiance vector over a white Earth at 475 km; opposite plates differ by its component."""
    light = light_from((0.0, 0.0, EARTH_RADIUS + 475e3), sun_at(zenith_angle))
    plates = output(light, np.vstack((np.eye(3), -np.eye(3))))
    assert np.linalg.norm(plates[:3] - plates[3:]) == pytest.approx(magnitude, abs=2e-3)


@pytest.mark.parametrize("phase_deg", [0.0, 45.0, 90.0, 135.0])
def test_from_far_away_the_earth_is_a_lambert_sphere(phase_deg):
    """Phase function (sin p + (pi - p) cos p) / pi and geometric albedo 2/3 (Russell 1916)."""
    distance = 300.0 * EARTH_RADIUS
    p = math.radians(phase_deg)
    light = light_from((0.0, 0.0, distance), sun_at(phase_deg))
    expected = 2.0 / 3.0 * (EARTH_RADIUS / distance) ** 2 * (math.sin(p) + (math.pi - p) * math.cos(p)) / math.pi
    assert output(light, [[0.0, 0.0, -1.0]])[0] == pytest.approx(expected, rel=0.01)


def test_no_light_where_no_sunlit_earth_is_in_view():
    r = EARTH_RADIUS + 400e3
    beyond = 90.0 + math.degrees(math.acos(EARTH_RADIUS / r))
    before, after = light_from((0, 0, r), sun_at(beyond - 3.0)), light_from((0, 0, r), sun_at(beyond + 0.01))
    assert before[DISC + DISC_LIGHT] > 0.0
    assert after[DISC + DISC_LIGHT] == 0.0
    assert np.all(output(after, np.vstack((np.eye(3), -np.eye(3)))) == 0.0)


def test_light_vanishes_gently_at_the_end_of_twilight():
    r = EARTH_RADIUS + 400e3
    totals = [float(light_from((0, 0, r), sun_at(a))[DISC + DISC_LIGHT]) for a in np.arange(60.0, 115.0, 0.25)]
    assert np.all(np.diff(totals) <= 0.0)
    assert totals[-1] == 0.0


def test_output_is_proportional_to_flux_and_reflectivity():
    r = (0.0, 0.0, EARTH_RADIUS + 400e3)
    normals = [[0.0, 0.0, -1.0], [0.6, 0.0, -0.8], [1.0, 0.0, 0.0]]
    white = output(light_from(r, sun_at(40.0)), normals)
    np.testing.assert_allclose(
        output(light_from(r, sun_at(40.0), 0.3 * WHITE, 1.03), normals), 0.309 * white, rtol=1e-5
    )


def test_shared_view_gives_each_case_its_own_light():
    r, sun = (1e6, 2e6, 6.5e6), sun_at(30.0)
    grid = zonal_reflectivity().mean
    view, light = new_earth_view(), new_light()
    look_at_earth(view, r, sun, 1.0, IDENTITY, *grid.shape)
    for reflectivity in (grid, 0.5 * grid):
        gather_light(view, reflectivity, light)
        np.testing.assert_array_equal(light, light_from(r, sun, reflectivity))


@pytest.mark.parametrize("position", [(0.0, 0.0, 0.0), (1e6, 0.0, 0.0), (EARTH_RADIUS, 0.0, 0.0), (1e12, 0.0, 0.0)])
@pytest.mark.parametrize("sun", [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.6, 0.0, 0.8)])
def test_places_inside_the_earth_and_far_away_give_finite_light(position, sun):
    light = light_from(position, sun)
    assert np.all(np.isfinite(light))
    result = output(light, np.vstack((np.eye(3), -np.eye(3))), 1.0, plane_screen((0, 0, 1)), 0.5)
    assert np.all(np.isfinite(result)) and np.all(result >= 0.0)


def test_plane_sends_each_ray_to_one_side():
    """Two cells with one normal on opposite sides of the plane share what a free cell receives."""
    rng = np.random.default_rng(4)
    light = light_from((0.0, 0.0, EARTH_RADIUS + 400e3), sun_at(50.0))
    for _ in range(50):
        dcm_bn = tuple(map(tuple, np.linalg.qr(rng.normal(size=(3, 3)))[0]))
        normal = np.linalg.qr(rng.normal(size=(3, 3)))[0][:1]
        shared = [output(light, normal, side, plane_screen((0, 0, 1)), 0.0, dcm_bn)[0] for side in (1.0, -1.0)]
        assert sum(shared) == pytest.approx(output(light, normal, 0.0, NO_SCREEN, 0.0, dcm_bn)[0], abs=2e-3)


def test_cone_of_view_hides_an_earth_behind_the_cell():
    light = light_from((0.0, 0.0, EARTH_RADIUS + 400e3), sun_at(0.0))
    disc = math.degrees(math.asin(EARTH_RADIUS / (EARTH_RADIUS + 400e3)))
    for angle, sees in ((disc + 50.0, True), (disc + 60.1, False)):
        a = math.radians(angle)
        value = output(light, [[math.sin(a), 0.0, -math.cos(a)]], cos_half_view=0.5)[0]
        assert (value > 0.0) == sees


def test_what_a_screen_passes_of_a_point_source():
    plane = plane_screen((0.0, 0.0, 1.0))
    up, down = (0.6, 0.0, 0.8), (0.6, 0.0, -0.8)
    assert [transmission(plane, side, up) for side in (1.0, -1.0, 0.0)] == [1.0, 0.0, 1.0]
    assert [transmission(plane, side, down) for side in (1.0, -1.0, 0.0)] == [0.0, 1.0, 1.0]
    assert transmission(NO_SCREEN, 1.0, down) == 1.0
    collar = soft_screen((0.0, 0.0, 1.0), math.radians(28.0), math.radians(44.9))
    assert transmission(collar, 1.0, (math.sin(0.48), 0.0, math.cos(0.48))) == 1.0
    assert transmission(collar, 1.0, (math.sin(0.79), 0.0, math.cos(0.79))) == 0.0
    middle = 0.5 * (collar.full_cos + collar.dark_cos)
    assert transmission(collar, 1.0, (math.sqrt(1 - middle**2), 0.0, middle)) == pytest.approx(0.5)
    assert Screen((0.0, 0.0, 1.0), 0.0, 0.0) == plane


@pytest.mark.parametrize(
    ("inclination", "half_view", "plane", "expected"),
    [(45.0, 60.0, 1.0, 0.163), (45.0, 90.0, 0.0, 0.200), (90.0, 60.0, 1.0, 0.266), (90.0, 90.0, 0.0, 0.331)],
)
def test_largest_output_along_the_papers_orbits(inclination, half_view, plane, expected):
    """The converged integral with zonal reflectivity, for the paper's cells and for cells without cone and plane.

    O'Keefe & Schaub 2013, Fig. 5, shows about 0.25 and 0.5. Summed over 5 deg patches taken as points, Eq. 17 gives
    0.24 and 0.36 for cells without cone and plane: 400 km above a patch 550 km wide the sum has not converged.
    """
    azimuths = np.radians([0, 90, 180, 270])
    normals = np.array([[np.cos(a), np.sin(a), z] for z in (1, -1) for a in azimuths]) / math.sqrt(2.0)
    orbit = keplerian_orbit(EARTH_RADIUS + 400e3, 0.0, inclination, 60.0)
    ephemeris = build_ephemeris(orbit, EPOCH_NS, field=False)
    reflectivity = zonal_reflectivity(1).mean
    view, light, work, result = new_earth_view(), new_light(), new_workspace(), np.zeros(8)
    cells, screen = cells_of(normals, normals[:, 2]), plane_screen((0.0, 0.0, plane))
    cos_half_view = math.cos(math.radians(half_view))
    rng = np.random.default_rng(8)
    attitudes = [mat3(np.linalg.qr(rng.normal(size=(3, 3)))[0]) for _ in range(200)]
    peak = 0.0
    for t in np.arange(0.0, orbit_period(orbit), 60.0):
        state = at(ephemeris, float(t))
        albedo_sources(view, state.r_n, state.sun_n, state.solar_flux, state.dcm_en, reflectivity, light)
        for dcm_bn in attitudes:
            albedo_output(light, cells, screen, cos_half_view, dcm_bn, work, result)
            peak = max(peak, result.max())
    assert peak == pytest.approx(expected, abs=0.004)


def square_of_light(half_width):
    """Light of one evenly bright square about -z, its sides along x and y, from its closed-form first moment."""
    light = new_light()
    for patch in range(PATCHES):
        write_patch(0.0, (0.0, 0.0, 0.0), patch, light)
    # directions (u, v, -sqrt(1 - u^2 - v^2)) of a small square: the mean of the third part is 1 - h^2 / 3
    write_patch(0.2, (0.0, 0.0, -0.2 * (1.0 - half_width**2 / 3.0)), 0, light)
    light[DISC : DISC + 3] = 0.0, 0.0, -1.0
    light[DISC + DISC_COS], light[DISC + DISC_SIN], light[DISC + DISC_LIGHT] = math.cos(1.2), math.sin(1.2), 0.2
    return light


@pytest.mark.parametrize("half_width", [0.02, 0.1, 0.2])
def test_size_of_a_patch_is_half_the_width_of_an_evenly_bright_square(half_width):
    light = square_of_light(half_width)
    assert light[SIZE] == pytest.approx(half_width, rel=half_width**2 + 1e-4)
    assert 4.0 * light[SIZE] * light[LIGHT] == pytest.approx(0.2, rel=1e-6)
    assert (light[X], light[Y]) == (0.0, 0.0) and light[Z] == pytest.approx(-1.0 + half_width**2 / 3.0, rel=1e-6)


def test_light_from_a_single_direction_is_as_wide_as_the_smallest_patch():
    """Half a degree: an edge of a cone that passes over it dims it gently."""
    light = square_of_light(0.0)
    assert light[SIZE] == pytest.approx(0.01)
    edge = math.radians(60.0)
    for inside, part in ((-1.05, 0.0), (-0.5, 0.25), (0.5, 0.75), (1.05, 1.0)):
        angle = edge - 0.01 * inside
        value = output(light, [[math.sin(angle), 0.0, -math.cos(angle)]], cos_half_view=0.5)[0]
        assert value == pytest.approx(0.2 * 0.5 * part, rel=0.02, abs=1e-9)


def test_patches_fill_the_disc_of_the_earth():
    """Seen whole and evenly lit, squares of the patches' sizes cover the solid angle that the Earth fills."""
    r = EARTH_RADIUS + 400e3
    light = light_from((0.0, 0.0, r), (0.0, 0.0, 1.0))
    sizes = light[SIZE : SIZE + PATCHES].astype(float)
    disc = 2.0 * math.pi * (1.0 - math.sqrt(1.0 - (EARTH_RADIUS / r) ** 2))
    # patches are sectors of rings, brighter toward one side, and longer than wide at the limb
    assert np.sum(4.0 * sizes**2) == pytest.approx(disc, rel=0.15)


@pytest.mark.parametrize("half_width", [0.05, 0.1])
@pytest.mark.parametrize("inside", [-1.1, -0.5, 0.0, 0.5, 1.1])
def test_cone_of_view_cuts_a_patch_as_wide_as_it_is(inside, half_width):
    """Against the integral over the square; the edge of the cone is `inside` half widths beyond its middle."""
    angle = math.radians(60.0) - inside * half_width
    normal = [math.sin(angle), 0.0, -math.cos(angle)]
    u, v = (w.ravel() for w in np.meshgrid(*2 * [half_width * (np.arange(400) + 0.5 - 200.0) / 200.0]))
    cosine = u * normal[0] - np.sqrt(1.0 - u * u - v * v) * normal[2]
    expected = 0.2 * np.mean(np.where(cosine > 0.5, cosine, 0.0))
    value = output(square_of_light(half_width), [normal], cos_half_view=0.5)[0]
    # the cone's edge is bent: over the square it lies a twelfth of the half width, of 0.1 of light, off a straight one
    assert value == pytest.approx(expected, abs=0.1 * half_width / 12.0 * 1.1)
    assert (value > 0.0) == (inside > -1.0)


@pytest.mark.parametrize("inside", [-1.05, -0.5, 0.0, 0.5, 1.05])
def test_plane_cuts_a_patch_in_proportion_to_its_width(inside):
    """A plane whose edge stands `inside` half widths from the middle of the patch; each side has its part."""
    half_width = 0.08
    light = square_of_light(half_width)
    tilt = inside * half_width
    screen = plane_screen((math.cos(tilt), 0.0, -math.sin(tilt)))
    part = min(max(0.5 + 0.5 * inside, 0.0), 1.0)
    for side, expected in ((1.0, part), (-1.0, 1.0 - part)):
        value = output(light, [[0.0, 0.0, -1.0]], side, screen)[0]
        assert value == pytest.approx(0.2 * expected, abs=0.2 * half_width**2)
