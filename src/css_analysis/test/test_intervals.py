# SPDX-License-Identifier: Apache-2.0
"""Intervals hold what they promise: over many samples they miss the truth in 5 % of them."""

import math

import numpy as np
import pytest

from css_analysis.intervals import Interval, beyond_largest, mean_interval, percentile_interval, share_interval

RNG = np.random.default_rng(7)


def ends(interval: Interval) -> tuple[float, float]:
    low, high = interval
    assert low is not None and high is not None
    return low, high


def test_shares_against_the_tables_of_clopper_and_pearson():
    # closed forms at the ends: 0 of n up to 1 - (alpha/2)^(1/n)
    assert share_interval(0, 20) == pytest.approx((0.0, 1.0 - 0.025 ** (1 / 20)))
    assert share_interval(20, 20) == pytest.approx((0.025 ** (1 / 20), 1.0))
    assert share_interval(94, 100) == pytest.approx((0.8740, 0.9777), abs=2e-4)
    assert share_interval(0, 0) == (None, None)


def test_means_of_skewed_values_are_covered():
    missed = 0
    for _ in range(150):
        low, high = ends(mean_interval(RNG.exponential(1.0, 60)))
        missed += not low <= 1.0 <= high
    assert missed <= 20  # 7.5 expected, sigma 2.7; a skewed sample misses a little more


def test_a_mean_of_few_values():
    assert mean_interval(np.array([3.0])) == (None, None)
    assert mean_interval(np.array([2.0, 2.0, 2.0])) == (2.0, 2.0)
    low, high = ends(mean_interval(np.array([1.0, 3.0])))
    assert low < 2.0 < high


def test_percentiles_are_covered_by_order_statistics():
    truth = -math.log(0.05)
    missed = 0
    for _ in range(400):
        low, high = ends(percentile_interval(RNG.exponential(1.0, 300), 95.0))
        missed += not low <= truth <= high
    assert missed <= 34  # at most 20 expected, sigma 4.4


@pytest.mark.parametrize(("cases", "known"), [(71, False), (72, True)])
def test_the_upper_end_of_a_percentile_needs_cases(cases, known):
    """The largest of n is above the 95 % percentile with probability 1 - 0.95^n, 97.5 % from n = 72 on."""
    low, high = percentile_interval(np.arange(float(cases)), 95.0)
    assert (high is not None) is known and low is not None
    assert 0.95**72 < 0.025 < 0.95**71


def test_what_lies_beyond_the_largest():
    assert beyond_largest(59) == pytest.approx(0.05, abs=5e-4)  # the rule of 59 cases
    assert beyond_largest(0) is None
