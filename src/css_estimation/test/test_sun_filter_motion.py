# SPDX-License-Identifier: Apache-2.0
"""How attitude, rate and covariance of the Sun filter go on: conserved quantities, differences of the motion itself."""

import numpy as np
import pytest
from okeefe_spacecraft import okeefe_values

from css_common.attitude import rotation_vector_to_dcm
from css_common.matrices import scaled, skew, sum_of
from css_common.vectors import mat3, matmul
from css_estimation.nodes.sun_filter import SunFilter
from css_estimation.sun.sun_heading import UNAIDED
from css_estimation.sun_filter import sun_filter
from css_estimation.sun_filter.memory import GAIN, RATE, SCALE, THETA, X_RATE, X_SCALE, dcm_of, new_memory, set_dcm
from css_estimation.sun_filter.motion import (
    RATE_BY_GYRO,
    RATE_BY_MOMENTUM,
    RATE_BY_WALK,
    begin_rate,
    change_rate,
    fade,
    go_on,
    rate_model,
    wheel_momentum,
)

P = sun_filter.parameters(okeefe_values(SunFilter.table())).motion
QUIET = P._replace(gyro_noise=0.0, torque=0.0, acceleration=0.0, anisotropy=0.0)
MODELS = pytest.mark.parametrize("model", [RATE_BY_GYRO, RATE_BY_MOMENTUM, RATE_BY_WALK])
GYRO_B, WHEELS_B, DT = (0.02, -0.01, 0.03), (0.05, 0.02, -0.08), 0.1
INERTIA = np.array(P.inertia)
NOWHERE = (0.0, 0.0, 0.0)


def test_matrices():
    a, b = np.random.default_rng(1).normal(size=(2, 3, 3))
    ta, tb = mat3(a), mat3(b)
    v, w = a[0], b[0]
    np.testing.assert_allclose(np.array(skew(tuple(v))) @ w, np.cross(v, w), atol=1e-15)
    np.testing.assert_allclose(np.array(scaled(2.0, ta)), 2.0 * a)
    np.testing.assert_allclose(np.array(sum_of(ta, tb)), a + b)


def start(model):
    """Estimate and covariance of a turned body whose rate is (0.02, -0.01, 0.03) rad/s less a little."""
    memory = new_memory(8)
    x, covariance = memory.estimates[0], memory.covariances[0]
    set_dcm(x, rotation_vector_to_dcm((0.3, -0.8, 0.5)))
    begin_rate(P, model, (0.018, -0.012, 0.029), 1e-6, WHEELS_B, x, covariance)
    return x, covariance


def moved(model, x, states=GAIN + 8):
    """The estimate one step later."""
    x = x.copy()
    go_on(QUIET, model, GYRO_B, WHEELS_B, NOWHERE, DT, states, x, np.zeros((states, states)))
    return x


def shifted(x, error):
    """The true state of an estimate with errors of attitude and rate (6,)."""
    x = x.copy()
    set_dcm(x, matmul(dcm_of(x), rotation_vector_to_dcm(tuple(error[:3]))))
    x[X_RATE : X_RATE + 3] += error[3:]
    return x


def error_of(true, estimated):
    """The six errors of an estimate."""
    turn = np.array(dcm_of(estimated)).T @ np.array(dcm_of(true))
    theta = 0.5 * np.array([turn[1, 2] - turn[2, 1], turn[2, 0] - turn[0, 2], turn[0, 1] - turn[1, 0]])
    return np.concatenate([theta, true[X_RATE : X_RATE + 3] - estimated[X_RATE : X_RATE + 3]])


