# SPDX-License-Identifier: Apache-2.0
"""Closed forms and statistics behind the health of the gyro."""

import math

import numpy as np
import pytest
from scipy import stats
from sensor_truth import DEG, SUN_N, tumble

from css_common.vectors import mat3, vector_of
from css_estimation.health.gyro_bias import corrected, learn, significance, unknown_bias
from css_estimation.health.gyro_fit import add_block, best_shape, new_fits
from css_estimation.health.rate_checks import equal_count, gamma_quantile
from css_estimation.health.reference_line import begin_line, carry, off_the_gyro
from css_estimation.symmetric import inverse, inverse_form

LARGEST = (10.0 * DEG) ** 2
DT = 0.1


def block(rate, error, scale=(0.0, 0.0, 0.0), about=(0.0, 0.0, 0.0), steps=20):
    """A line carried through a tumble by a gyro with errors, and where the Sun really is afterwards."""
    omega, attitudes = tumble(rate, steps + 1, DT)
    line = begin_line(vector_of(attitudes[0] @ SUN_N), about)
    for k in range(steps):
        # the rate in the middle of the step
        middle = 0.5 * (omega[k] + omega[k + 1])
        line = carry(line, vector_of(middle * (1.0 + np.array(scale)) + error), DT)
    return line, attitudes[-1] @ SUN_N


@pytest.mark.parametrize("rate", [(3.0, -2.0, 4.0), (0.0, 0.0, 0.0), (-8.0, 5.0, 1.0)])
@pytest.mark.parametrize("axis", range(3))
def test_what_a_bias_does_to_a_carried_line(rate, axis):
    error = 0.05 * DEG * np.eye(3)[axis]
    right, _ = block(rate, np.zeros(3))
    line, _ = block(rate, error)
    behind = np.array(right.vector_b) - np.array(line.vector_b)
    np.testing.assert_allclose(behind, np.array(line.by_bias) @ error, atol=float(2e-3 * np.linalg.norm(behind)) + 1e-9)


@pytest.mark.parametrize("axis", range(3))
def test_what_a_scale_does_to_a_carried_line(axis):
    scale = 0.01 * np.eye(3)[axis]
    right, _ = block((6.0, -5.0, 4.0), np.zeros(3))
    line, _ = block((6.0, -5.0, 4.0), np.zeros(3), scale)
    behind = np.array(right.vector_b) - np.array(line.vector_b)
    # e = c g with g = (1 + scale) w
    c = scale / (1.0 + scale)
    np.testing.assert_allclose(behind, np.array(line.by_scale) @ c, atol=float(5e-3 * np.linalg.norm(behind)))


def test_a_known_bias_keeps_a_large_one_linear():
    error = np.array([5.0, -4.0, 3.0]) * DEG
    line, sun_b = block((3.0, -2.0, 4.0), error, about=vector_of(0.95 * error))
    difference = off_the_gyro(line, vector_of(sun_b - np.array(line.vector_b)))
    np.testing.assert_allclose(difference, np.array(line.by_bias) @ error, atol=2e-3)


def test_the_bias_is_within_its_covariance():
    dice = np.random.default_rng(1)
    nees = []
    for _ in range(400):
        truth = math.sqrt(LARGEST) * dice.normal(size=3)
        bias = unknown_bias(LARGEST)
        for m in dice.normal(size=(30, 3, 3)):
            d = m @ truth + 0.05 * dice.normal(size=3)
            bias = learn(bias, mat3(m), tuple(d), 0.05**2, 3)
        nees.append(inverse_form(bias.covariance, vector_of(np.array(bias.bias_b) - truth)))
    low, high = stats.chi2.ppf([0.001, 0.999], 3 * len(nees)) / len(nees)
    assert low < np.mean(nees) < high


def test_a_bias_is_significant_as_rarely_as_chi_square_says():
    dice = np.random.default_rng(2)
    usual, beyond = (0.1 * DEG) ** 2, []
    for _ in range(2000):
        truth = math.sqrt(usual) * dice.normal(size=3)
        bias = unknown_bias(LARGEST)
        for m in dice.normal(size=(10, 3, 3)):
            bias = learn(bias, mat3(m), tuple(m @ truth + 1e-3 * dice.normal(size=3)), 1e-6, 3)
        beyond.append(significance(bias, usual))
    for level in (0.5, 0.9, 0.99):
        share = np.mean(np.array(beyond) > stats.chi2.ppf(level, 3))
        assert abs(share - (1.0 - level)) < 4.0 * math.sqrt(level * (1.0 - level) / len(beyond))


