# SPDX-License-Identifier: Apache-2.0
"""Motion of the coning payload: Euler's equations integrated elsewhere, conserved quantities, deployments."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from spinning import FLIGHT, STEADY, motion_of, sun_angles, sun_over_andoya

from css_sim.spinning_payload import inertia_ratio, payload_state

HALF_ANGLE = math.radians(6.445)


def state_at(motion, t):
    state = payload_state(motion, t)
    return np.array(state.dcm_bn), np.array(state.omega_bn_b)


def test_the_stated_spin_and_coning_need_an_inertia_ratio_of_0_70():
    assert inertia_ratio(5.45, 0.2618, HALF_ANGLE) == pytest.approx(0.6995, abs=1e-4)


def test_motion_solves_eulers_equations():
    """An independent integration of a body with the implied moments of inertia, without torque, over 20 s."""
    motion = motion_of(**STEADY)
    ratio = inertia_ratio(5.45, 0.2618, HALF_ANGLE)
    inertia = np.array([1.0, 1.0, ratio])
    dcm, omega = state_at(motion, 0.0)

    def derivative(_, x):
        w = x[9:]
        skew = np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])
        return np.concatenate(((-skew @ x[:9].reshape(3, 3)).ravel(), -np.cross(w, inertia * w) / inertia))

    end = solve_ivp(derivative, (0.0, 20.0), np.concatenate((dcm.ravel(), omega)), "DOP853", rtol=1e-12, atol=1e-12)
    dcm, omega = state_at(motion, 20.0)
    np.testing.assert_allclose(end.y[:9, -1].reshape(3, 3), dcm, atol=1e-8)
    np.testing.assert_allclose(end.y[9:, -1], omega, atol=1e-7)


@settings(max_examples=60, deadline=None)
@given(t=st.floats(0.01, 399.0), case=st.integers(0, 1000))
def test_the_rate_is_the_derivative_of_the_attitude_also_under_drift_and_flat_spin(t, case):
    motion = motion_of(case, **FLIGHT, payload__final_coning_period=0.2595)
    h = 1e-5
    edges = np.array([62.19, 66.17, 69.18, 357.0, 357.0 + (85.0 - 6.445) / 4.0])
    if np.min(np.abs(edges - t)) < 2 * h:
        return
    before, after = state_at(motion, t - h)[0], state_at(motion, t + h)[0]
    dcm, omega = state_at(motion, t)
    turn = -(after - before) / (2.0 * h) @ dcm.T  # [omega x]
    np.testing.assert_allclose([turn[2, 1], turn[0, 2], turn[1, 0]], omega, atol=2e-5)
    np.testing.assert_allclose(dcm @ dcm.T, np.eye(3), atol=1e-12)


@pytest.mark.parametrize("edge", [62.19, 66.17, 69.18, 357.0])
def test_the_attitude_goes_on_through_a_deployment(edge):
    motion = motion_of(3, **FLIGHT)
    np.testing.assert_allclose(state_at(motion, edge - 1e-9)[0], state_at(motion, edge)[0], atol=1e-6)


def momentum_direction(motion, t, ratio):
    dcm, omega = state_at(motion, t)
    h_n = dcm.T @ (np.array([1.0, 1.0, ratio]) * omega)
    return h_n / np.linalg.norm(h_n)


def test_the_boom_deployment_leaves_the_angular_momentum_where_it_was():
    """Booms change moments of inertia, not momentum; a separation kicks."""
    motion = motion_of(**FLIGHT)
    before = inertia_ratio(6.0, 0.2529, HALF_ANGLE)
    after = inertia_ratio(5.45, 0.2618, HALF_ANGLE)
    h = momentum_direction(motion, 70.0, after)
    np.testing.assert_allclose(momentum_direction(motion, 300.0, after), h, atol=1e-9)
    np.testing.assert_allclose(momentum_direction(motion, 68.0, before), h, atol=1e-9)
    first = inertia_ratio(6.0, 0.65, math.radians(0.4))
    kick = math.degrees(math.acos(momentum_direction(motion, 60.0, first) @ h))
    assert 4.0 < kick < 8.0


def test_sun_angle_swings_by_the_full_coning_angle_with_the_coning_period():
    motion, sun_n = motion_of(**STEADY), sun_over_andoya()
    t = np.arange(0.0, 26.18, 0.2618 / 64)
    angle = sun_angles(motion, t, sun_n)
    assert np.degrees(np.ptp(angle)) == pytest.approx(12.89, abs=0.02)
    np.testing.assert_allclose(angle[64:], angle[:-64], atol=1e-9)


def test_the_flat_spin_ends_across_the_momentum():
    motion = motion_of(**FLIGHT)
    after = inertia_ratio(5.45, 0.2618, HALF_ANGLE)
    h = momentum_direction(motion, 300.0, after)
    for t in (380.0, 390.0):
        axis = state_at(motion, t)[0][2]
        assert math.degrees(math.acos(axis @ h)) == pytest.approx(85.0, abs=1e-6)
