# SPDX-License-Identifier: Apache-2.0
"""The cells of O'Keefe & Schaub 2013: coverage of the sphere, warp, order of effects, limits."""

import math

import numba
import numpy as np
import pytest
from okeefe_spacecraft import okeefe_values

from css_common.mission_section import MISSION
from css_common.random_streams import random_key
from css_sensors.cells import CELLS
from css_sim import cell_errors, cell_screen, sun_cells
from css_sim.fault_effects import NO_FAULTS

KEY = random_key(1, 0)
PLAIN = {"warp": False, "degradation": 0.0}


def build(**changes):
    """Parameters and nominal cells of the paper's spacecraft."""
    values = okeefe_values(CELLS + sun_cells.PARAMETERS + cell_screen.PARAMETERS, **changes)
    return sun_cells.parameters(values), cell_errors.nominal_cells(values.cells.normals, cell_screen.cell_sides(values))


def read(p, cells, sun_b, intensity=1.0, albedo=None, step=0):
    """Voltages and mask of saturated cells."""
    voltages = np.zeros(len(cells))
    albedo = np.zeros(len(cells)) if albedo is None else albedo
    sun_b = tuple(float(x) for x in sun_b)
    mask = sun_cells.sample(p, cells, NO_FAULTS, KEY, step, sun_b, intensity, albedo, voltages)
    return voltages, mask


@numba.njit
def lit_fractions(p, cells, faults, key):
    """Fractions of the sphere that 0, 1, 2, ... cells see, at cell centres of a 720 x 1440 grid."""
    fractions = np.zeros(9)
    voltages, dark = np.zeros(8), np.zeros(8)
    for i in range(720):
        polar = (i + 0.5) * math.pi / 720
        for j in range(1440):
            azimuth = (j + 0.5) * math.pi / 720
            sun_b = (
                math.sin(polar) * math.cos(azimuth),
                math.sin(polar) * math.sin(azimuth),
                math.cos(polar),
            )
            sun_cells.sample(p, cells, faults, key, 0, sun_b, 1.0, dark, voltages)
            fractions[np.count_nonzero(voltages)] += math.sin(polar)
    return fractions / fractions.sum()


def test_coverage_of_the_sphere():
    # Fig. 1b; the numbers come from an independent program on the same grid, to the digits given
    p, cells = build(**PLAIN)
    fractions = lit_fractions(p, cells, NO_FAULTS, KEY)
    np.testing.assert_allclose(fractions[:5], [0, 0.3508, 0.5145, 0.0938, 0.0408], atol=5.1e-5)
    assert np.all(fractions[5:] == 0)


def test_coverage_without_the_body_plane():
    p, cells = build(**PLAIN, cells__clip_normal=[0.0, 0.0, 0.0])
    fractions = lit_fractions(p, cells, NO_FAULTS, KEY)
    np.testing.assert_allclose(fractions[:5], [0, 0.1753, 0.6900, 0.0938, 0.0408], atol=5.1e-5)
    # closed form: eight cones of 60 deg half angle cover (1 - cos 60 deg) / 2 of the sphere each
    assert fractions @ np.arange(9) == pytest.approx(8 * 0.25, abs=2e-4)


@pytest.mark.parametrize(
    ("ideal", "warped"), [(0.0, 0.0), (0.5, 0.50469), (0.70711, 0.76898), (0.9, 0.96438), (1.0, 1.0)]
)
def test_warp(ideal, warped):
    assert sun_cells.warped(ideal) == pytest.approx(warped, abs=1e-5)


def test_warp_of_more_than_one_sun_is_the_identity():
    # the angle is taken of the output cut to 1, so beyond the peak nothing is bent
    assert sun_cells.warped(1.2) == 1.2


def test_cosine_inside_the_view_and_nothing_outside():
    p, cells = build(**PLAIN)
    for angle, expected in [(0, 1.0), (45, math.sqrt(0.5)), (59.999, 0.5), (60.001, 0.0)]:
        # turn from the first normal toward the pole and beyond it, staying on its side of the body plane
        t = math.radians(45 - angle)
        voltages, _ = read(p, cells, (math.sin(t), 0, math.cos(t)))
        assert voltages[0] == pytest.approx(expected, abs=2e-5)


def test_body_plane_hides_the_other_half_space():
    p, cells = build(**PLAIN)
    for z, seen in [(1e-6, True), (-1e-6, False)]:
        voltages, _ = read(p, cells, (math.sqrt(1 - z * z), 0, z))
        assert (voltages[0] > 0.7) == seen
        assert (voltages[4] > 0.7) != seen


