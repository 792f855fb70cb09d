# SPDX-License-Identifier: Apache-2.0
"""Albedo as one vector: its closed forms against quadrature, the integral over patches, and the crude model."""

import math

import numpy as np
import pytest

from css_common.vectors import scale
from css_environment.albedo import albedo_output, new_workspace, plane_screen, soft_screen, transmission
from css_environment.albedo_vector import MODELS, albedo_vector, earth_light_sources, lit_cap, nadir_vector
from css_environment.constants import EARTH_RADIUS
from css_environment.earth_light import new_earth_view, new_light
from css_environment.reflectivity import knocke_reflectivity, reflectivity_at

CELL = np.dtype([(name, float) for name in ("nx", "ny", "nz", "side")], align=True)
IDENTITY = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
WHITE = np.ones((1, 1))
JUNE_NS = 834_019_200 * 10**9  # 6 June 1996
R = EARTH_RADIUS + 475e3
RHO = math.acos(EARTH_RADIUS / R)
UP = (0.0, 0.0, R)


def sun_at(zenith_angle_deg):
    a = math.radians(zenith_angle_deg)
    return (math.sin(a), 0.0, math.cos(a))


def cap_by_quadrature(psi, rho, n=1500):
    """Lit area and integral of the normal by the midpoint rule in cosine and azimuth."""
    u = math.cos(rho) + (1.0 - math.cos(rho)) * (np.arange(n) + 0.5) / n
    phi = 2.0 * math.pi * (np.arange(n) + 0.5) / n
    z = u[:, None] * np.ones(n)
    sine = np.sqrt(1.0 - z * z)
    x, y = sine * np.cos(phi), sine * np.sin(phi)
    lit = math.sin(psi) * x + math.cos(psi) * z > 0.0
    cell = (1.0 - math.cos(rho)) / n * 2.0 * math.pi / n
    return cell * np.count_nonzero(lit), tuple(cell * np.sum(c[lit]) for c in (x, y, z))


@pytest.mark.parametrize("rho", [RHO, 0.1, 0.9])
@pytest.mark.parametrize("psi_deg", [0.0, 10.0, 45.0, 68.0, 69.0, 75.0, 89.9, 90.0, 95.0, 105.0, 111.0, 150.0, 180.0])
def test_lit_cap_against_quadrature(psi_deg, rho):
    psi = math.radians(psi_deg)
    area, moment = lit_cap(psi, rho)
    expected_area, expected_moment = cap_by_quadrature(psi, rho)
    assert area == pytest.approx(expected_area, abs=2e-4)
    np.testing.assert_allclose(moment, expected_moment, atol=2e-4)


def test_lit_cap_is_continuous_where_the_terminator_enters_and_leaves():
    for edge in (0.5 * math.pi - RHO, 0.5 * math.pi + RHO):
        (a, m), (b, n) = lit_cap(edge - 1e-9, RHO), lit_cap(edge + 1e-9, RHO)
        np.testing.assert_allclose((a, *m), (b, *n), atol=1e-6)


@pytest.mark.parametrize(
    ("zenith_angle", "magnitude"), [(0, 0.866), (30, 0.750), (60, 0.433), (68, 0.325), (75, 0.228), (90, 0.070)]
)
def test_magnitude_over_a_white_earth(zenith_angle, magnitude):
    """From an independent program; up to 75 deg the integral over patches gives the same to 0.005."""
    vector = albedo_vector(UP, sun_at(zenith_angle), 1.0, IDENTITY, WHITE)
    assert np.linalg.norm(vector) == pytest.approx(magnitude, abs=6e-4)


def test_direction_leaves_nadir_for_the_sun_and_the_dark_sends_nothing():
    angles = []
    for zenith_angle in (0.0, 60.0, 80.0, 90.0, 100.0, 110.0):
        vector = albedo_vector(UP, sun_at(zenith_angle), 1.0, IDENTITY, WHITE)
        angles.append(math.degrees(math.acos(-vector[2] / np.linalg.norm(vector))))
        assert vector[0] >= 0.0 and vector[1] == 0.0
    np.testing.assert_allclose(angles[:2], 0.0, atol=1e-5)
    np.testing.assert_allclose(angles[2:4], [43.0, 61.0], atol=0.6)
    assert np.all(np.diff(angles[1:]) > 0.0)
    # the limb is where the line of sight touches the Earth
    assert angles[-1] < 90.0 - math.degrees(RHO)
    assert albedo_vector(UP, sun_at(112.0), 1.0, IDENTITY, WHITE) == (0.0, 0.0, 0.0)


