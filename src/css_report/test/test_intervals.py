# SPDX-License-Identifier: Apache-2.0
"""Confidence intervals against printed values, and by how often they hold what they are said to."""

import numpy as np
import pytest

from css_report.intervals import mean_interval, percentile_interval, share_interval


def test_shares_as_printed():
    # Newcombe, Statistics in Medicine 17 (1998), table I, method 3: 81 of 263, 15 of 148, 0 of 20, 1 of 29
    printed = {
        (81, 263): (0.2553, 0.3662),
        (15, 148): (0.0624, 0.1605),
        (0, 20): (0.0, 0.1611),
        (1, 29): (0.0061, 0.1718),
    }
    for (hits, count), ends in printed.items():
        assert share_interval(hits, count) == pytest.approx(ends, abs=5e-5)
    assert share_interval(20, 20) == pytest.approx((1.0 - 0.1611, 1.0), abs=5e-5)
    assert share_interval(0, 0) == (None, None)


def test_a_mean_by_students_table():
    # t of 9 degrees of freedom is 2.262
    values = np.arange(10.0)
    half = 2.262 * np.std(values, ddof=1) / np.sqrt(10.0)
    assert mean_interval(values) == pytest.approx((4.5 - half, 4.5 + half), abs=1e-3)
    assert mean_interval(values[:1]) == (None, None)


def test_ranks_of_a_median_as_printed():
    # Conover, table A3 by the binomial: of 20 values, ranks 6 and 15 hold the median with 95.9 %
    low, high = percentile_interval(np.arange(1.0, 21.0), 50.0)
    assert (low, high) == (6.0, 15.0)
    assert percentile_interval(np.arange(10.0), 95.0)[1] is None
    assert percentile_interval(np.empty(0), 95.0) == (None, None)


@pytest.mark.parametrize("percent", [50.0, 95.0])
def test_percentile_intervals_hold_it_often_enough(percent):
    random = np.random.default_rng(3)
    true = -np.log(1.0 - 0.01 * percent)
    ends = [percentile_interval(random.exponential(size=200), percent) for _ in range(2000)]
    holds = np.mean([low <= true <= high for low, high in ends if low is not None and high is not None])
    assert 0.94 < holds < 0.98