def test_a_cell_in_the_body_plane_is_not_clipped():
    p, cells = build(**PLAIN, cells__normals=[1.0, 0.0, 0.0])
    for z in (0.5, -0.5):
        voltages, _ = read(p, cells, (math.sqrt(0.75), 0, z))
        assert voltages[0] == pytest.approx(math.sqrt(0.75))


def test_collar_dims_its_cells_alone():
    # Benton: all light within 28 deg of the collar's axis, none beyond 44.9 deg
    p, cells = build(
        **PLAIN,
        cells__normals=[0.0, 0.0, 1.0, 0.0, 0.0, 1.0],
        cells__field_of_view_deg=166.0,
        cells__clip_normal=[0.0, 0.0, 0.0],
        collar__axis=[0.0, 0.0, 1.0],
        collar__cells=[1],
    )
    full, dark = math.cos(math.radians(28.0)), math.cos(math.radians(44.9))
    for angle in (0.0, 27.9, 30.0, 40.0, 44.8, 45.0, 80.0):
        c = math.cos(math.radians(angle))
        voltages, _ = read(p, cells, (math.sqrt(1 - c * c), 0, c))
        part = min(max((c - dark) / (full - dark), 0.0), 1.0)
        np.testing.assert_allclose(voltages, [c, c * part], rtol=1e-12)


def test_conflicts_of_a_collar_are_named():
    table = MISSION + CELLS + cell_screen.PARAMETERS
    values = okeefe_values(table, collar__axis=[0.0, 0.0, 2.0], collar__cells=[3, 8], collar__full_deg=50.0)
    found = "\n".join(cell_screen.conflicts(values))
    for part in ("length 2", "cells.clip_normal", "8 given, expected numbers from 0 to 7", "50 given"):
        assert part in found
    assert "without" in next(cell_screen.conflicts(okeefe_values(table, collar__cells=[1])))
    assert list(cell_screen.conflicts(okeefe_values(table))) == []


def test_eclipse_leaves_nothing_and_distance_scales():
    p, cells = build(**PLAIN)
    assert not np.any(read(p, cells, (0, 0, 1), intensity=0.0)[0])
    near, _ = read(p, cells, (0, 0, 1), intensity=1.034)
    far, _ = read(p, cells, (0, 0, 1), intensity=0.967)
    assert near[0] / far[0] == pytest.approx(1.034 / 0.967)


def test_albedo_adds_before_warp_and_degradation():
    p, cells = build(degradation=0.05)
    albedo = np.linspace(0.0, 0.3, 8)
    bright, _ = read(p, cells, (0, 0, 1), albedo=albedo)
    dark, _ = read(p, cells, (0, 0, 1), intensity=0.0, albedo=albedo)
    sun = np.array([math.sqrt(0.5)] * 4 + [0.0] * 4)
    factor = dark[7] / sun_cells.warped(albedo[7])
    assert 0.95 <= factor <= 1.0
    np.testing.assert_allclose(bright, [factor * sun_cells.warped(v) for v in sun + albedo], rtol=1e-13)
    np.testing.assert_allclose(dark, [factor * sun_cells.warped(v) for v in albedo], rtol=1e-13)


def test_light_below_the_dropout_level_gives_nothing():
    p, cells = build(**PLAIN, dropout=math.sin(math.radians(7)))
    voltages, _ = read(p, cells, (0, 0, 1), 0.0, np.array([0.121, 0.122, 0.0, 0.5, 0.121, 0.122, 0.0, 0.5]))
    np.testing.assert_array_equal(voltages, [0.0, 0.122, 0.0, 0.5] * 2)


def test_quantisation_of_twelve_bits():
    # Benton: floor(v 4096) / 4096 in [0, 4095/4096]
    p, cells = build(**PLAIN, bits=12, output_high=1.0)
    light = np.array([0.0, 1e-5, 0.25, 0.3333, 0.99999, 1.0, 1.3, 2 / 4096])
    voltages, mask = read(p, cells, (0, 0, 1), 0.0, light)
    np.testing.assert_array_equal(voltages, np.minimum(np.floor(light * 4096), 4095) / 4096)
    assert mask == 0b1110000


def test_limits_and_mask():
    p, cells = build(**PLAIN, output_low=0.1, output_high=0.8)
    voltages, mask = read(p, cells, (0, 0, 1), 0.0, np.array([0.0, 0.1, 0.5, 0.79, 0.8, 0.9, 2.0, 0.05]))
    np.testing.assert_array_equal(voltages, [0.1, 0.1, 0.5, 0.79, 0.8, 0.8, 0.8, 0.1])
    assert mask == 0b1110000


def test_output_is_never_other_than_a_number():
    p, cells = build()
    voltages, _ = read(p, cells, (math.nan, 0, 1), math.nan, np.full(8, math.nan))
    assert np.all(np.isfinite(voltages))