def test_scale_with_flux_and_reflectivity_of_the_place():
    """The reflectivity is that of the latitude below, in the month of the table."""
    table = knocke_reflectivity(JUNE_NS).mean
    ratio2 = (EARTH_RADIUS / R) ** 2
    for latitude in (-80.0, -12.5, 0.0, 33.0, 66.6, 80.0):
        a = math.radians(latitude)
        up = (math.cos(a), 0.0, math.sin(a))
        r_n = scale(R, up)
        magnitude = np.linalg.norm(albedo_vector(r_n, up, 0.97, IDENTITY, table))
        assert magnitude == pytest.approx(0.97 * ratio2 * reflectivity_at(table, up), rel=1e-6)
        p2 = (3.0 * math.sin(a) ** 2 - 1.0) / 2.0
        season = math.cos(2.0 * math.pi * (2_450_240.5 - 2_444_960.5) / 365.25)
        assert reflectivity_at(table, up) == pytest.approx(0.34 + 0.10 * season * math.sin(a) + 0.29 * p2, abs=2e-3), (
            "interpolated between bands of 5 deg"
        )


def test_reflectivity_is_continuous_across_bands_and_constant_beyond_the_last():
    rows = np.array([[0.1], [0.5], [0.9]])
    latitudes = np.radians(np.linspace(-90.0, 90.0, 361))
    values = [reflectivity_at(rows, (math.cos(a), 0.0, math.sin(a))) for a in latitudes]
    assert np.max(np.abs(np.diff(values))) < 0.4 * 0.5 / 60.0 + 1e-4
    np.testing.assert_allclose([values[0], values[60], values[180], values[360]], [0.1, 0.1, 0.5, 0.9], atol=1e-4)


def test_nadir_model_is_constant_in_sunlight():
    value = np.array([[0.4]])
    for zenith_angle in (0.0, 60.0, 100.0):
        assert nadir_vector(UP, sun_at(zenith_angle), 1.0, value) == pytest.approx((0.0, 0.0, -0.4))
    assert nadir_vector(UP, sun_at(170.0), 1.0, value) == pytest.approx((0.0, 0.0, 0.0))


@pytest.mark.parametrize("model", ["vector", "nadir"])
def test_cells_receive_the_vector_through_view_and_collar(model):
    """The one patch of light gives each cell the cosine law, cut by its collar as a point source is."""
    rng = np.random.default_rng(3)
    screen = soft_screen((0.0, 0.0, -1.0), math.radians(28.0), math.radians(44.9))
    cells = np.zeros(40, CELL)
    normals = rng.normal(size=(40, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    cells["nx"], cells["ny"], cells["nz"] = normals.T
    cells["side"][20:] = 1.0
    output, light, grid = np.zeros(40), new_light(), np.full((1, 1), 0.5)
    for zenith_angle in (20.0, 75.0, 80.0, 95.0):
        sun_n = sun_at(zenith_angle)
        earth_light_sources(MODELS[model], new_earth_view(), UP, sun_n, 1.0, IDENTITY, grid, light)
        albedo_output(light, cells, screen, 0.0, IDENTITY, new_workspace(), output)
        if model == "vector":
            vector = np.array(albedo_vector(UP, sun_n, 1.0, IDENTITY, grid))
        else:
            vector = np.array(nadir_vector(UP, sun_n, 1.0, grid))
        size = np.linalg.norm(vector)
        passed = [transmission(screen, side, tuple(vector / size)) for side in cells["side"]]
        # the patch is 0.6 deg wide: that much of it may be beyond an edge
        np.testing.assert_allclose(output, np.maximum(normals @ vector, 0.0) * passed, atol=0.01 * float(size))


@pytest.mark.parametrize(
    ("zenith_angle", "magnitude", "lean"),
    [(0.0, 0.86160, 0.0), (20.0, 0.80982, 1.22), (40.0, 0.66082, 2.81), (60.0, 0.43301, 5.79), (68.0, 0.32613, 8.24)],
)
def test_how_the_vector_differs_from_the_integral_where_all_of_the_cap_is_lit(zenith_angle, magnitude, lean):
    """A quadrature of the integral gave magnitude and lean from nadir toward the brighter side; the vector has none."""
    plates = np.vstack((np.eye(3), -np.eye(3)))
    cells = np.zeros(6, CELL)
    cells["nx"], cells["ny"], cells["nz"] = plates.T
    sums = {}
    for model in ("patches", "vector"):
        light, output = new_light(), np.zeros(6)
        earth_light_sources(MODELS[model], new_earth_view(), UP, sun_at(zenith_angle), 1.0, IDENTITY, WHITE, light)
        albedo_output(light, cells, plane_screen((0.0, 0.0, 0.0)), 0.0, IDENTITY, new_workspace(), output)
        sums[model] = output[:3] - output[3:]
    vector, patches = sums["vector"], sums["patches"]
    assert np.linalg.norm(vector) == pytest.approx(magnitude, abs=5e-3)
    assert np.linalg.norm(patches) == pytest.approx(magnitude, abs=1e-3)
    assert math.degrees(math.atan2(patches[0], -patches[2])) == pytest.approx(lean, abs=0.1)
    assert math.degrees(math.atan2(vector[0], -vector[2])) == pytest.approx(0.0, abs=1e-4)
