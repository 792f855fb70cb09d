# SPDX-License-Identifier: Apache-2.0
"""One control cycle of the whole plant: rods, disturbances and wheels act together as each does alone."""

import math

import numpy as np
import pytest
from okeefe_spacecraft import okeefe_values

from css_common.actuator_sections import RODS, WHEELS
from css_common.attitude import mrp_to_dcm
from css_common.mission_section import MISSION
from css_common.random_streams import random_key
from css_common.sections import SPACECRAFT
from css_environment.ephemeris import EnvironmentState
from css_sim import disturbances, initial_conditions
from css_sim.rigid_body import RotationState, propagate
from css_sim.spacecraft import advance, rod_dipole, spacecraft

TABLE = MISSION + SPACECRAFT + WHEELS + RODS + disturbances.PARAMETERS + initial_conditions.PARAMETERS
IDENTITY = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
ENVIRONMENT = EnvironmentState(
    (6.778e6, 1e5, -2e5), (100.0, 5.4e3, 5.4e3), (0.0, 0.6, 0.8), 0.97, 1.0, (1e-5, -2e-5, 3e-5), IDENTITY
)
KEY = random_key(1, 0)
STATE = RotationState((0.1, 0.2, -0.3), (0.02, -0.01, 0.03))
COMMAND = np.array([0.01, -0.02, 0.005, 0.0])


def build(**changes):
    return spacecraft(okeefe_values(TABLE, **changes), KEY)


def fly(craft, rods=(), steps=1):
    """State and wheel momenta after some cycles of 0.1 s."""
    state, momentum, applied = STATE, np.array([0.1, -0.1, 0.05, 0.0]), np.zeros(4)
    rods = np.array(rods, dtype=float)
    for _ in range(steps):
        state, *_ = advance(craft, state, momentum, COMMAND, rods, ENVIRONMENT, 0.1, applied)
    return state, momentum


def test_without_rods_and_disturbances_it_is_the_rigid_body():
    craft = build()
    momentum = np.array([0.1, -0.1, 0.05, 0.0])
    expected, *_ = propagate(craft.body, STATE, momentum, COMMAND, (0.0, 0.0, 0.0), 0.1, np.zeros(4))
    state, flown = fly(craft)
    assert state == expected
    assert np.array_equal(flown, momentum)
    # without rods their commands have nothing to act on
    assert not craft.disturbed and craft.rod_axes_b.shape == (0, 3)


def test_rods_turn_the_body_across_the_field():
    craft = build(rods__fitted=True)
    dipole = np.array([1.0, -2.0, 0.5])
    field_b = np.array(mrp_to_dcm(STATE.sigma_bn)) @ ENVIRONMENT.field_n
    torque = tuple(np.cross(dipole, field_b).tolist())
    momentum = np.array([0.1, -0.1, 0.05, 0.0])
    expected, *_ = propagate(craft.body, STATE, momentum, COMMAND, torque, 0.1, np.zeros(4))
    state, _ = fly(craft, dipole)
    np.testing.assert_allclose(state.omega_bn_b, expected.omega_bn_b, atol=1e-17)


def test_a_residual_dipole_is_a_rod_that_never_changes():
    by_rod, _ = fly(build(rods__fitted=True), [0.3, -0.2, 0.1], 50)
    residual, _ = fly(build(disturbances__dipole=[0.3, -0.2, 0.1]), (), 50)
    np.testing.assert_allclose(by_rod.omega_bn_b, residual.omega_bn_b, rtol=1e-13)
    np.testing.assert_allclose(by_rod.sigma_bn, residual.sigma_bn, rtol=1e-13)


def test_rod_commands_are_limited_and_numbers():
    axes = np.array([[1.0, 0, 0], [0, math.sqrt(0.5), math.sqrt(0.5)]])
    np.testing.assert_allclose(rod_dipole(axes, np.full(2, 20.0), np.array([5.0, -2.0])), [5.0, -(2**0.5), -(2**0.5)])
    np.testing.assert_allclose(rod_dipole(axes, np.full(2, 20.0), np.array([-50.0, math.nan])), [-20.0, 0.0, 0.0])
    np.testing.assert_allclose(rod_dipole(axes, np.full(2, 20.0), np.array([math.inf, 0.0])), [20.0, 0.0, 0.0])


@pytest.mark.parametrize(
    "changes", [{"disturbances__gravity_gradient": True}, {"disturbances__dipole": [0.1, 0.0, 0.0]}]
)
def test_disturbances_move_the_body_and_nothing_else(changes):
    craft = build(**changes)
    dcm = mrp_to_dcm(STATE.sigma_bn)
    torque = disturbances.disturbance_torque(craft.disturbances, craft.body.inertia, dcm, ENVIRONMENT)
    momentum = np.array([0.1, -0.1, 0.05, 0.0])
    expected, *_ = propagate(craft.body, STATE, momentum, COMMAND, torque, 0.1, np.zeros(4))
    disturbed, flown = fly(craft)
    assert np.array_equal(flown, momentum)
    np.testing.assert_allclose(disturbed.omega_bn_b, expected.omega_bn_b, atol=1e-17)
    assert disturbed != fly(build())[0]
