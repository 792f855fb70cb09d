# SPDX-License-Identifier: Apache-2.0
"""Cells with views, responses and blocked directions of their own, and outputs that change with temperature."""

import math

import numpy as np
import pytest

from css_common.direction_grid import SIZE, grid_cell
from css_common.mission import MissionError, load_mission
from css_common.random_streams import random_key
from css_environment.albedo import albedo_output, new_workspace, plane_screen, with_views
from css_environment.albedo_slope import albedo_slopes
from css_environment.earth_light import DISC, DISC_COS, DISC_LIGHT, DISC_SIN, LIGHT, X, Z, new_light
from css_environment.earth_light import SIZE as WIDTH
from css_estimation.sun.cell_layout import cell_layout, sees
from css_sim import cell_screen, sun_cells
from css_sim.cell_errors import nominal_cells
from css_sim.fault_effects import FAULT

IDENTITY = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
QUIET = ("css_array.warp=false", "css_array.degradation=0", "cells.clip_normal=0,0,0")
VIEWS = "cells.fields_of_view_deg=120,60,120,120,120,120,120,170"


def array(*overrides):
    return load_mission("okeefe_2013", [*QUIET, *overrides]).node("css_array").values


def outputs(values, sun_b, albedo=0.0):
    cells = nominal_cells(values.cells.normals, cell_screen.cell_sides(values))
    out = np.zeros(len(cells))
    light = np.full(len(cells), albedo)
    sun_cells.sample(
        sun_cells.parameters(values), cells, np.zeros(0, FAULT), random_key(0, 0), 0, sun_b, 1.0, light, out
    )
    return out


def towards(normal, other, angle_deg):
    """Unit vector at an angle from a normal."""
    across = other - (other @ normal) * normal
    across /= np.linalg.norm(across)
    a = math.radians(angle_deg)
    return tuple(float(x) for x in math.cos(a) * normal + math.sin(a) * across)


def test_each_cell_has_its_view():
    values = array(VIEWS)
    layout = cell_layout(values)
    normals = values.cells.normals
    for i, view in ((0, 120.0), (1, 60.0), (7, 170.0)):
        for angle, lit in ((0.5 * view - 0.1, True), (0.5 * view + 0.1, False)):
            sun_b = towards(normals[i], np.array([0.1, 0.2, 0.9]), angle)
            assert [bool(outputs(values, sun_b)[i] > 0.0), bool(sees(layout, i, sun_b))] == [lit, lit]
            if lit:
                assert outputs(values, sun_b)[i] == pytest.approx(math.cos(math.radians(angle)))


def test_views_that_are_alike_are_the_common_one():
    sun_b = towards(np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.3, 0.0]), 20.0)
    alike = array("cells.fields_of_view_deg=" + ",".join(["120"] * 8))
    np.testing.assert_array_equal(outputs(alike, sun_b), outputs(array(), sun_b))


def test_blocked_cells_are_dark_there_and_nowhere_else():
    sun_b = (0.1, 0.2, math.sqrt(1.0 - 0.05))
    masks = np.zeros(SIZE, dtype=int)
    masks[grid_cell(sun_b)] = 0b101
    values = array("cells.blocked=" + ",".join(map(str, masks)))
    free, hidden = outputs(array(), sun_b), outputs(values, sun_b)
    assert np.all(hidden[[0, 2]] == 0.0) and np.all(free[[0, 2]] > 0.0)
    np.testing.assert_array_equal(hidden[[1, 3]], free[[1, 3]])
    layout = cell_layout(values)
    assert [sees(layout, i, sun_b) for i in range(4)] == [False, True, False, True]
    beside = (-0.1, -0.2, sun_b[2])
    np.testing.assert_array_equal(outputs(values, beside), outputs(array(), beside))


def patch(direction, width=0.1):
    light = new_light()
    light[X], light[X + 32], light[Z] = direction
    light[LIGHT], light[WIDTH] = 0.2, width
    light[DISC : DISC + 3] = direction
    light[DISC + DISC_COS], light[DISC + DISC_SIN], light[DISC + DISC_LIGHT] = 0.3, 0.95, 0.2
    return light


