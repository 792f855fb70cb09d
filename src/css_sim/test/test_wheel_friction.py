# SPDX-License-Identifier: Apache-2.0
"""Friction of the wheels: closed forms of one wheel, momentum of wheel and body, what holds a wheel, dispersion."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from css_common.attitude import mrp_to_dcm
from css_common.mission import MissionError, load_mission
from css_common.random_streams import random_key
from css_sim.rigid_body import RotationState, propagate, rigid_body, wheel_momentum_at_speed, wheel_speed
from css_sim.wheel_friction import Friction, dispersed_friction, shaft_torque

INERTIA = np.diag([10.5, 8.0, 6.75])
R = math.sqrt(0.5)
AXES = [0, R, R, 0, R, -R, R, -R, 0, -R, -R, 0]
ZERO = (0.0, 0.0, 0.0)
COULOMB, VISCOUS = 5e-4, 2e-5


def one_wheel(coulomb, viscous, max_speed_rpm=6000.0):
    return rigid_body(INERTIA, [0, 0, 1], 0.001, 0.03, max_speed_rpm, wheel_friction=(coulomb, viscous))


def spun(body, speeds):
    return np.array([wheel_momentum_at_speed(w, ZERO, s) for w, s in zip(body.wheels, speeds, strict=True)])


def coast(body, momentum, steps, motor=0.0, dt=0.1, state=None):
    """State, speed of the first wheel after each step."""
    state = RotationState(ZERO, ZERO) if state is None else state
    command, applied, speeds = np.full(len(momentum), motor), np.zeros(len(momentum)), []
    for _ in range(steps):
        state, _, _ = propagate(body, state, momentum, command, ZERO, dt, applied)
        speeds.append(wheel_speed(body.wheels[0], state.omega_bn_b, momentum[0]))
    return state, np.array(speeds)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_viscous_friction_is_an_exponential(sign):
    body = one_wheel(0.0, VISCOUS)
    _, speeds = coast(body, spun(body, [sign * 200.0]), 600)
    rate = VISCOUS * (1.0 / 0.001 + 1.0 / 6.75)
    np.testing.assert_allclose(speeds, sign * 200.0 * np.exp(-rate * 0.1 * np.arange(1, 601)), rtol=1e-10)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_coulomb_friction_slows_evenly_and_then_holds(sign):
    body = one_wheel(COULOMB, 0.0)
    deceleration = COULOMB * (1.0 / 0.001 + 1.0 / 6.75)
    momentum = spun(body, [sign * 10.0])
    _, speeds = coast(body, momentum, 300)
    expected = sign * np.maximum(10.0 - deceleration * 0.1 * np.arange(1, 301), 0.0)
    np.testing.assert_allclose(speeds, expected, atol=1e-10)


def test_a_motor_below_the_friction_does_not_move_a_wheel_at_rest():
    body = one_wheel(COULOMB, VISCOUS)
    state, speeds = coast(body, spun(body, [0.0]), 50, motor=0.9 * COULOMB)
    np.testing.assert_allclose(speeds, 0.0, atol=1e-12)
    assert np.linalg.norm(state.omega_bn_b) < 1e-15
    _, speeds = coast(body, spun(body, [0.0]), 1, motor=1.1 * COULOMB)
    assert speeds[0] == pytest.approx(0.1 * COULOMB * (1.0 / 0.001 + 1.0 / 6.75) * 0.1, rel=1e-3)


def test_a_held_speed_takes_a_motor_torque_of_the_friction():
    body = one_wheel(COULOMB, VISCOUS)
    _, speeds = coast(body, spun(body, [-150.0]), 100, motor=-(COULOMB + 150.0 * VISCOUS))
    np.testing.assert_allclose(speeds, -150.0, atol=1e-9)


def test_body_and_wheels_keep_their_momentum_and_only_lose_energy():
    body = rigid_body(INERTIA, AXES, 0.001, wheel_friction=(COULOMB, [VISCOUS, 2 * VISCOUS, 0.0, VISCOUS]))
    state, momentum = RotationState((0.3, -0.4, 0.2), (0.02, -0.01, 0.03)), spun(body, [300.0, -200.0, 100.0, 20.0])
    axes = np.array([body.wheels["gx"], body.wheels["gy"], body.wheels["gz"]])

    def total(state):
        h_b = INERTIA @ state.omega_bn_b + axes @ momentum
        return np.array(mrp_to_dcm(state.sigma_bn)).T @ h_b

    def energy(state):
        omega = np.array(state.omega_bn_b)
        return 0.5 * omega @ INERTIA @ omega + 0.5 * np.sum(momentum**2 / 0.001)

    before, energies = total(state), [energy(state)]
    for _ in range(40):
        state, _ = coast(body, momentum, 100, state=state)
        energies.append(energy(state))
    np.testing.assert_allclose(total(state), before, atol=1e-9)
    assert np.all(np.diff(energies) < 0.0) and energies[-1] < 0.7 * energies[0]


def test_motion_is_that_of_another_integrator():
    """Friction turns the body: the equations of motion with matrices, by scipy's DOP853, while no wheel reverses."""
    viscous = np.array([VISCOUS, 2 * VISCOUS, 3 * VISCOUS, VISCOUS])
    body = rigid_body(INERTIA, AXES, 0.001, wheel_friction=(COULOMB, viscous))
    start, momentum = RotationState(ZERO, (0.01, -0.02, 0.01)), spun(body, [300.0, -200.0, 250.0, -300.0])
    axes = np.array([body.wheels["gx"], body.wheels["gy"], body.wheels["gz"]])

    def derivative(_, x):
        w, h = x[:3], x[3:]
        speed = h / 0.001 - axes.T @ w
        on_wheel = -COULOMB * np.sign(speed) - viscous * speed
        w_dot = np.linalg.solve(INERTIA, -axes @ on_wheel - np.cross(w, INERTIA @ w + axes @ h))
        return np.concatenate([w_dot, on_wheel])

    first = np.concatenate([start.omega_bn_b, momentum])
    exact = solve_ivp(derivative, (0.0, 20.0), first, "DOP853", rtol=1e-11, atol=1e-13).y[:, -1]
    state, _ = coast(body, momentum, 200, state=start)
    # friction of a cycle is that of the body rate at its start
    np.testing.assert_allclose(state.omega_bn_b, exact[:3], atol=2e-6)
    np.testing.assert_allclose(momentum, exact[3:], atol=2e-6)
    turned = np.linalg.norm(np.array(start.omega_bn_b) - exact[:3])
    assert turned > 5e-3


