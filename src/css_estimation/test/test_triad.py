# SPDX-License-Identifier: Apache-2.0
"""TRIAD: exact for exact directions, its covariance against a Monte Carlo, and the start made of it."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from css_estimation.attitude.attitude_start import chosen_sun, start
from css_estimation.attitude.lit_sun_vector import lit_sun
from css_estimation.attitude.triad import LEAST_SINE, triad, triad_covariance
from css_estimation.symmetric import row_major

rng = np.random.default_rng(1981)
angles = st.floats(0.0, 2.0 * math.pi)


def unit(v):
    return v / np.linalg.norm(v)


def tup(v):
    return tuple(float(c) for c in v)


def separated(angle):
    """Two directions so far apart, in a random frame."""
    turn = Rotation.random(random_state=rng).as_matrix()
    return turn @ np.array([0.0, 0.0, 1.0]), turn @ np.array([math.sin(angle), 0.0, math.cos(angle)])


@given(st.floats(0.2, math.pi - 0.2), st.integers(0, 2**32 - 1))
def test_exact_directions_give_the_attitude(angle, seed):
    w1, w2 = separated(angle)
    dcm_bn = Rotation.random(random_state=seed).as_matrix()
    found, dcm = triad(tup(dcm_bn @ w1), tup(dcm_bn @ w2), tup(w1), tup(w2))
    assert found
    np.testing.assert_allclose(dcm, dcm_bn, atol=1e-14)


@pytest.mark.parametrize("angle", [0.0, 0.9 * LEAST_SINE, math.pi - 0.9 * LEAST_SINE, math.pi])
def test_directions_on_one_line_give_none(angle):
    w1, w2 = separated(angle)
    assert not triad(tup(w1), tup(w2), tup(w1), tup(w2))[0]
    assert not triad((math.nan,) * 3, tup(w2), tup(w1), tup(w2))[0]


@pytest.mark.parametrize("angle_deg", [25.0, 70.0, 90.0, 140.0])
@pytest.mark.parametrize(("first", "second"), [(0.002, 0.01), (0.01, 0.01), (0.01, 0.003)])
def test_covariance_against_a_monte_carlo(angle_deg, first, second):
    w1, w2 = separated(math.radians(angle_deg))
    errors = np.empty((20_000, 3))
    for row in errors:
        v1 = tup(unit(w1 + first * np.cross(w1, rng.normal(size=3))))
        v2 = tup(unit(w2 + second * np.cross(w2, rng.normal(size=3))))
        found, dcm = triad(v1, v2, tup(w1), tup(w2))
        assert found
        # A_true = (I - [dtheta x]) A_estimated with A_true = I
        row[:] = -Rotation.from_matrix(np.array(dcm).T).as_rotvec()
    p = np.array(row_major(triad_covariance(tup(w1), tup(w2), first, second))).reshape(3, 3)
    whitened = np.linalg.solve(np.linalg.cholesky(p), errors.T)
    np.testing.assert_allclose(np.cov(whitened), np.eye(3), atol=0.06)


FACES = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], dtype=float)


def cells(normals):
    table = np.zeros(len(normals), [(n, float) for n in ("nx", "ny", "nz", "side")])
    table["nx"], table["ny"], table["nz"] = normals.T
    return table


def find_sun(normals, sun_b, field_b, sigma=0.01):
    outputs = np.maximum(normals @ sun_b, 0.0)
    mask = sum(1 << i for i in np.flatnonzero(outputs > 0.1))
    table = cells(normals)
    sun = lit_sun(table, outputs, mask, int(np.argmax(outputs)))
    return chosen_sun(table, outputs, mask, sun, float(sun_b @ field_b), tup(field_b), sigma, 0.1)


def test_three_lit_faces_give_the_sun():
    sun_b, field_b = unit(np.array([0.5, -0.6, 0.4])), unit(np.array([0.1, 0.2, -1.0]))
    found, sigma, known = find_sun(FACES, sun_b, field_b)
    assert known
    np.testing.assert_allclose(found, sun_b, atol=1e-14)
    assert sigma == pytest.approx(0.01)


@pytest.mark.parametrize("height", [0.6, -0.6])
def test_the_field_tells_on_which_side_of_four_faces_in_a_plane_the_sun_is(height):
    sun_b, field_b = unit(np.array([0.5, -0.6, height])), unit(np.array([0.1, 0.2, 1.0]))
    found, _, known = find_sun(FACES[:4], sun_b, field_b)
    assert known
    np.testing.assert_allclose(found, sun_b, atol=1e-12)


def test_a_dark_face_tells_it_where_the_field_cannot():
    sun_b, in_plane = unit(np.array([0.5, -0.6, -0.6])), np.array([0.6, 0.8, 0.0])
    assert not find_sun(FACES[:4], sun_b, in_plane)[2]
    found, _, known = find_sun(FACES[:5], sun_b, in_plane)
    assert known
    np.testing.assert_allclose(found, sun_b, atol=1e-12)


def test_a_sun_that_contradicts_its_angle_to_the_field_is_none():
    sun_b, field_b = unit(np.array([0.5, -0.6, 0.4])), unit(np.array([0.1, 0.2, -1.0]))
    outputs = np.maximum(FACES @ sun_b, 0.0)
    sun = lit_sun(cells(FACES), outputs, 0b011001, 3)
    right = float(sun_b @ field_b)
    assert chosen_sun(cells(FACES), outputs, 0b011001, sun, right, tup(field_b), 0.01, 0.1)[2]
    assert not chosen_sun(cells(FACES), outputs, 0b011001, sun, right + 0.1, tup(field_b), 0.01, 0.1)[2]


@pytest.mark.parametrize(("sun_sigma", "field_sigma"), [(0.02, 0.005), (0.005, 0.02)])
def test_the_more_accurate_direction_comes_first(sun_sigma, field_sigma):
    sun, field = separated(1.0)
    begun = start(tup(sun), sun_sigma, tup(sun), tup(field), field_sigma, tup(field))
    assert begun.found
    order = (field, sun, field_sigma, sun_sigma) if field_sigma < sun_sigma else (sun, field, sun_sigma, field_sigma)
    assert begun.covariance == triad_covariance(tup(order[0]), tup(order[1]), order[2], order[3])