def test_light_of_the_earth_knows_views_and_blocking():
    values = array()
    cells = nominal_cells(values.cells.normals, cell_screen.cell_sides(values))
    light = patch((0.1, 0.3, math.sqrt(0.9)))
    plain = plane_screen((0.0, 0.0, 0.0))
    alike = with_views(plain, np.full(8, 0.5), np.zeros(0))
    masks = np.zeros(SIZE, dtype=np.uint32)
    masks[grid_cell((0.1, 0.3, math.sqrt(0.9)))] = 0b10
    blocked = with_views(plain, np.zeros(0), masks)
    found = []
    for screen in (plain, alike, blocked):
        out, slopes = np.zeros(8), np.zeros((8, 3))
        albedo_output(light, cells, screen, 0.5, IDENTITY, new_workspace(), out)
        albedo_slopes(light, cells, screen, 0.5, IDENTITY, slopes)
        found.append((out, slopes))
    np.testing.assert_allclose(found[1][0], found[0][0], rtol=1e-5, atol=1e-9)  # in double precision
    assert found[0][0][1] > 0.0 == found[2][0][1] and not np.any(found[2][1][1])
    np.testing.assert_allclose(np.delete(found[2][0], 1), np.delete(found[0][0], 1), rtol=1e-5, atol=1e-9)
    narrow = with_views(plain, np.array([math.cos(0.2)] * 8), np.zeros(0))
    out = np.zeros(8)
    albedo_output(light, cells, narrow, 0.5, IDENTITY, new_workspace(), out)
    assert not np.any(out)


def test_a_table_takes_the_place_of_the_cosine():
    angles, table = (0.0, 30.0, 60.0, 80.0), (1.0, 0.9, 0.4, 0.1)
    words = ["css_array.response.angles_deg=" + ",".join(map(str, angles))]
    one = array(*words, "css_array.response.outputs=" + ",".join(map(str, table)))
    each = array(*words, "css_array.response.outputs=" + ",".join(map(str, [*table * 7, 1.0, 0.5, 0.2, 0.0])))
    for angle in (0.0, 12.0, 30.0, 47.0, 59.0):
        expected = np.interp(angle, angles, table)
        assert outputs(one, towards(one.cells.normals[0], np.ones(3), angle))[0] == pytest.approx(expected, abs=1e-9)
        last = outputs(each, towards(one.cells.normals[7], np.ones(3), angle))[7]
        assert last == pytest.approx(np.interp(angle, angles, (1.0, 0.5, 0.2, 0.0)), abs=1e-9)


def test_outputs_change_with_temperature():
    thermal = [f"css_array.thermal.{key}" for key in ("coefficient=0.002", "dark_temperature=-30", "rise=60")]
    sun_b = towards(array().cells.normals[0], np.ones(3), 25.0)
    cold, light = outputs(array(), sun_b, 0.1)[0], math.cos(math.radians(25.0)) + 0.1
    # 20 degC is right: at -30 + 60 light it is so far from it
    assert outputs(array(*thermal), sun_b, 0.1)[0] == pytest.approx(cold * (1.0 + 0.002 * (-50.0 + 60.0 * light)))


@pytest.mark.parametrize(
    ("override", "error"),
    [
        ("cells.fields_of_view_deg=120,60", "2 given, expected one for each of 8 cells"),
        ("cells.blocked=1,2,3", "3 given, expected 2592"),
        ("cells.blocked=" + ",".join(["256"] * SIZE), "has a cell beyond 7"),
        ("css_array.response.angles_deg=0,30", "response.outputs: 0 given, expected 2"),
        ("css_array.response.angles_deg=10,30", "rise from 0"),
    ],
)
def test_what_does_not_fit_is_refused(override, error):
    with pytest.raises(MissionError, match=error):
        load_mission("okeefe_2013", [*QUIET, override])


def test_a_table_and_the_warp_exclude_each_other():
    table = ["css_array.response.angles_deg=0,90", "css_array.response.outputs=1,0"]
    with pytest.raises(MissionError, match="warp: true given together"):
        load_mission("okeefe_2013", table)
