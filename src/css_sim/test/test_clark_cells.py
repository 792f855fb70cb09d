# SPDX-License-Identifier: Apache-2.0
"""The cells of Benton: order of the signal chain, converter, and the pyramid in its collar."""

import math

import numpy as np
import pytest

from css_common.mission import load_mission
from css_common.random_streams import Stream, normal4, random_key
from css_sim import cell_errors, cell_screen, sun_cells
from css_sim.fault_effects import NO_FAULTS
from css_sim.nodes.css_array import CssArray

DROPOUT = math.sin(math.radians(7.0))
PYRAMID = slice(11, 14)


def values_of(name, *overrides):
    return next(n for n in load_mission(name, list(overrides)).nodes if n.component is CssArray).values


def read(values, sun_b, albedo=None, key=None, intensity=1.0):
    p = sun_cells.parameters(values)
    cells = cell_errors.nominal_cells(values.cells.normals, cell_screen.cell_sides(values))
    out = np.zeros(14)
    light = np.zeros(14) if albedo is None else albedo
    sun_b = tuple(float(c) for c in sun_b)
    sun_cells.sample(p, cells, NO_FAULTS, key or random_key(1, 0), 5, sun_b, intensity, light, out)
    return out


def test_chain_is_sum_then_dropout_then_noise_then_converter():
    values = values_of("clark_1996_flat")
    rng = np.random.default_rng(2)
    key = random_key(3, 1)
    noise = np.concatenate([normal4(key, Stream.CELL_NOISE, 5, block) for block in range(4)])[:14] * 0.01
    for _ in range(200):
        sun_b = rng.normal(size=3)
        sun_b /= np.linalg.norm(sun_b)
        albedo = rng.uniform(0.0, 0.5, 14)
        light = np.maximum(values.cells.normals @ sun_b, 0.0) + albedo
        light[light < DROPOUT] = 0.0
        expected = np.clip(np.floor((light + noise) * 4096.0) / 4096.0, 0.0, 4095.0 / 4096.0)
        np.testing.assert_array_equal(read(values, sun_b, albedo, key), expected)


def test_dropout_is_499_steps_of_the_converter_and_judges_the_sum():
    values = values_of("clark_1996_flat", "css_array.noise=0.0")
    assert pytest.approx(499.2, abs=0.05) == DROPOUT * 4096
    for angle, seen in ((6.99, False), (7.01, True)):
        a = math.radians(angle)
        assert (read(values, (math.sin(a), 0.0, math.cos(a)))[0] > 0.0) == seen
    a = math.radians(5.0)
    # neither alone is enough
    albedo = np.full(14, 0.05)
    assert read(values, (math.sin(a), 0.0, math.cos(a)), albedo)[0] == math.floor((math.sin(a) + 0.05) * 4096) / 4096


def pyramid_directions(values, angle_deg, azimuths):
    axis = values.collar.axis
    e1 = np.array([1.0, 0.0, 0.0])
    e2 = np.cross(axis, e1)
    a = math.radians(angle_deg)
    for azimuth in azimuths:
        yield math.cos(a) * axis + math.sin(a) * (math.cos(azimuth) * e1 + math.sin(azimuth) * e2)


def test_pyramid_stands_on_the_panel_normal():
    mission = load_mission("clark_1996_pyramid")
    values = values_of("clark_1996_pyramid")
    normals = values.cells.normals[PYRAMID]
    np.testing.assert_allclose(normals @ normals.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(normals @ values.collar.axis, 1.0 / math.sqrt(3.0), atol=1e-12)
    np.testing.assert_array_equal(values.collar.axis, mission.values.spacecraft.array_normal)
    np.testing.assert_allclose(normals[0], [0.816497, -0.100256, -0.568579], atol=1e-6)


def test_all_of_the_pyramid_reads_fifteen_percent_out_to_26_deg_in_the_worst_azimuth():
    """Full light inside 28.26 deg, where the drop-out begins; 15 % of full scale is 8.63 deg above a face."""
    values = values_of("clark_1996_pyramid", "css_array.noise=0.0")
    azimuths = np.radians(np.arange(0.0, 360.0, 1.0))
    for angle, everywhere in ((26.5, True), (26.8, False)):
        readings = [read(values, d)[PYRAMID].min() >= 0.15 for d in pyramid_directions(values, angle, azimuths)]
        assert all(readings) == everywhere
        assert any(readings)
    assert math.degrees(math.acos(1.0 / math.sqrt(3.0))) == pytest.approx(54.7356, abs=1e-4)
    assert pytest.approx(28.26, abs=0.01) == 83.0 - 54.7356


def test_collar_dims_sun_and_albedo_each_by_its_own_direction():
    values = values_of("clark_1996_pyramid", "css_array.noise=0.0", "css_array.dropout=0.0")
    full, dark = math.cos(math.radians(28.0)), math.cos(math.radians(44.9))
    for angle in (20.0, 30.0, 36.0, 44.0, 45.0, 60.0):
        (direction,) = pyramid_directions(values, angle, [0.3])
        part = min(max((math.cos(math.radians(angle)) - dark) / (full - dark), 0.0), 1.0)
        expected = np.maximum(values.cells.normals @ direction, 0.0)
        expected[PYRAMID] *= part
        np.testing.assert_allclose(read(values, direction), expected, atol=1.0 / 4096.0)
        # light that the collar has let pass already, such as albedo, is not cut again
        albedo = np.full(14, 0.2)
        both = np.minimum(expected + 0.2, 4095.0 / 4096.0)
        np.testing.assert_allclose(read(values, direction, albedo), both, atol=1.0 / 4096.0)
