# SPDX-License-Identifier: Apache-2.0
"""Rate from two Sun vectors (O'Keefe & Schaub 2013, Eq. 15) and the low-pass behind it."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lti, step

from css_common.attitude import rotation_vector_to_dcm
from css_common.vectors import cross, dot, multiply, norm, scale, subtract, unit
from css_estimation.sun.low_pass import low_pass, low_pass_gain
from css_estimation.sun.sun_rate import rate_from_sun_vectors

LIMIT = math.radians(10.0)
component = st.floats(-1.0, 1.0)


def turned(sun_b, omega, dt):
    """The inertially fixed Sun in b after `dt` at constant rate: exp(-[omega x] dt) sun_b."""
    return multiply(rotation_vector_to_dcm(scale(dt, omega)), sun_b)


def normal_part(omega, sun_b):
    return subtract(omega, scale(dot(omega, sun_b), sun_b))


@given(st.tuples(component, component, component), st.tuples(component, component, component))
def test_printed_order_gives_the_rate_normal_to_the_sun_line(s, w):
    if norm(s) < 1e-3 or norm(w) < 1e-3:
        return
    sun_b = unit(s)
    # normal to the Sun line, so that the mean direction of the step is the exact axis
    omega = scale(0.05, normal_part(w, sun_b))
    rate = rate_from_sun_vectors(turned(sun_b, omega, 0.1), sun_b, 0.1, LIMIT)
    np.testing.assert_allclose(rate, omega, rtol=1e-9, atol=1e-13)


def test_reversed_order_has_the_opposite_sign():
    sun_b = unit((0.3, -0.5, 0.8))
    later = turned(sun_b, (0.01, 0.02, -0.01), 0.1)
    forward = rate_from_sun_vectors(later, sun_b, 0.1, LIMIT)
    backward = rate_from_sun_vectors(sun_b, later, 0.1, LIMIT)
    np.testing.assert_allclose(forward, scale(-1.0, backward), rtol=1e-12)


def test_rotation_about_the_sun_line_is_not_seen():
    sun_b = unit((0.3, -0.5, 0.8))
    rate = rate_from_sun_vectors(turned(sun_b, scale(0.05, sun_b), 0.1), sun_b, 0.1, LIMIT)
    np.testing.assert_allclose(rate, (0.0, 0.0, 0.0), atol=1e-12)


def test_error_of_the_mixed_case_is_of_first_order_in_the_step():
    """With a part along the Sun line the chord turns during the step: the error shrinks with dt."""
    sun_b = unit((0.3, -0.5, 0.8))
    omega = (0.03, 0.01, 0.02)
    errors = []
    for dt in (0.2, 0.1, 0.05):
        later = turned(sun_b, omega, dt)
        rate = rate_from_sun_vectors(later, sun_b, dt, LIMIT)
        errors.append(norm(subtract(rate, normal_part(omega, later))))
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.05)
    assert errors[1] / errors[2] == pytest.approx(2.0, rel=0.05)


@pytest.mark.parametrize("angle", [1e-11, 1e-8, 1e-5, 1e-2])
def test_small_angles_keep_their_digits(angle):
    """The arc cosine of Eq. 15 as printed returns 0 below 1e-8 rad."""
    now = (math.sin(angle), 0.0, math.cos(angle))
    rate = rate_from_sun_vectors(now, (0.0, 0.0, 1.0), 1.0, LIMIT)
    np.testing.assert_allclose(rate, (0.0, -angle, 0.0), rtol=1e-6, atol=1e-25)


def test_each_axis_is_bounded():
    rate = rate_from_sun_vectors((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), 0.1, LIMIT)
    assert rate == (0.0, 0.0, LIMIT)


@pytest.mark.parametrize("dt", [0.0, -0.1, math.nan])
def test_no_time_no_rate(dt):
    assert rate_from_sun_vectors((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), dt, LIMIT) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("previous", [(0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (0.0, 0.0, 0.0)])
def test_same_opposite_and_missing_vectors_give_no_rate(previous):
    assert rate_from_sun_vectors((0.0, 0.0, 1.0), previous, 0.1, LIMIT) == (0.0, 0.0, 0.0)


def test_gain_of_the_paper_filter():
    assert low_pass_gain(0.1, 0.1) == pytest.approx(0.0609, abs=5e-5)


def test_step_response_is_that_of_the_continuous_filter():
    """Exact discretisation: equal to 1/(s/wc + 1) at the samples, whatever their spacing."""
    cutoff = 0.1
    wc = 2.0 * math.pi * cutoff
    grid, response = step(lti([wc], [1.0, wc]), T=0.05 * np.arange(101))
    visited = [2, 3, 11, 31, 33, 83, 89, 100]
    steps = np.diff([0.0, *grid[visited]])
    y = (0.0, 0.0, 0.0)
    for dt, value in zip(steps, response[visited], strict=True):
        y = low_pass(y, (1.0, -2.0, 0.5), low_pass_gain(cutoff, dt))
        np.testing.assert_allclose(y, (value, -2.0 * value, 0.5 * value), rtol=1e-9)


def test_attenuation_at_the_corner_is_three_decibel():
    dt = 0.001
    gain = low_pass_gain(0.1, dt)
    t = np.arange(0.0, 60.0, dt)
    y, out = (0.0, 0.0, 0.0), np.empty(t.size)
    for k, x in enumerate(np.sin(2.0 * math.pi * 0.1 * t).tolist()):
        y = low_pass(y, (x, 0.0, 0.0), gain)
        out[k] = y[0]
    assert np.ptp(out[t > 30.0]) / 2.0 == pytest.approx(math.sqrt(0.5), rel=1e-3)


def test_rate_is_normal_to_both_vectors():
    a, b = unit((0.2, 0.9, -0.1)), unit((0.25, 0.88, -0.12))
    rate = rate_from_sun_vectors(a, b, 1.0, LIMIT)
    assert abs(dot(rate, a)) < 1e-15 and abs(dot(rate, b)) < 1e-15
    assert dot(rate, cross(a, b)) > 0.0
