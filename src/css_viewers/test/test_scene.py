# SPDX-License-Identifier: Apache-2.0
"""Where things stand in a scene, against scipy and by hand."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from listing import MISSIONS
from scipy.spatial.transform import Rotation

from css_common.codec import Sample, codec_of
from css_common.earth import EARTH_RADIUS
from css_common.mission import load_mission
from css_msgs.msg import CssVoltages, SpacecraftState, SunEstimate
from css_viewers.scene import Scene, sides_of
from css_viewers.shapes import ARROW, along, cone
from css_viewers.viewed_bag import NODE, PACKAGE

UNITS = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1)


@pytest.fixture(scope="module")
def values():
    return load_mission("okeefe_2013").with_node((PACKAGE, NODE, NODE), {}).node(NODE).values


@pytest.fixture
def scene(values):
    return Scene(values, "bus", "spacecraft")


def truth(**given) -> Sample:
    fields = {"r_n": np.array([7e6, 0.0, 0.0]), "sun_n": np.array([0.0, 1.0, 0.0]), "illumination": 1.0}
    return codec_of(SpacecraftState).sample(0, "eci", **{**fields, **given})


def of_group(shapes, group):
    return [shape for shape in shapes if shape.group == group]


@given(UNITS)
def test_the_z_axis_is_turned_to_the_axis(axis):
    axis = np.array(axis) / np.linalg.norm(axis)
    np.testing.assert_allclose(Rotation.from_quat(along(tuple(axis))).apply((0.0, 0.0, 1.0)), axis, atol=1e-7)


@given(UNITS, st.floats(0.0, math.pi), st.floats(0.1, 3.0))
def test_a_cone_has_its_angle_and_length(axis, half_angle, length):
    axis = np.array(axis) / np.linalg.norm(axis)
    corners = cone((1.0, 2.0, 3.0), tuple(axis), half_angle, length).reshape(-1, 3, 3)
    np.testing.assert_array_equal(corners[:, 0], np.tile((1.0, 2.0, 3.0), (len(corners), 1)))
    rims = corners[:, 1:].reshape(-1, 3) - (1.0, 2.0, 3.0)
    np.testing.assert_allclose(np.linalg.norm(rims, axis=1), length)
    np.testing.assert_allclose(rims @ axis, length * math.cos(half_angle), atol=1e-12)


def test_a_box_of_those_sides_has_inertia_in_that_ratio():
    sides = np.array([0.4, 1.0, 0.7])
    inertia = np.diag([sides[1] ** 2 + sides[2] ** 2, sides[0] ** 2 + sides[2] ** 2, sides[0] ** 2 + sides[1] ** 2])
    np.testing.assert_allclose(sides_of(3.7 * inertia.ravel()), sides)


def test_cells_stand_on_the_surface_and_show_their_light(scene, values):
    voltages = np.linspace(0.0, 1.4, 8)
    shapes = scene.shapes(truth(), {"cells": Sample(0, "bus", voltages=voltages, saturated=0)})
    cells = of_group(shapes, "cells")
    half_sides = 0.5 * sides_of(values.spacecraft.inertia)
    for shape, normal in zip(cells, values.cells.normals, strict=True):
        place = np.array(shape.position)
        assert np.max(np.abs(place) / half_sides) == pytest.approx(1.0)
        np.testing.assert_allclose(place / np.linalg.norm(place), normal, atol=1e-12)
    greens = [shape.colour[1] for shape in cells]
    assert greens == sorted(greens)
    assert greens[0] < greens[-1] == greens[-2]  # full light is the brightest there is


def test_missing_and_failed_cells_are_told_apart(scene):
    voltages = np.array([np.nan, *[1.0] * 7])
    sun = codec_of(SunEstimate).sample(0, "bus", isolated=0b10)
    shapes = scene.shapes(truth(), {"cells": codec_of(CssVoltages).sample(0, "bus", voltages=voltages), "sun": sun})
    missing, failed, good = (shape.colour for shape in of_group(shapes, "cells")[:3])
    assert len({missing, failed, good}) == 3


def test_the_sun_is_where_it_is_and_the_earth_has_its_size(scene):
    shapes = scene.shapes(truth(r_n=np.array([0.0, 0.0, 2.0 * EARTH_RADIUS])), {})
    (sun,), (earth,) = of_group(shapes, "sun"), of_group(shapes, "earth")
    assert sun.kind == ARROW and sun.frame == earth.frame == "spacecraft"
    np.testing.assert_allclose(sun.points[1] / np.linalg.norm(sun.points[1]), (0.0, 1.0, 0.0))
    assert earth.position[2] < 0.0 == earth.position[0]
    # at two radii the Earth's limb is seen at 30 deg from its middle
    assert 0.5 * earth.size[0] / abs(earth.position[2]) == pytest.approx(math.sin(math.radians(30.0)))


def test_the_cone_of_the_estimate_is_its_three_sigma(scene):
    covariance = np.diag([1e-4, 4e-4, 0.0]).ravel()
    sun = codec_of(SunEstimate).sample(
        0, "bus", sun_b=np.array([0.0, 0.0, 1.0]), covariance=covariance, validity=SunEstimate.VALIDITY_VALID
    )
    shapes = scene.shapes(truth(sigma_bn=np.array([math.tan(math.radians(22.5)), 0.0, 0.0])), {"sun": sun})
    (rim,) = of_group(shapes, "sun_uncertainty")
    direction = rim.points[1] / np.linalg.norm(rim.points[1])
    assert math.acos(direction[2]) == pytest.approx(3.0 * 0.02)
    (text,) = of_group(shapes, "text")
    # a turn by 90 deg about x takes y of the inertial frame to -z of the body: the estimate is opposite
    assert "heading error 180.00 deg" in text.text


@pytest.mark.parametrize("name", MISSIONS)
def test_every_mission_can_be_drawn(name):
    node = load_mission(name).with_node((PACKAGE, NODE, NODE), {}).node(NODE)
    scene = Scene(node.values, "bus", "spacecraft")
    shapes = scene.shapes(truth(), {})
    assert {shape.group for shape in shapes} >= {"body", "sun", "earth", "text"}
    assert len(of_group(shapes, "cells")) == len(node.values.cells.normals)
    assert all(np.isfinite(shape.points).all() and np.isfinite(shape.position).all() for shape in shapes)


def test_without_an_estimate_nothing_is_drawn_of_it(scene):
    shapes = scene.shapes(truth(), {"sun": codec_of(SunEstimate).sample(0, "bus")})
    assert not of_group(shapes, "sun_estimate") and not of_group(shapes, "sun_uncertainty")
    assert "no Sun estimate" in of_group(shapes, "text")[0].text
