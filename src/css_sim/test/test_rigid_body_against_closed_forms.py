# SPDX-License-Identifier: Apache-2.0
"""Rigid body with wheels: conserved quantities, closed-form motion, an independent integrator, limits."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.linalg import norm
from scipy.integrate import solve_ivp

from css_common.attitude import mrp_to_dcm
from css_sim.rigid_body import (
    MOST_STEPS,
    RotationState,
    integration_steps,
    propagate,
    rigid_body,
    wheel_momentum_at_speed,
    wheel_speed,
)

R = math.sqrt(0.5)
INERTIA = np.diag([10.5, 8.0, 6.75])
# O'Keefe & Schaub 2013: the columns of [Gs]
AXES = [0, R, R, 0, R, -R, R, -R, 0, -R, -R, 0]
ZERO = (0.0, 0.0, 0.0)
AT_REST = RotationState(ZERO, ZERO)
PLANT = rigid_body(INERTIA, AXES, 0.001, 0.030, 6000.0)
FREE_BODY = rigid_body(INERTIA)
OFF_DIAGONAL = np.array([[10.5, 0.7, -0.4], [0.7, 8.0, 0.3], [-0.4, 0.3, 6.75]])


def axes_of(p):
    """[Gs], the spin axes as columns."""
    return np.array([p.wheels["gx"], p.wheels["gy"], p.wheels["gz"]])


def fly(p, state, momentum, command, torque, dt, steps):
    """State after `steps` steps under constant torques; momentum is advanced in place."""
    applied = np.zeros(len(momentum))
    for _ in range(steps):
        state, _, _ = propagate(p, state, momentum, command, torque, dt, applied)
    return state


def momentum_n(p, state, momentum):
    """Angular momentum of body and wheels in the inertial frame."""
    h_b = np.array(p.inertia) @ state.omega_bn_b + axes_of(p) @ momentum
    return np.array(mrp_to_dcm(state.sigma_bn)).T @ h_b


def kinetic_energy(p, state, momentum):
    omega = np.array(state.omega_bn_b)
    return 0.5 * omega @ np.array(p.inertia) @ omega + 0.5 * np.sum(momentum**2 / p.wheels["inertia"])


def cross_matrix(v):
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def exact_motion(p, state, momentum, command, torque, duration):
    """The same equations written with matrices and integrated by scipy's DOP853, no shadow switch."""
    inertia, axes = np.array(p.inertia), axes_of(p)

    def derivative(_, x):
        s, w, h = x[:3], x[3:6], x[6:]
        s_dot = 0.25 * ((1 - s @ s) * np.eye(3) + 2 * cross_matrix(s) + 2 * np.outer(s, s)) @ w
        w_dot = np.linalg.solve(inertia, torque - axes @ command - np.cross(w, inertia @ w + axes @ h))
        return np.concatenate([s_dot, w_dot, command])

    start = np.concatenate([state.sigma_bn, state.omega_bn_b, momentum])
    end = solve_ivp(derivative, (0, duration), start, method="DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
    return end[:3], end[3:6], end[6:]


def test_free_motion_keeps_inertial_momentum_and_energy():
    state = RotationState((0.3, -0.4, 0.2), (0.03, -0.02, 0.035))
    momentum = np.array([0.1, -0.2, 0.05, 0.15])
    h_start, e_start = momentum_n(PLANT, state, momentum), kinetic_energy(PLANT, state, momentum)
    state = fly(PLANT, state, momentum, np.zeros(4), ZERO, 0.1, 55_500)
    # one orbit at 10 Hz; RK4 errors of (w dt)^5 per step leave parts in 1e10
    np.testing.assert_allclose(momentum_n(PLANT, state, momentum), h_start, atol=1e-9)
    assert kinetic_energy(PLANT, state, momentum) == pytest.approx(e_start, rel=1e-9)


def test_wheel_torque_alone_keeps_inertial_momentum_and_feeds_energy():
    state = RotationState((0.1, 0.2, -0.3), (0.01, 0.02, -0.015))
    momentum = np.zeros(4)
    command = np.array([0.02, -0.01, 0.005, 0.015])
    h_start = momentum_n(PLANT, state, momentum)
    energy, work, applied = kinetic_energy(PLANT, state, momentum), 0.0, np.zeros(4)
    start_energy = energy
    for _ in range(100):
        before = [wheel_speed(PLANT.wheels[i], state.omega_bn_b, momentum[i]) for i in range(4)]
        state, _, _ = propagate(PLANT, state, momentum, command, ZERO, 0.1, applied)
        after = [wheel_speed(PLANT.wheels[i], state.omega_bn_b, momentum[i]) for i in range(4)]
        # motor power is torque times relative speed; the trapezium is exact to the curvature of the speed
        work += 0.1 * float(command @ (0.5 * (np.array(before) + after)))
    np.testing.assert_allclose(momentum_n(PLANT, state, momentum), h_start, atol=1e-12)
    assert kinetic_energy(PLANT, state, momentum) - start_energy == pytest.approx(work, rel=1e-6)


def test_axisymmetric_body_precesses_as_the_closed_form():
    axial, transverse = 6.0, 9.0
    p = rigid_body(np.diag([transverse, transverse, axial]))
    spin, nutation = 0.04, 0.015
    state = fly(p, RotationState(ZERO, (nutation, 0.0, spin)), np.zeros(0), np.zeros(0), ZERO, 0.1, 6000)
    phase = (axial - transverse) / transverse * spin * 600.0
    expected = (nutation * math.cos(phase), nutation * math.sin(phase), spin)
    np.testing.assert_allclose(state.omega_bn_b, expected, atol=1e-11)
    # the symmetry axis keeps its angle to the momentum
    h = momentum_n(p, state, np.zeros(0))
    axis_n = np.array(mrp_to_dcm(state.sigma_bn)).T @ [0, 0, 1]
    assert axis_n @ h / np.linalg.norm(h) == pytest.approx(
        axial * spin / math.hypot(axial * spin, transverse * nutation), abs=1e-11
    )


def test_spin_about_a_principal_axis_is_a_plain_rotation():
    rate, duration = 0.02, 400.0  # 8 rad: through the shadow switch and once around
    state = fly(FREE_BODY, RotationState(ZERO, (0.0, 0.0, rate)), np.zeros(0), np.zeros(0), ZERO, 0.1, 4000)
    angle = rate * duration
    expected = [
        [math.cos(angle), math.sin(angle), 0.0],
        [-math.sin(angle), math.cos(angle), 0.0],
        [0.0, 0.0, 1.0],
    ]
    np.testing.assert_allclose(np.array(mrp_to_dcm(state.sigma_bn)), expected, atol=1e-10)


def test_constant_torque_about_a_principal_axis():
    torque = 0.004
    state = fly(FREE_BODY, AT_REST, np.zeros(0), np.zeros(0), (torque, 0.0, 0.0), 0.1, 300)
    assert state.omega_bn_b[0] == pytest.approx(torque / 10.5 * 30.0, rel=1e-13)
    angle = 0.5 * torque / 10.5 * 30.0**2
    assert state.sigma_bn[0] == pytest.approx(math.tan(angle / 4), rel=1e-10)


def test_motor_torque_turns_body_against_wheel():
    momentum = np.zeros(1)
    p = rigid_body(INERTIA, [0, 0, 1])
    state = fly(p, AT_REST, momentum, np.array([0.02]), ZERO, 0.1, 50)
    assert state.omega_bn_b[2] == pytest.approx(-0.02 * 5.0 / 6.75, rel=1e-12)
    assert wheel_speed(p.wheels[0], state.omega_bn_b, momentum[0]) == pytest.approx(
        0.02 * 5.0 * (1 / 0.001 + 1 / 6.75), rel=1e-12
    )


@pytest.mark.parametrize("inertia", [INERTIA, OFF_DIAGONAL])
def test_agrees_with_an_independent_integrator(inertia):
    p = rigid_body(inertia, AXES)
    state = RotationState((0.2, -0.1, 0.15), (0.03, -0.025, 0.02))
    momentum = np.array([0.3, -0.1, 0.2, -0.25])
    command = np.array([0.01, -0.02, 0.015, 0.005])
    torque = (1e-3, -2e-3, 5e-4)
    sigma, omega, wheels = exact_motion(p, state, momentum.copy(), command, np.array(torque), 20.0)
    end = fly(p, state, momentum, command, torque, 0.1, 200)
    np.testing.assert_allclose(end.omega_bn_b, omega, atol=1e-11)
    np.testing.assert_allclose(end.sigma_bn, sigma, atol=1e-10)
    np.testing.assert_allclose(momentum, wheels, atol=1e-14)


def test_error_falls_with_the_fourth_power_of_the_step():
    state = RotationState((0.2, -0.1, 0.15), (0.5, -0.4, 0.3))
    command, torque = np.array([0.01, -0.02, 0.015, 0.005]), (1e-2, -2e-2, 5e-3)
    sigma, omega, _ = exact_motion(PLANT, state, np.zeros(4), command, np.array(torque), 2.0)
    errors = []
    for steps in (10, 20, 40):
        end = fly(PLANT, state, np.zeros(4), command, torque, 2.0 / steps, steps)
        errors.append(norm(np.subtract(end.omega_bn_b, omega)) + norm(end.sigma_bn - sigma))
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert np.all(orders > 3.7) and np.all(orders < 4.6)


def test_substeps_are_shorter_steps():
    state = RotationState((0.2, -0.1, 0.15), (0.5, -0.4, 0.3))
    command, torque = np.array([0.01, -0.02, 0.015, 0.005]), (1e-2, -2e-2, 5e-3)
    fine = fly(PLANT, state, np.zeros(4), command, torque, 0.1, 40)
    coarse = fly(PLANT._replace(substeps=4), state, np.zeros(4), command, torque, 0.4, 10)
    np.testing.assert_allclose(coarse.sigma_bn, fine.sigma_bn, atol=1e-13)
    np.testing.assert_allclose(coarse.omega_bn_b, fine.omega_bn_b, atol=1e-13)


def test_torque_beyond_the_limit_is_cut_and_flagged():
    applied, command = np.zeros(4), np.array([0.05, -0.03, -0.2, math.nan])
    _, torque_limited, speed_limited = propagate(PLANT, AT_REST, np.zeros(4), command, ZERO, 0.1, applied)
    np.testing.assert_array_equal(applied, [0.03, -0.03, -0.03, 0.0])
    assert torque_limited == 0b1101
    assert speed_limited == 0


def test_wheel_stops_exactly_at_its_speed_limit_and_leaves_it_freely():
    state = RotationState(ZERO, (0.01, 0.0, 0.0))
    limit = PLANT.wheels["max_speed"][0]
    momentum = np.array([wheel_momentum_at_speed(PLANT.wheels[0], state.omega_bn_b, limit - 1.0), 0, 0, 0])
    applied = np.zeros(4)
    state, _, limited = propagate(PLANT, state, momentum, np.array([0.03, 0, 0, 0]), ZERO, 0.1, applied)
    assert limited == 1
    assert 0 < applied[0] < 0.03
    assert wheel_speed(PLANT.wheels[0], state.omega_bn_b, momentum[0]) == pytest.approx(limit, rel=1e-11)
    state, _, limited = propagate(PLANT, state, momentum, np.array([-0.03, 0, 0, 0]), ZERO, 0.1, applied)
    assert limited == 0 and applied[0] == -0.03
    assert wheel_speed(PLANT.wheels[0], state.omega_bn_b, momentum[0]) < limit - 2.0


@pytest.mark.parametrize("wheel_inertia", [0.001, 0.05, 0.4])
def test_all_wheels_end_at_their_limits_however_heavy_they_are(wheel_inertia):
    """Each pass leaves the ratio of wheel to body inertia of the excess that it found: four leave its fourth power."""
    p = rigid_body(INERTIA, AXES, wheel_inertia, 100.0, 6000.0)
    limit, rise = p.wheels["max_speed"][0], 5.0
    # commands along one axis of the body, each of which alone would turn it: the cuts move one another's speeds
    state, torque = RotationState(ZERO, (0.01, -0.02, 0.005)), 10.0 * rise * wheel_inertia
    momentum = np.array([wheel_momentum_at_speed(w, state.omega_bn_b, limit - 1e-3) for w in p.wheels])
    command, applied = np.array([torque, torque, -torque, torque]), np.zeros(4)
    state, torque_limited, speed_limited = propagate(p, state, momentum, command, ZERO, 0.1, applied)
    speed = np.array([wheel_speed(p.wheels[i], state.omega_bn_b, momentum[i]) for i in range(4)])
    excess = np.abs(speed[[0, 1, 3]] - limit)
    assert torque_limited == 0 and speed_limited == 0b1011
    # the largest part of one wheel's cut that shows in another's speed
    axes = axes_of(p)
    coupling = wheel_inertia * np.abs(axes.T @ np.linalg.inv(INERTIA) @ axes)
    ratio = np.max(coupling.sum(axis=0) - np.diag(coupling)) + 1e-3
    assert excess.max() < rise * ratio**4 + 1e-9 * limit


bounded = st.floats(-1.0, 1.0)
triple = st.tuples(bounded, bounded, bounded)
quadruple = st.tuples(bounded, bounded, bounded, bounded)


@settings(max_examples=200, deadline=None)
@given(triple, triple, quadruple, quadruple, triple)
def test_invariants_hold_for_any_start_and_command(sigma, omega, speeds, command, torque):
    p = PLANT
    limits = p.wheels["max_speed"]
    omega = tuple(0.2 * w for w in omega)
    momentum = np.array([wheel_momentum_at_speed(p.wheels[i], omega, s * limits[i]) for i, s in enumerate(speeds)])
    before = momentum.copy()
    state = RotationState(sigma, omega)
    applied = np.zeros(4)
    end, torque_limited, speed_limited = propagate(
        p, state, momentum, 0.06 * np.array(command), tuple(0.01 * t for t in torque), 0.1, applied
    )
    assert np.linalg.norm(end.sigma_bn) <= 1.0 + 1e-12
    assert np.all(np.abs(applied) <= 0.030)
    np.testing.assert_allclose(momentum - before, 0.1 * applied, atol=1e-15)
    speed = [wheel_speed(p.wheels[i], end.omega_bn_b, momentum[i]) for i in range(4)]
    assert np.all(np.abs(speed) <= limits * (1 + 1e-9))
    assert torque_limited == sum(1 << i for i, u in enumerate(command) if abs(0.06 * u) > 0.030)
    for i in range(4):
        if speed_limited >> i & 1:
            # cutting one wheel after another moves the first again by the ratio of wheel to body inertia
            slack = 0.1 * 2 * 0.030 / 6.75
            assert limits[i] - slack <= abs(speed[i])


@pytest.mark.parametrize(("dt", "steps"), [(0.1, 1000), (1.0, 100), (60.0, 2)])
def test_a_fast_tumble_keeps_momentum_and_energy_at_any_period(dt, steps):
    # 99.7 deg/s lost a quarter of its rate in 100 s at a period of 1 s, and made thousands of it at 60 s
    start = RotationState((0.1, -0.2, 0.3), tuple(np.radians([60.0, -55.0, 57.0])))
    momentum = np.zeros(0)
    end = fly(FREE_BODY, start, momentum, np.zeros(0), ZERO, dt, steps)
    h_start, e_start = momentum_n(FREE_BODY, start, momentum), kinetic_energy(FREE_BODY, start, momentum)
    np.testing.assert_allclose(momentum_n(FREE_BODY, end, momentum), h_start, atol=1e-4 * float(norm(h_start)))
    assert kinetic_energy(FREE_BODY, end, momentum) == pytest.approx(e_start, rel=1e-4)


def test_motion_at_long_periods_is_that_of_an_independent_integrator():
    start = RotationState((0.0, 0.1, 0.0), (0.4, -0.3, 0.5))
    momentum = np.array([0.3, -0.2, 0.1, 0.4])
    command, torque = np.array([0.01, -0.02, 0.005, 0.0]), (1e-3, -2e-3, 5e-4)
    sigma, omega, wheels = exact_motion(PLANT, start, momentum.copy(), command, torque, 5.0)
    end = fly(PLANT, start, momentum, command, torque, 5.0, 1)
    np.testing.assert_allclose(end.omega_bn_b, omega, atol=1e-5)
    np.testing.assert_allclose(momentum, wheels, atol=1e-12)
    np.testing.assert_allclose(mrp_to_dcm(end.sigma_bn), mrp_to_dcm(tuple(sigma)), atol=1e-5)


@pytest.mark.parametrize(
    ("omega", "h_b", "torque", "dt", "steps"),
    [
        ((0.0, 0.0, 0.0), ZERO, ZERO, 60.0, 1),
        ((1.0, 0.0, 0.0), ZERO, ZERO, 0.149, 1),
        ((-1.0, 0.0, 0.0), ZERO, ZERO, 0.151, 2),
        ((0.0, 0.0, 0.0), (10.5, 0.0, 0.0), ZERO, 1.5, 10),
        ((0.0, 0.0, 0.0), ZERO, (0.0, 0.0, 6.75), 3.0, 60),
        ((1e9, 0.0, 0.0), ZERO, ZERO, 60.0, MOST_STEPS),
        ((math.nan, 0.0, 0.0), ZERO, ZERO, 60.0, MOST_STEPS),
        ((math.inf, 0.0, 0.0), ZERO, ZERO, 60.0, MOST_STEPS),
    ],
)
def test_steps_keep_the_angle_of_each_small(omega, h_b, torque, dt, steps):
    assert integration_steps(FREE_BODY, omega, h_b, torque, dt) == steps
    assert integration_steps(FREE_BODY._replace(substeps=7), omega, h_b, torque, dt) == max(7, steps)
