# SPDX-License-Identifier: Apache-2.0
"""TRIAD: exact for exact directions, its covariance against a Monte Carlo, and the start made of it."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from css_common.kernel import kernel
from css_estimation.attitude.attitude_start import chosen_sun, start
from css_estimation.attitude.lit_sun_vector import lit_sun
from css_estimation.attitude.triad import LEAST_SINE, triad, triad_covariance
from css_estimation.symmetric import row_major


def unit(v):
    return v / np.linalg.norm(v)


def tup(v):
    return tuple(float(c) for c in v)


def separated(angle, seed=1981):
    """Two directions so far apart, in a random frame."""
    turn = Rotation.random(random_state=seed).as_matrix()
    return turn @ np.array([0.0, 0.0, 1.0]), turn @ np.array([math.sin(angle), 0.0, math.cos(angle)])


seeds = st.integers(0, 2**32 - 1)


@given(st.floats(0.2, math.pi - 0.2), seeds, seeds)
def test_exact_directions_give_the_attitude(angle, seed, frame):
    w1, w2 = separated(angle, frame)
    dcm_bn = Rotation.random(random_state=seed).as_matrix()
    found, dcm = triad(tup(dcm_bn @ w1), tup(dcm_bn @ w2), tup(w1), tup(w2))
    assert found
    np.testing.assert_allclose(dcm, dcm_bn, atol=1e-14)


@pytest.mark.parametrize("angle", [0.0, 0.9 * LEAST_SINE, math.pi - 0.9 * LEAST_SINE, math.pi])
def test_directions_on_one_line_give_none(angle):
    w1, w2 = separated(angle)
    assert not triad(tup(w1), tup(w2), tup(w1), tup(w2))[0]
    assert not triad((math.nan,) * 3, tup(w2), tup(w1), tup(w2))[0]


@kernel
def attitudes(measured_1, measured_2, w1, w2, dcm_out):
    """Rotations (N, 3, 3) from N pairs of measured directions; how many pairs gave one."""
    count = 0
    for k in range(measured_1.shape[0]):
        a, b = measured_1[k], measured_2[k]
        found, dcm = triad((a[0], a[1], a[2]), (b[0], b[1], b[2]), w1, w2)
        count += found
        for i in range(3):
            for j in range(3):
                dcm_out[k, i, j] = dcm[i][j]
    return count


def measured(w, sigma, rng):
    """(20000, 3) directions that err by sigma [rad] about each axis across `w`."""
    v = w + sigma * np.cross(w, rng.normal(size=(20_000, 3)))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


@pytest.mark.parametrize("angle_deg", [25.0, 70.0, 90.0, 140.0])
@pytest.mark.parametrize(("first", "second"), [(0.002, 0.01), (0.01, 0.01), (0.01, 0.003)])
def test_covariance_against_a_monte_carlo(angle_deg, first, second):
    w1, w2 = separated(math.radians(angle_deg))
    rng = np.random.default_rng(1981)
    dcm = np.empty((20_000, 3, 3))
    assert attitudes(measured(w1, first, rng), measured(w2, second, rng), tup(w1), tup(w2), dcm) == 20_000
    # A_true = (I - [dtheta x]) A_estimated with A_true = I
    errors = -Rotation.from_matrix(dcm.transpose(0, 2, 1)).as_rotvec()
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
    mask = sum(1 << i for i in np.flatnonzero(outputs > 0.1).tolist())
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
