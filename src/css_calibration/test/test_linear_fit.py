# SPDX-License-Identifier: Apache-2.0
"""The linear fits of gyro and magnetometer: values, standard deviations, outliers, and what nothing tells."""

import numpy as np
import pytest

from css_calibration.aids_by_truth import linear_fit


def drawn(seed, sigma=0.1, outliers=0):
    rng = np.random.default_rng(seed)
    matrix, true = rng.normal(size=(300, 3)), np.array([1.0, -2.0, 0.5])
    target = matrix @ true + sigma * rng.normal(size=300)
    target[:outliers] += 5.0
    return matrix, target, true


def test_errors_over_their_sigma_are_standard_normal():
    ratios = []
    for seed in range(100):
        matrix, target, true = drawn(seed)
        result = linear_fit(matrix, target, np.full(3, 10.0))
        ratios.append((result.x - true) / result.sigma)
    # 300 draws: the mean square has a standard deviation of 0.082
    assert np.mean(np.square(ratios)) == pytest.approx(1.0, abs=0.27)


def test_outliers_are_counted_and_do_no_harm():
    matrix, target, true = drawn(1, outliers=20)
    result = linear_fit(matrix, target, np.full(3, 10.0))
    assert result.outliers == 20
    assert np.abs(result.x - true).max() < 0.05


def test_what_no_row_tells_keeps_its_ignorance():
    matrix, target, _ = drawn(2)
    matrix[:, 2] = 0.0
    result = linear_fit(matrix, target, np.full(3, 10.0))
    assert result.left[2] == pytest.approx(1.0)
    assert result.x[2] == pytest.approx(0.0)
    assert (result.left[:2] < 0.1).all()
