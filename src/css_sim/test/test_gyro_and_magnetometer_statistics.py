# SPDX-License-Identifier: Apache-2.0
"""Distributions of gyro and magnetometer errors (significance 1e-4, fixed seeds), limits, independence of history."""

import math

import numpy as np
import pytest
from scipy import stats

from css_common.random_streams import Stream, random_key
from css_common.schema import default_values
from css_sim import gyro, magnetometer
from css_sim.fault_effects import NO_FAULTS
from css_sim.random_walk import HORIZON, random_walk

SIGNIFICANCE = 1e-4
KEY = random_key(11, 2)
STILL = (0.0, 0.0, 0.0)
RATE = (0.02, -0.01, 0.03)
ONE_DEGREE_PER_HOUR = math.radians(1.0) / 3600.0


def gyro_parameters(**changes):
    return gyro.parameters(default_values(gyro.PARAMETERS, **changes))


def magnetometer_parameters(**changes):
    return magnetometer.parameters(default_values(magnetometer.PARAMETERS, **changes))


def normal(sample, sigma):
    return stats.kstest(sample, "norm", (0, sigma)).pvalue > SIGNIFICANCE


def readings(p, steps, rate=STILL, key=KEY):
    errors = gyro.draw_errors(p, key)
    return np.array([gyro.measure(p, errors, NO_FAULTS, key, step, rate) for step in steps])


def test_gyro_bias_is_constant_in_a_case_and_normal_over_cases():
    p = gyro_parameters(noise_deg_s=0.0)
    one = readings(p, range(50))
    assert np.ptp(one, axis=0).max() == 0.0
    over_cases = np.array([gyro.draw_errors(p, random_key(11, case)).bias_b for case in range(5000)])
    assert all(normal(over_cases[:, i], ONE_DEGREE_PER_HOUR) for i in range(3))
    assert stats.pearsonr(over_cases[:, 0], over_cases[:, 1]).pvalue > SIGNIFICANCE


def test_gyro_noise_is_white_and_normal():
    p = gyro_parameters(bias_deg_h=0.0)
    noise = readings(p, range(20_000), RATE) - RATE
    assert all(normal(noise[:, i], math.radians(0.01)) for i in range(3))
    assert all(stats.pearsonr(noise[1:, i], noise[:-1, i]).pvalue > SIGNIFICANCE for i in range(3))
    assert stats.pearsonr(noise[:, 0], noise[:, 2]).pvalue > SIGNIFICANCE


def test_gyro_draws_do_not_depend_on_the_order_of_steps():
    p = gyro_parameters(bias_walk_deg_s=0.001)
    steps = np.random.default_rng(2).permutation(300)
    assert np.array_equal(readings(p, steps), readings(p, range(300))[steps])


def test_gyro_scale_and_misalignment_bend_the_rate():
    p = gyro_parameters(bias_deg_h=0.0, noise_deg_s=0.0, scale_error=0.01, misalignment_deg=0.5)
    responses = np.array([gyro.draw_errors(p, random_key(4, c)).response for c in range(4000)]) - np.eye(3)
    for i in range(3):
        for j in range(3):
            assert normal(responses[:, i, j], 0.01 if i == j else math.radians(0.5))
    errors = gyro.draw_errors(p, KEY)
    measured = gyro.measure(p, errors, NO_FAULTS, KEY, 0, RATE)
    np.testing.assert_allclose(measured, np.array(errors.response) @ RATE, rtol=1e-14)


def test_gyro_range_and_resolution():
    p = gyro_parameters(bias_deg_h=0.0, noise_deg_s=0.0, range_deg_s=5.0, resolution_deg_s=0.02)
    measured = np.degrees(readings(p, [0], tuple(math.radians(w) for w in (0.031, -7.0, 4.995)))[0])
    np.testing.assert_allclose(measured, [0.04, -5.0, 5.0], atol=1e-12)


def test_gyro_variance_is_that_of_the_readings():
    p = gyro_parameters(bias_deg_h=20.0, resolution_deg_s=0.01)
    residual = np.concatenate([readings(p, range(5), RATE, random_key(9, c)) - RATE for c in range(2000)])
    # five samples of a case share a bias: the effective number of samples is that of cases
    assert np.mean(residual**2) / gyro.variance(p) - 1 < 4 * math.sqrt(2 / 6000)
    assert np.mean(residual**2) / gyro.variance(p) - 1 > -4 * math.sqrt(2 / 6000)


def test_walk_has_independent_normal_increments():
    walk = np.array([random_walk(KEY, Stream.GYRO_BIAS, 4, k) for k in range(5001)])
    assert np.all(walk[0] == 0.0)
    increments = np.diff(walk, axis=0)
    for i in range(3):
        assert normal(increments[:, i], 1.0)
        assert stats.pearsonr(increments[1:, i], increments[:-1, i]).pvalue > SIGNIFICANCE
    assert stats.pearsonr(increments[:, 0], increments[:, 1]).pvalue > SIGNIFICANCE


def test_walk_spreads_with_the_root_of_time():
    for step in (1, 7, 1000, 55_500, HORIZON // 2 + 1, HORIZON):
        ends = np.array([random_walk(random_key(6, c), Stream.GYRO_BIAS, 4, step)[0] for c in range(2000)])
        assert normal(ends / math.sqrt(step), 1.0)


def test_walk_is_independent_of_the_constant_bias():
    pairs = np.array(
        [
            (gyro.draw_errors(gyro_parameters(), key).bias_b[0], random_walk(key, Stream.GYRO_BIAS, 4, 100)[0])
            for key in (random_key(8, c) for c in range(3000))
        ]
    )
    assert stats.pearsonr(*pairs.T).pvalue > SIGNIFICANCE


def test_magnetometer_bias_noise_and_resolution():
    field = (2.1e-5, -1.3e-5, 3.0e-5)
    p = magnetometer_parameters(bias_nt=500.0, noise_nt=0.0)
    biases = np.array([magnetometer.draw_bias(p, random_key(1, c)) for c in range(5000)])
    assert all(normal(biases[:, i], 500e-9) for i in range(3))
    np.testing.assert_allclose(
        magnetometer.measure(p, biases[3], NO_FAULTS, KEY, 0, field), biases[3] + field, rtol=1e-15
    )

    p = magnetometer_parameters(noise_nt=150.0)
    noise = np.array([magnetometer.measure(p, STILL, NO_FAULTS, KEY, k, field) for k in range(20_000)]) - field
    assert all(normal(noise[:, i], 150e-9) for i in range(3))

    p = magnetometer_parameters(noise_nt=0.0, resolution_nt=7.0, range_nt=25_000.0)
    measured = np.array(magnetometer.measure(p, STILL, NO_FAULTS, KEY, 0, field)) * 1e9
    np.testing.assert_allclose(measured, [21_000.0, -12_999.0, 25_000.0], rtol=1e-12)
    assert magnetometer.variance(p) == pytest.approx(7e-9**2 / 12)


def test_sensors_do_not_share_noise():
    g = readings(gyro_parameters(bias_deg_h=0.0), range(5000)) / math.radians(0.01)
    p = magnetometer_parameters(noise_nt=1e6)
    m = np.array([magnetometer.measure(p, STILL, NO_FAULTS, KEY, k, STILL) for k in range(5000)])
    assert all(stats.pearsonr(g[:, i], m[:, j]).pvalue > SIGNIFICANCE for i in range(3) for j in range(3))