def statistics_of(dice, error):
    """Least squares of 60 blocks with unit noise: what the best scale and the best drift take."""
    fits = new_fits()
    for k in range(60):
        f = dice.normal(size=(3, 3))
        g = f * dice.normal(size=3)
        d = f @ np.array([3.0, -2.0, 1.0]) + error(f, g, k) + dice.normal(size=3)
        add_block(fits, mat3(f), mat3(g), tuple(d), 1.0, float(k), 1.0)
    return best_shape(fits, False, 1e9, 0.0), best_shape(fits, True, 1e9, 0.0)


def test_a_constant_bias_is_no_shape():
    dice = np.random.default_rng(3)
    found = [statistics_of(dice, lambda f, g, k: 0.0) for _ in range(300)]
    # the largest of three chi-squares of one degree of freedom
    for statistic in (np.array([s.statistic for s in shapes]) for shapes in zip(*found, strict=True)):
        # blocks far off weigh less, so that it is a little rarer than chi-square says
        assert np.mean(statistic > stats.chi2.ppf(0.99 ** (1.0 / 3.0), 1)) < 0.03
        assert statistic.max() < 36.0


@pytest.mark.parametrize("axis", range(3))
def test_an_error_with_the_rate_and_one_that_grows_are_found_and_measured(axis):
    dice = np.random.default_rng(4)
    scaled, _ = statistics_of(dice, lambda f, g, k: 2.0 * g[:, axis])
    assert (scaled.axis, scaled.drifts) == (axis, False)
    assert scaled.statistic > 36.0
    assert abs(scaled.value - 2.0) < 4.0 * math.sqrt(scaled.variance)
    _, drift = statistics_of(dice, lambda f, g, k: -0.1 * k * f[:, axis])
    assert (drift.axis, drift.drifts) == (axis, True)
    assert drift.statistic > 36.0
    assert abs(drift.value + 0.1) < 4.0 * math.sqrt(drift.variance)


def test_where_the_bias_is_not_known_the_reading_says_nothing():
    bias = learn(unknown_bias(LARGEST), ((1e3, 0.0, 0.0), (0.0, 1e3, 0.0), (0.0, 0.0, 0.0)), (1.0, 2.0, 0.0), 1e-6, 2)
    body = (2.0 * DEG) ** 2
    rate = corrected((0.1, 0.1, 0.1), bias, body)
    np.testing.assert_allclose(rate[:2], (0.1 - 1e-3, 0.1 - 2e-3), rtol=1e-4)
    assert rate[2] == pytest.approx(0.1 * body / (body + LARGEST))


@pytest.mark.parametrize("degrees", [19.0, 26.0, 38.0])
def test_quantiles_of_chi_square(degrees):
    exact = stats.chi2.isf(stats.norm.sf(6.0), degrees) / degrees
    assert gamma_quantile(degrees, 6.0) == pytest.approx(exact, rel=0.03)  # what the approximation is good for


@pytest.mark.parametrize("resolution", [0.5, 1.0, 2.0])
def test_how_often_samples_are_equal(resolution):
    dice = np.random.default_rng(5)
    # equal ones in a row are not independent, but hardly more frequent than if they were
    samples = np.round(dice.normal(size=200_000) / resolution + dice.random()) * resolution
    equal = np.mean(samples[1:] == samples[:-1])
    count = equal_count(1.0, resolution)
    assert equal**count < 1e-8
    assert equal_count(1.0, 0.0) == 5


def test_the_inverse_of_a_symmetric_matrix():
    root = np.random.default_rng(8).normal(size=(3, 3))
    m = root @ root.T
    i = inverse((m[0, 0], m[0, 1], m[0, 2], m[1, 1], m[1, 2], m[2, 2]))
    full = np.array([[i[0], i[1], i[2]], [i[1], i[3], i[4]], [i[2], i[4], i[5]]])
    np.testing.assert_allclose(full @ m, np.eye(3), atol=1e-9)
