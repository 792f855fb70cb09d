# SPDX-License-Identifier: Apache-2.0
"""The normal distribution and its inverse against scipy's."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import ndtr, ndtri

from css_common.normal_distribution import normal_quantile, normal_share


@given(st.integers(0, 0xFFFFFFFF))
def test_normal_quantile_of_every_word_against_scipy(word):
    p = (word + 0.5) * 2.0**-32
    np.testing.assert_allclose(normal_quantile(p), ndtri(p), rtol=4e-15, atol=1e-17)


@given(st.floats(1e-300, 0.5))
def test_normal_quantile_far_into_the_tail(p):
    np.testing.assert_allclose(normal_quantile(p), ndtri(p), rtol=4e-15, atol=1e-17)


def test_normal_quantile_is_odd_and_zero_at_the_middle():
    assert normal_quantile(0.5) == 0.0
    for p in (0.01, 0.25, 0.074, 0.076):
        np.testing.assert_allclose(normal_quantile(p), -normal_quantile(1.0 - p), rtol=1e-14)


@given(st.floats(-7.0, 7.0))
def test_share_and_density_against_scipy(z):
    share, density = normal_share(z)
    np.testing.assert_allclose(share, ndtr(z), rtol=5e-9, atol=0.0)
    np.testing.assert_allclose(share, ndtr(z), rtol=0.0, atol=3e-16)
    np.testing.assert_allclose(density, math.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi), rtol=1e-15)


@given(st.floats(-7.0, 7.0))
def test_share_below_and_above_are_all(z):
    np.testing.assert_allclose(normal_share(z)[0] + normal_share(-z)[0], 1.0, rtol=3e-16)
