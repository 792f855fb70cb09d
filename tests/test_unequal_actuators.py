# SPDX-License-Identifier: Apache-2.0
"""Wheels and rods that differ: each within its own limit, momentum by its own inertia, in plant and control alike."""

import numpy as np
import pytest

from css_common.mission import MissionError, load_mission
from css_common.preflight import preflight
from css_common.random_streams import random_key
from css_sim.initial_conditions import dispersed_body
from sunpoint_control.torque_rods import limit_dipoles
from sunpoint_control.wheel_allocation import limit_torques, parameters, wheel_momentum

INERTIAS, TORQUES, SPEEDS = (0.001, 0.002, 0.001, 0.004), (0.03, 0.01, 0.02, 0.03), (6000.0, 3000.0, 6000.0, 4000.0)
UNEQUAL = tuple(
    f"wheels.{key}=" + ",".join(map(str, values))
    for key, values in (("inertias", INERTIAS), ("max_torques", TORQUES), ("max_speeds_rpm", SPEEDS))
)


def mission(*overrides):
    return load_mission("okeefe_2013", overrides)


def test_plant_and_control_have_the_same_wheels():
    m = mission(*UNEQUAL)
    plant = dispersed_body(m.node("dynamics").values, random_key(1, 0)).wheels
    known = parameters(m.node("mrp_control").values).wheels
    for key, expected in (
        ("inertia", INERTIAS),
        ("max_torque", TORQUES),
        ("max_speed", np.array(SPEEDS) * np.pi / 30.0),
    ):
        np.testing.assert_allclose(plant[key], expected, rtol=1e-14)
        np.testing.assert_allclose(known[key], expected, rtol=1e-14)


def test_equal_lists_are_the_common_value():
    lists = ("wheels.inertias=0.001,0.001,0.001,0.001", "wheels.max_torques=0.03,0.03,0.03,0.03")
    listed, common = (parameters(mission(*over).node("mrp_control").values) for over in (lists, ()))
    np.testing.assert_array_equal(listed.wheels, common.wheels)


def test_torques_keep_their_direction_until_each_is_within_its_limit():
    p = parameters(mission(*UNEQUAL).node("mrp_control").values)
    torques = np.array([0.02, 0.02, -0.03, 0.01])
    wanted = torques.copy()
    assert limit_torques(p, torques) == 0b0110
    np.testing.assert_allclose(torques, wanted * 0.5, rtol=1e-14)  # wheel 1 may give half of what it was asked for
    clipped = parameters(mission(*UNEQUAL, "mrp_control.wheel_saturation=clip").node("mrp_control").values)
    torques = wanted.copy()
    limit_torques(clipped, torques)
    np.testing.assert_allclose(torques, [0.02, 0.01, -0.02, 0.01])


def test_momentum_counts_each_inertia():
    p = parameters(mission(*UNEQUAL).node("mrp_control").values)
    axes, speeds, omega = mission().values.wheels.axes, np.array([100.0, -50.0, 20.0, 7.0]), np.array([0.1, -0.2, 0.05])
    expected = axes.T @ (np.array(INERTIAS) * (speeds + axes @ omega))
    np.testing.assert_allclose(wheel_momentum(p.wheels, speeds, tuple(omega.tolist())), expected, rtol=1e-12)


def test_dipoles_keep_their_direction_until_each_is_within_its_limit():
    dipoles = np.array([1.0, -4.0, 2.0])
    assert limit_dipoles(np.array([2.0, 2.0, 0.4]), dipoles) == 0b110
    np.testing.assert_allclose(dipoles, [0.2, -0.8, 0.4])


@pytest.mark.parametrize(
    ("override", "error"),
    [
        ("wheels.inertias=0.001,0.001", "2 given, expected one for each of 4 wheels"),
        ("rods.max_dipoles=1,2", "2 given, expected one for each of 3 rods"),
    ],
)
def test_what_does_not_fit_is_refused(override, error):
    with pytest.raises(MissionError, match=error):
        mission(override)


def test_the_slowest_wheel_bounds_the_momentum():
    (warning,) = preflight(mission("wheels.max_speeds_rpm=1000,6000,6000,6000"))
    assert "wheels.max_speed_rpm: 1000 given, expected at least 34" in warning
