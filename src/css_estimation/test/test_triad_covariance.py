# SPDX-License-Identifier: Apache-2.0
"""Covariance of TRIAD for directions of any covariance, and the attitude of a spinning body at one instant."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from css_estimation.attitude.sun_field_attitude import (
    MODE_FIELD_FIRST,
    MODE_NONE,
    MODE_SUN_FIRST,
    ORDER_BEST,
    ORDER_FIELD,
    ORDER_SUN,
    interpolated_field,
    interpolated_variance,
    sun_field_attitude,
)
from css_estimation.attitude.triad import triad, triad_covariance, triad_covariance_of
from css_estimation.spin.slit_angles import sun_covariance, sun_vector

unit_vectors = st.tuples(*3 * [st.floats(-1.0, 1.0)]).filter(lambda v: np.linalg.norm(v) > 0.1)


def unit(v):
    return tuple((np.array(v) / np.linalg.norm(v)).tolist())


def full(p):
    return np.array([[p[0], p[1], p[2]], [p[1], p[3], p[4]], [p[2], p[4], p[5]]])


def isotropic(variance):
    return (variance, 0.0, 0.0, variance, 0.0, variance)


@given(unit_vectors, unit_vectors, st.floats(1e-4, 0.1), st.floats(1e-4, 0.1))
def test_equal_errors_in_all_directions_give_the_formula_of_shuster_and_oh(first, second, s1, s2):
    w1, w2 = unit(first), unit(second)
    if np.linalg.norm(np.cross(w1, w2)) < 0.1:
        return
    general = full(triad_covariance_of(w1, w2, isotropic(s1 * s1), isotropic(s2 * s2)))
    np.testing.assert_allclose(general, full(triad_covariance(w1, w2, s1, s2)), rtol=1e-9, atol=1e-12 * (s1 + s2) ** 2)


@pytest.mark.parametrize("sun_first", [True, False])
def test_unequal_errors_against_many_draws(sun_first):
    rng = np.random.default_rng(8)
    angle, azimuth = 0.4, 0.0
    sun = np.array(sun_vector(angle, azimuth))
    field = np.array(unit((-0.3, 0.5, 0.8)))
    up = np.array((-math.sin(angle), 0.0, math.cos(angle)))
    across = np.array((0.0, 1.0, 0.0))
    of_sun, of_field = sun_covariance(angle, azimuth, 1e-4, 1e-6 / math.cos(angle) ** 2), isotropic(2.5e-5)
    errors = []
    for _ in range(4000):
        measured_sun = unit(sun + 1e-2 * rng.normal() * up + 1e-3 * rng.normal() * across)
        measured_field = unit(field + 5e-3 * rng.normal(size=3))
        pairs = (measured_sun, measured_field), (tuple(sun), tuple(field))
        order = 1 if sun_first else -1
        ok, dcm = triad(*pairs[0][::order], *pairs[1][::order])
        assert ok
        errors.append(Rotation.from_matrix(np.array(dcm)).as_rotvec())
    if sun_first:
        expected = full(triad_covariance_of(tuple(sun), tuple(field), of_sun, of_field))
    else:
        expected = full(triad_covariance_of(tuple(field), tuple(sun), of_field, of_sun))
    drawn = np.cov(np.array(errors).T)
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    np.testing.assert_allclose(drawn / scale, expected / scale, atol=0.07)


def test_the_order_that_leaves_less_is_taken_when_either_may_be_first():
    sun_n, field_n = (1.0, 0.0, 0.0), (0.0, 4e-5, 2e-5)
    fine, coarse = isotropic(1e-8), isotropic(1e-3)
    field_variance = float((1e-3 * np.linalg.norm(field_n)) ** 2)

    def solved(sun_covariance, order):
        return sun_field_attitude(sun_n, sun_covariance, field_n, field_variance, sun_n, field_n, order)

    assert solved(fine, ORDER_BEST).mode == MODE_SUN_FIRST
    assert solved(coarse, ORDER_BEST).mode == MODE_FIELD_FIRST
    assert solved(coarse, ORDER_SUN).mode == MODE_SUN_FIRST
    assert solved(fine, ORDER_FIELD).mode == MODE_FIELD_FIRST


def test_a_field_along_the_sun_or_none_gives_no_attitude():
    sun = (1.0, 0.0, 0.0)
    for field in ((5e-5, 1e-6, 0.0), (0.0, 0.0, 0.0)):
        assert (
            sun_field_attitude(sun, isotropic(1e-6), field, 1e-14, sun, (5e-5, 1e-6, 0.0), ORDER_BEST).mode == MODE_NONE
        )


@given(st.floats(0.0, 1.0), st.floats(0.0, 6.3), st.floats(0.01, 0.5))
def test_the_interpolated_field_of_a_turning_body_is_as_wrong_as_it_says(u, phase, turn):
    samples = [(math.cos(phase + k * turn), -math.sin(phase + k * turn), 0.3) for k in range(-1, 3)]
    x, y, z = interpolated_field(samples[0], samples[1], samples[2], samples[3], u)
    off = math.hypot(x - math.cos(phase + u * turn), y + math.sin(phase + u * turn))
    assert z == pytest.approx(0.3)
    bound = math.sqrt(2.0 * interpolated_variance(0.0, 1.0, turn, u))
    assert off <= 1.05 * bound + 1e-12
    weights = interpolated_variance(1.0, 0.0, turn, u)
    assert 0.6 < weights <= 1.0