@MODELS
def test_the_covariance_goes_on_as_small_errors_do(model):
    x, covariance = start(model)
    dice = np.random.default_rng(2)
    root = dice.normal(size=(6, 6)) * np.array([1e-2] * 3 + [1e-3] * 3)[:, None]
    covariance[:6, :6] = root @ root.T
    before, after = covariance[:6, :6].copy(), moved(model, x)
    step = 1e-5
    jacobian = np.column_stack([error_of(moved(model, shifted(x, step * unit)), after) / step for unit in np.eye(6)])
    go_on(QUIET, model, GYRO_B, WHEELS_B, NOWHERE, DT, GAIN + 8, x, covariance)
    np.testing.assert_allclose(covariance[:6, :6], jacobian @ before @ jacobian.T, rtol=2e-3, atol=2e-9)


def test_momentum_is_conserved_in_n_and_the_rate_follows_the_wheels():
    x, covariance = start(RATE_BY_MOMENTUM)
    momentum_n = np.array(dcm_of(x)).T @ x[X_RATE : X_RATE + 3]
    for k in range(1000):
        wheels_b = tuple(np.array(WHEELS_B) * np.cos(0.01 * k))
        omega = go_on(P, RATE_BY_MOMENTUM, GYRO_B, wheels_b, NOWHERE, DT, GAIN + 8, x, covariance)
    np.testing.assert_allclose(np.array(dcm_of(x)).T @ x[X_RATE : X_RATE + 3], momentum_n, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(INERTIA @ omega + wheels_b, x[X_RATE : X_RATE + 3], rtol=2e-3)


def test_a_free_body_turns_as_euler_says():
    """Against a fine integration of w' = -J^-1 (w x J w)."""
    x, covariance = start(RATE_BY_MOMENTUM)
    begin_rate(P, RATE_BY_MOMENTUM, (0.05, -0.02, 0.04), 1e-6, (0.0, 0.0, 0.0), x, covariance)
    w, fine = np.array([0.05, -0.02, 0.04]), 2000
    for _ in range(fine):
        middle = w - 0.5 * (100.0 / fine) * np.linalg.solve(INERTIA, np.cross(w, INERTIA @ w))
        w = w - (100.0 / fine) * np.linalg.solve(INERTIA, np.cross(middle, INERTIA @ middle))
    for _ in range(1000):
        go_on(P, RATE_BY_MOMENTUM, GYRO_B, (0.0, 0.0, 0.0), NOWHERE, DT, GAIN + 8, x, covariance)
    np.testing.assert_allclose(np.linalg.solve(INERTIA, x[X_RATE : X_RATE + 3]), w, rtol=1e-4)


def test_gravity_turns_the_momentum_by_its_torque_once_it_is_reckoned_with():
    r_n = (4.0e6, -3.0e6, 4.6e6)
    changes = []
    for asked in (False, True):
        x, covariance = start(RATE_BY_MOMENTUM)
        dcm_bn, momentum_b = np.array(dcm_of(x)), x[X_RATE : X_RATE + 3].copy()
        p = QUIET._replace(gravity_gradient=asked)
        go_on(p, RATE_BY_MOMENTUM, GYRO_B, WHEELS_B, r_n, DT, GAIN + 8, x, covariance)
        changes.append(np.array(dcm_of(x)).T @ x[X_RATE : X_RATE + 3] - dcm_bn.T @ momentum_b)
    nadir_b = -dcm_bn @ r_n / np.linalg.norm(r_n)
    torque_b = 3.0 * 3.986004418e14 / np.linalg.norm(r_n) ** 3 * np.cross(nadir_b, INERTIA @ nadir_b)
    np.testing.assert_allclose(changes[0], 0.0, atol=1e-15)
    np.testing.assert_allclose(changes[1], DT * dcm_bn.T @ torque_b, rtol=1e-6)
    assert np.linalg.norm(torque_b) > 1e-7


def test_an_unstable_spin_leaves_the_covariance_symmetric():
    """What rounding makes unequal grows as the motion does, and no reading takes it away again."""
    x, covariance = start(RATE_BY_MOMENTUM)
    axes = np.linalg.eigh(INERTIA)[1]
    omega = tuple(0.3 * axes[:, 1] + 1e-3 * axes[:, 0])
    begin_rate(P, RATE_BY_MOMENTUM, omega, 1e-6, (0.0, 0.0, 0.0), x, covariance)
    h = np.zeros(len(covariance))
    for k in range(4000):
        go_on(QUIET, RATE_BY_MOMENTUM, GYRO_B, (0.0, 0.0, 0.0), NOWHERE, 0.25, GAIN + 8, x, covariance)
        # one direction at a time is measured to 3 mrad
        h[THETA : THETA + 3] = 0.0
        h[THETA + k % 3] = 1.0
        gained = covariance @ h
        covariance -= np.outer(gained, gained) / (h @ gained + 1e-5)
    assert np.abs(covariance - covariance.T).max() <= 1e-9 * np.abs(covariance).max()
    assert np.linalg.eigvalsh(covariance[:6, :6]).min() > -1e-12


@MODELS
@pytest.mark.parametrize("after", [RATE_BY_GYRO, RATE_BY_MOMENTUM, RATE_BY_WALK])
def test_another_source_of_the_rate_begins_with_the_rate_of_the_last(model, after):
    x, covariance = start(model)
    omega = go_on(P, model, GYRO_B, WHEELS_B, NOWHERE, DT, GAIN + 8, x, covariance)
    change_rate(P, model, after, omega, WHEELS_B, x, covariance)
    rate = covariance[RATE : RATE + 3, RATE : RATE + 3]
    assert np.linalg.eigvalsh(rate).min() > 0.0 and not covariance[THETA : THETA + 3, RATE : RATE + 3].any()
    if after == RATE_BY_GYRO:
        assert not x[X_RATE : X_RATE + 3].any() and rate[0, 0] == P.gyro_bias
        return
    now = go_on(P, after, GYRO_B, WHEELS_B, NOWHERE, 1e-9, GAIN + 8, x, covariance)
    np.testing.assert_allclose(now, omega, atol=1e-9)


def test_the_best_source_of_the_rate():
    assert rate_model(P, True, True) == rate_model(P, True, False) == RATE_BY_GYRO
    assert rate_model(P, False, True) == RATE_BY_MOMENTUM
    assert rate_model(P, False, False) == rate_model(P._replace(knows_momentum=False), False, True) == RATE_BY_WALK


def test_speeds_that_are_none_are_no_momentum():
    speeds = np.array([10.0, -20.0, 30.0, 40.0])
    momentum_b, known = wheel_momentum(P, UNAIDED._replace(wheel_speeds=speeds, wheels_valid=True))
    axes = np.array([[0, 1, 1], [0, 1, -1], [1, -1, 0], [-1, -1, 0]]) / np.sqrt(2.0)
    assert known
    np.testing.assert_allclose(momentum_b, 0.001 * speeds @ axes)
    for broken in (speeds[:3], np.array([np.nan, 0.0, 0.0, 0.0]), np.array([0.0, np.inf, 0.0, 0.0])):
        assert wheel_momentum(P, UNAIDED._replace(wheel_speeds=broken, wheels_valid=True)) == ((0.0, 0.0, 0.0), False)
    assert not wheel_momentum(P, UNAIDED._replace(wheel_speeds=speeds))[1]
    assert wheel_momentum(P._replace(has_wheels=False), UNAIDED) == ((0.0, 0.0, 0.0), True)


def test_what_fades_keeps_its_variance():
    """A Gauss-Markov process of first order: stationary at its variance, correlated over its time."""
    x, covariance = start(RATE_BY_GYRO)
    states = GAIN + 8
    covariance[SCALE, SCALE], x[X_SCALE] = 0.04, 1.0
    covariance[SCALE, 0] = covariance[0, SCALE] = 0.01
    for _ in range(100):
        fade(SCALE, X_SCALE, 1, 10.0, 0.04, 0.1, states, x, covariance)
    assert covariance[SCALE, SCALE] == pytest.approx(0.04)
    assert x[X_SCALE] == pytest.approx(np.exp(-1.0)) and covariance[0, SCALE] == pytest.approx(0.01 * np.exp(-1.0))
