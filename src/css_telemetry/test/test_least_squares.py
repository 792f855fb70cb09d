# SPDX-License-Identifier: Apache-2.0
"""Least squares: the least sum, whatever the units, in few rounds from far away."""

import numpy as np
import pytest
import scipy.optimize

from css_telemetry.least_squares import levenberg_marquardt

TIME = np.linspace(0.0, 1.0, 60)


def linear(matrix, values):
    return (lambda x: matrix @ x - values), (lambda x: matrix)


def decay(noise):
    """A height, a rate of decay and a floor, from values (60,) with noise."""
    values = 3.0 * np.exp(-4.0 * TIME) + 0.5 + noise

    def residuals(x):
        return x[0] * np.exp(-x[1] * TIME) + x[2] - values

    def slopes(x):
        falling = np.exp(-x[1] * TIME)
        return np.stack([falling, -x[0] * TIME * falling, np.ones_like(TIME)], axis=1)

    return residuals, slopes


@pytest.mark.parametrize("units", [1.0, 1e9, 1e-9])
def test_a_linear_problem_has_the_solution_of_the_normal_equations(units):
    rng = np.random.default_rng(4)
    matrix, values = rng.normal(size=(40, 3)), rng.normal(size=40)
    expected = np.linalg.solve(matrix.T @ matrix, matrix.T @ values)
    lengths = np.array([units, 1.0, 1.0 / units])
    residuals, slopes = linear(matrix * lengths, values)
    found, left = levenberg_marquardt(residuals, slopes, np.zeros(3))
    np.testing.assert_allclose(found * lengths, expected, rtol=1e-6)
    np.testing.assert_allclose(left, matrix @ expected - values, atol=1e-6)


def test_noisy_decay_is_what_scipy_finds():
    residuals, slopes = decay(0.05 * np.random.default_rng(5).normal(size=60))
    start = np.array([1.0, 1.0, 0.0])
    found, left = levenberg_marquardt(residuals, slopes, start, 1e-12)
    expected = scipy.optimize.least_squares(residuals, start, slopes, ftol=1e-14, xtol=1e-14).x
    np.testing.assert_allclose(found, expected, rtol=1e-5)
    np.testing.assert_array_equal(left, residuals(found))


def test_the_best_is_left_as_it_is():
    residuals, slopes = decay(np.zeros(60))
    found, left = levenberg_marquardt(residuals, slopes, np.array([3.0, 4.0, 0.5]))
    np.testing.assert_allclose(found, [3.0, 4.0, 0.5], rtol=1e-12)
    assert np.max(np.abs(left)) < 1e-15


def test_what_is_not_worth_a_round_is_left():
    residuals, slopes = decay(0.05 * np.random.default_rng(5).normal(size=60))
    near = np.array([3.0, 4.0, 0.5])
    worth = float(np.sum(residuals(near) ** 2))
    np.testing.assert_array_equal(levenberg_marquardt(residuals, slopes, near, 0.0, worth)[0], near)
    assert np.sum(levenberg_marquardt(residuals, slopes, near, 0.0, 1e-9 * worth)[1] ** 2) < worth


def test_a_sum_of_squares_of_twenty_decades_takes_few_rounds():
    """Positions along a circle by its mean motion: what a rate errs by grows to thousands of kilometres."""
    time = np.linspace(0.0, 600e3, 300)
    rounds = []

    def at(x):
        return 7e6 * np.concatenate([np.cos(x[0] + x[1] * time), np.sin(x[0] + x[1] * time)])

    def slopes(x):
        rounds.append(x)
        c, s = np.cos(x[0] + x[1] * time), np.sin(x[0] + x[1] * time)
        return 7e6 * np.stack([np.concatenate([-s, c]), np.concatenate([-s * time, c * time])], axis=1)

    true = np.array([0.4, 1.078e-3])
    found, left = levenberg_marquardt(lambda x: at(x) - at(true), slopes, true + np.array([0.1, 4e-7]))
    np.testing.assert_allclose(found, true, rtol=1e-9)
    assert np.max(np.abs(left)) < 1.0
    assert len(rounds) <= 6


def test_a_step_that_leads_up_is_shortened():
    """An angle fitted from beyond its turning point, where the whole step lands farther away."""
    found, left = levenberg_marquardt(
        lambda x: np.array([np.arctan(x[0])]), lambda x: np.array([[1.0 / (1.0 + x[0] ** 2)]]), np.array([3.0])
    )
    assert abs(found[0]) < 1e-3
    assert abs(left[0]) < 1e-3
