# SPDX-License-Identifier: Apache-2.0
"""Propagation and update of the attitude filter's covariance against the equations in matrices."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from css_common.attitude import rotation_vector_to_dcm
from css_common.vectors import mat3
from css_estimation.sun.error_covariance import (
    CORRECTION,
    Block,
    Partials,
    attitude_block,
    begin_update,
    bound,
    covariance_of,
    fade,
    innovate,
    mix,
    neglected_variance,
    new_work,
    propagate,
    set_block,
    set_single,
    update,
)
from css_estimation.symmetric import inverse_form


@pytest.fixture
def rng():
    """Numbers of this test alone: they do not depend on which others run."""
    return np.random.default_rng(20130601)


def random_covariance(rng, n):
    a = rng.normal(size=(n, n)) * 0.1
    return a @ a.T + 1e-4 * np.eye(n)


def skew(w):
    return np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])


def test_propagation_is_the_solution_of_the_lyapunov_equation(rng):
    omega, dt, sv2, su2 = np.array([0.002, -0.003, 0.001]), 0.1, 1e-6, 1e-10
    p = random_covariance(rng, 6)
    f = np.block([[-skew(omega), -np.eye(3)], [np.zeros((3, 6))]])
    q = np.diag([sv2] * 3 + [su2] * 3)

    def rate(_, flat):
        m = flat.reshape(6, 6)
        return (f @ m + m @ f.T + q).ravel()

    expected = solve_ivp(rate, (0.0, dt), p.ravel(), rtol=1e-11, atol=1e-16).y[:, -1].reshape(6, 6)
    propagate(p, rotation_vector_to_dcm(tuple(dt * omega)), dt, sv2, su2, True)
    np.testing.assert_allclose(p, expected, rtol=0.0, atol=2e-4 * dt * np.abs(p).max())
    np.testing.assert_array_equal(p, p.T)


@pytest.mark.parametrize("dt", [0.1, 2.0])
def test_noise_alone_is_van_loans_integral(dt):
    """Of a body at rest the discrete noise is exact: every block of it, from the walk of the bias alone too."""
    f = np.block([[np.zeros((3, 3)), -np.eye(3)], [np.zeros((3, 6))]])
    identity = mat3(np.eye(3))
    for sv2, su2 in ((0.0, 1e-3), (1e-2, 0.0), (3e-3, 2e-3)):
        q = np.diag([sv2] * 3 + [su2] * 3)
        exponential = expm(dt * np.block([[-f, q], [np.zeros((6, 6)), f.T]]))
        p = np.zeros((6, 6))
        propagate(p, identity, dt, sv2, su2, True)
        np.testing.assert_allclose(p, exponential[6:, 6:].T @ exponential[:6, 6:], rtol=1e-12, atol=1e-18)


def test_an_error_of_the_bias_turns_the_attitude(rng):
    p = random_covariance(rng, 9)
    turn, dt = np.array(rotation_vector_to_dcm((0.1, 0.2, -0.1))), 2.0
    phi = np.eye(9)
    phi[:3, :3], phi[:3, 3:6] = turn, -dt * np.eye(3)
    expected = phi @ p @ phi.T
    propagate(p, mat3(turn), dt, 0.0, 0.0, True)
    np.testing.assert_allclose(p, expected, rtol=1e-12, atol=1e-15)


def test_without_gyro_the_bias_turns_nothing(rng):
    p = random_covariance(rng, 9)
    before = p.copy()
    turn = np.array(rotation_vector_to_dcm((0.1, 0.2, -0.1)))
    propagate(p, mat3(np.array(turn)), 2.0, 1e-3, 1e-8, False)
    np.testing.assert_allclose(p[:3, :3], turn @ before[:3, :3] @ turn.T + 2e-3 * np.eye(3), atol=1e-15)
    np.testing.assert_allclose(p[:3, 3:], turn @ before[:3, 3:], atol=1e-15)
    np.testing.assert_allclose(p[3:, 3:], before[3:, 3:] + np.diag([2e-8] * 3 + [0.0] * 3), atol=1e-15)


def numbers(rng, n, count):
    """Random measurements of attitude, and of two blocks of three and of two further errors each."""
    rows, partials = np.zeros((count, n)), []
    for k in range(count):
        rows[k, :3] = rng.normal(size=3)
        blocks = []
        for errors in (3, 2):
            first = int(rng.integers(6, n - 2)) if n > 6 else 0
            slopes = rng.normal(size=3)
            if n > 6:
                rows[k, first : first + errors] += slopes[:errors]
            blocks.append(Block(first, errors if n > 6 else 0, tuple(slopes.tolist())))
        partials.append(Partials(tuple(rows[k, :3].tolist()), *blocks))
    return rows, partials


@pytest.mark.parametrize("n", [6, 12])
def test_numbers_in_sequence_are_the_stacked_joseph_update(rng, n):
    p = random_covariance(rng, n)
    rows, partials = numbers(rng, n, 5)
    residuals, r = rng.normal(size=5), 0.01
    s = rows @ p @ rows.T + r * np.eye(5)
    k = p @ rows.T @ np.linalg.inv(s)
    a = np.eye(n) - k @ rows
    expected, correction = a @ p @ a.T + r * k @ k.T, k @ residuals
    nis = residuals @ np.linalg.solve(s, residuals)
    work, total = new_work(n), 0.0
    begin_update(work)
    for h, residual in zip(partials, residuals.tolist(), strict=True):
        innovation, variance = innovate(p, work, h, residual, r)
        update(p, work, innovation, variance, n)
        total += innovation**2 / variance
    np.testing.assert_allclose(p, expected, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(work[CORRECTION], correction, rtol=1e-9, atol=1e-12)
    assert total == pytest.approx(nis, rel=1e-9)


def test_considered_errors_keep_their_covariance_and_count_as_errors(rng):
    """K = (P_xx H_x^T + P_xc H_c^T) S^-1 with S of all errors; the considered ones are not corrected."""
    p = random_covariance(rng, 12)
    before = p.copy()
    rows, (h,) = numbers(rng, 12, 1)
    row, residual, r = rows[0], 0.7, 0.01
    s = row @ before @ row + r
    k = before @ row / s
    k[6:] = 0.0
    a = np.eye(12) - np.outer(k, row)
    work = new_work(12)
    begin_update(work)
    innovation, variance = innovate(p, work, h, residual, r)
    update(p, work, innovation, variance, 6)
    np.testing.assert_allclose(p, a @ before @ a.T + r * np.outer(k, k), atol=1e-14)
    np.testing.assert_array_equal(p[6:, 6:], before[6:, 6:])
    np.testing.assert_allclose(work[CORRECTION], k * residual, atol=1e-15)


def test_the_covariance_of_two_numbers(rng):
    p = random_covariance(rng, 15)
    rows, (a, b) = numbers(rng, 15, 2)
    assert covariance_of(p, a, b) == pytest.approx(rows[0] @ p @ rows[1], rel=1e-12)
    assert covariance_of(p, b, a) == pytest.approx(covariance_of(p, a, b), rel=1e-12)


def test_an_error_that_fades(rng):
    p = random_covariance(rng, 8)
    f = np.eye(8)
    f[7, 7] = 0.9
    expected = f @ p @ f.T
    expected[7, 7] += 0.3
    fade(p, 7, 0.9, 0.3)
    np.testing.assert_allclose(p, expected, rtol=1e-12)
    set_single(p, 7, 2.0)
    assert p[7, 7] == 2.0 and not p[7, :7].any() and not p[:7, 7].any()


@pytest.mark.parametrize("dt", [0.1, 1.0, 300.0])
def test_an_error_and_its_rate_by_the_matrix_exponential(rng, dt):
    """Critically damped: e'' = -2 b e' - b^2 e + noise, whose lasting variances are v and v b^2."""
    rate, variance = 0.01, 0.7
    f = np.array([[0.0, 1.0], [-(rate**2), -2.0 * rate]])
    q = np.diag([0.0, 4.0 * rate**3 * variance])
    exponential = expm(dt * np.block([[-f, q], [np.zeros((2, 2)), f.T]]))
    forward = exponential[2:, 2:].T
    p = random_covariance(rng, 9)
    whole = np.eye(9)
    whole[np.ix_([6, 8], [6, 8])] = forward
    expected = whole @ p @ whole.T
    expected[np.ix_([6, 8], [6, 8])] += forward @ exponential[:2, 2:]
    mix(p, 6, 8, tuple(forward.ravel().tolist()), variance, variance * rate**2)
    np.testing.assert_allclose(p, expected, rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(p, p.T)


def test_a_bound_scales_errors_and_keeps_correlations(rng):
    p = random_covariance(rng, 6)
    before = p.copy()
    largest = np.diag(p) * np.array([1.0, 0.1, 2.0, 0.5, 1.0, 1e-3])
    bound(p, largest)
    np.testing.assert_allclose(np.diag(p), np.minimum(np.diag(before), largest), rtol=1e-12)

    def correlation(m):
        return m / np.sqrt(np.outer(np.diag(m), np.diag(m)))

    np.testing.assert_allclose(correlation(p), correlation(before), atol=1e-12)


def test_a_block_that_is_set_has_nothing_to_do_with_the_rest(rng):
    p = random_covariance(rng, 9)
    before = p.copy()
    block = (2.0, 0.1, 0.2, 3.0, 0.3, 4.0)
    set_block(p, 3, block)
    assert attitude_block(p[3:, 3:].copy()) == block
    assert not p[3:6, :3].any() and not p[6:, 3:6].any()
    np.testing.assert_array_equal(p, p.T)
    np.testing.assert_array_equal(p[6:, 6:], before[6:, 6:])


def test_inverse_form_against_numpy(rng):
    for _ in range(50):
        m, v = random_covariance(rng, 3), rng.normal(size=3)
        packed = attitude_block(m)
        assert inverse_form(packed, tuple(v.tolist())) == pytest.approx(v @ np.linalg.solve(m, v), rel=1e-9)
    for bad in ((0.0,) * 6, (1.0, 2.0, 0.0, 1.0, 0.0, 1.0), (1.0, 0.0, 2.0, 1.0, 0.0, 1.0), (math.nan,) * 6):
        assert inverse_form(bad, (1.0, 1.0, 1.0)) == math.inf


def test_the_neglected_variance_lies_between_those_across_and_along_a_direction(rng):
    sigma = 0.3
    turns = sigma * rng.normal(size=(200_000, 3))
    s = np.array([0.0, 0.0, 1.0])
    second = 0.5 * np.cross(turns, np.cross(turns, s))
    across, along = np.mean(second[:, 0] ** 2), np.mean(second[:, 2] ** 2)
    neglected = neglected_variance(np.diag([sigma**2] * 3))
    assert across == pytest.approx(neglected / 4.0, rel=0.02)
    assert along == pytest.approx(2.0 * neglected, rel=0.02)
