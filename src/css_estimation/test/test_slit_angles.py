# SPDX-License-Identifier: Apache-2.0
"""Sun angle, rate and vector from counts: against the geometry of the slits, quantum by quantum."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from css_estimation.spin.slit_angles import (
    arc_slope,
    counting_variance,
    motion_gain,
    quantum,
    rotation_rate,
    sun_angle,
    sun_covariance,
    sun_vector,
)

INCLINATION = math.radians(30.0)


def counts_of(angle, spin, frequency, start):
    """COUNT and RCOUNT that a timer reads for a fixed spin axis and a Sun angle [rad]."""
    half = math.asin(math.tan(angle) / math.sqrt(3.0)) / (2.0 * math.pi * spin)
    upper, lower = math.floor((start - half) * frequency), math.floor((start + half) * frequency)
    return lower - upper, upper - math.floor((start - half - 1.0 / spin) * frequency)


@given(
    degrees=st.floats(-55.0, 55.0),
    spin=st.floats(1.0, 8.0),
    frequency=st.sampled_from([1e4, 1e5, 1e6]),
    start=st.floats(100.0, 101.0),
)
def test_a_fixed_axis_is_told_to_two_counter_quanta(degrees, spin, frequency, start):
    angle = math.radians(degrees)
    count, turn = counts_of(angle, spin, frequency, start)
    step = math.pi / turn / arc_slope(angle, INCLINATION)
    assert abs(sun_angle(count, turn, INCLINATION) - angle) < 2.0 * step
    assert rotation_rate(turn, frequency) / (2.0 * math.pi) == pytest.approx(spin, rel=1.5 / turn)


def test_quantum_of_the_paper():
    """At 6 Hz and 10 kHz a count is 0.19 deg at the equator."""
    assert math.degrees(quantum(0, 1667, INCLINATION)) == pytest.approx(0.187, abs=1e-3)
    assert rotation_rate(1667, 1e4) == pytest.approx(2.0 * math.pi * 6.0, rel=1e-3)


def test_the_angle_is_signed_zero_on_the_equator_and_odd():
    assert sun_angle(0, 1000, INCLINATION) == 0.0
    assert sun_angle(150, 1000, INCLINATION) == -sun_angle(-150, 1000, INCLINATION) > 0.0
    assert math.degrees(sun_angle(500, 1000, INCLINATION)) == pytest.approx(60.0)  # the end of the range


def test_the_counted_variance_is_that_of_many_starts():
    rng = np.random.default_rng(5)
    for degrees in (3.0, 20.0, 45.0):
        ratios = []
        for start, off in zip(rng.uniform(10.0, 11.0, 4000), rng.uniform(-2.0, 2.0, 4000), strict=True):
            angle = math.radians(degrees + off)
            count, turn = counts_of(angle, 6.0 + 0.1 * off, 1e4, start)
            error = sun_angle(count, turn, INCLINATION) - angle
            ratios.append(error**2 / counting_variance(count, turn, INCLINATION, 0.0))
        assert np.mean(ratios) == pytest.approx(1.0, rel=0.1)


def test_sun_vector_lies_in_the_meridian_of_the_head():
    x, y, z = sun_vector(0.3, 0.0)
    assert (x, y, z) == pytest.approx((math.cos(0.3), 0.0, math.sin(0.3)))  # Eq. 7
    turned = sun_vector(0.3, math.radians(90.0))
    assert turned == pytest.approx((0.0, math.cos(0.3), math.sin(0.3)), abs=1e-15)


@given(st.floats(-0.9, 0.9), st.floats(-3.0, 3.0))
def test_covariance_is_that_of_angle_and_azimuth(angle, azimuth):
    p = sun_covariance(angle, azimuth, 4e-6, 1e-6)
    matrix = np.array([[p[0], p[1], p[2]], [p[1], p[3], p[4]], [p[2], p[4], p[5]]])
    h = 1e-6
    up = (np.array(sun_vector(angle + h, azimuth)) - sun_vector(angle - h, azimuth)) / (2 * h)
    across = (np.array(sun_vector(angle, azimuth + h)) - sun_vector(angle, azimuth - h)) / (2 * h)
    np.testing.assert_allclose(matrix, 4e-6 * np.outer(up, up) + 1e-6 * np.outer(across, across), atol=1e-15)


def test_motion_does_not_matter_without_coning_or_on_the_equator():
    for ratio in (0.3, 0.7, 1.3):
        assert motion_gain(0.0, INCLINATION, ratio) == pytest.approx((0.0, 0.0))
    assert motion_gain(0.4, INCLINATION, 1e-9) == pytest.approx((0.0, 0.0), abs=1e-8)