def test_a_wheel_at_its_limit_may_be_held_there_against_friction():
    body = one_wheel(COULOMB, VISCOUS, max_speed_rpm=60.0)
    _, speeds = coast(body, spun(body, [6.0]), 100, motor=0.01)
    np.testing.assert_allclose(speeds[10:], 2.0 * math.pi, rtol=1e-9)


@pytest.mark.parametrize("speed", [-3.0, -1e-9, 0.0, 1e-9, 3.0])
@pytest.mark.parametrize("viscous", [0.0, VISCOUS, 10.0])
def test_friction_never_turns_a_wheel_round(speed, viscous):
    for coulomb in (0.0, 1e-4, 0.5):
        end = speed + 1000.0 * 0.1 * shaft_torque(coulomb, viscous, 0.0, speed, 1000.0, 0.1)
        assert end * speed >= 0.0 and abs(end) <= abs(speed)


def test_wheels_differ_from_case_to_case():
    p = Friction(COULOMB, VISCOUS, 0.1)
    drawn = np.array([dispersed_friction(p, random_key(1, case), 4) for case in range(1000)])
    factor = drawn[:, 0] / COULOMB
    np.testing.assert_allclose(factor, drawn[:, 1] / VISCOUS)
    assert abs(factor.mean() - 1.0) < 0.01 and abs(factor.std() - 0.1) < 0.006
    assert abs(np.corrcoef(factor[:, 0], factor[:, 1])[0, 1]) < 0.1
    np.testing.assert_array_equal(dispersed_friction(Friction(COULOMB, VISCOUS, 0.0), random_key(1, 5), 3)[0], COULOMB)


def test_friction_that_no_motor_overcomes_is_refused():
    load_mission("okeefe_2013", ["dynamics.friction.coulomb=0.029"])
    with pytest.raises(MissionError, match=r"friction.coulomb: 0\.03 given, expected less than wheels.max_torque"):
        load_mission("okeefe_2013", ["dynamics.friction.coulomb=0.03"])
