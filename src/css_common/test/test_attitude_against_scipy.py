# SPDX-License-Identifier: Apache-2.0
"""Attitude kinematics against scipy's rotations and matrix exponential, and against their own algebra.

scipy's rotations turn vectors, direction cosine matrices turn frames: the one is the transpose of the other.
"""

import math

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from css_common import attitude
from css_common.vectors import mat3, matmul, norm, scale, transpose

components = st.floats(-3.0, 3.0, allow_subnormal=False)
vectors = st.tuples(components, components, components)
inside = vectors.map(attitude.mrp_shadow)
rates = st.tuples(*[st.floats(-2.0, 2.0, allow_subnormal=False)] * 3)


def frame_turn(sigma) -> np.ndarray:
    """scipy's direction cosine matrix of an MRP set."""
    return Rotation.from_mrp(sigma).as_matrix().T


@given(vectors)
def test_dcm(sigma):
    assert_allclose(attitude.mrp_to_dcm(sigma), frame_turn(sigma), atol=2e-15, rtol=0.0)


@given(vectors)
def test_dcm_is_a_rotation(sigma):
    dcm = np.array(attitude.mrp_to_dcm(sigma))
    assert_allclose(dcm @ dcm.T, np.eye(3), atol=2e-15, rtol=0.0)
    assert_allclose(np.linalg.det(dcm), 1.0, atol=2e-15, rtol=0.0)


@given(vectors)
def test_quaternion_is_the_frame_turn_with_the_scalar_last(sigma):
    q = attitude.mrp_to_quaternion(sigma)
    assert_allclose(Rotation.from_quat(q).as_matrix().T, attitude.mrp_to_dcm(sigma), atol=2e-15, rtol=0.0)
    assert_allclose(np.linalg.norm(q), 1.0, atol=4e-16, rtol=0.0)


@given(inside)
def test_mrp_to_dcm_and_back(sigma):
    # at half a turn both signs are the same attitude
    assume(norm(sigma) < 0.999)
    assert_allclose(attitude.dcm_to_mrp(attitude.mrp_to_dcm(sigma)), sigma, atol=2e-15, rtol=0.0)


@given(inside)
def test_mrp_to_quaternion_and_back(sigma):
    assert_allclose(attitude.quaternion_to_mrp(attitude.mrp_to_quaternion(sigma)), sigma, atol=4e-16, rtol=1e-14)


@given(vectors.filter(lambda v: norm(v) > 1e-3), st.sampled_from([math.pi, math.nextafter(math.pi, 0.0), 3.14159]))
def test_half_a_turn_about_any_axis_keeps_its_accuracy(axis, angle):
    dcm = Rotation.from_rotvec(np.array(axis) * (angle / norm(axis))).as_matrix().T
    back = attitude.mrp_to_dcm(attitude.dcm_to_mrp(mat3(np.asarray(dcm))))
    assert_allclose(back, dcm, atol=4e-15, rtol=0.0)


@given(vectors.filter(lambda v: norm(v) > 1e-3))
def test_shadow_is_the_same_attitude_inside_the_unit_ball(sigma):
    shadow = attitude.mrp_shadow(sigma)
    assert norm(shadow) <= 1.0 + 1e-15
    assert_allclose(attitude.mrp_to_dcm(shadow), attitude.mrp_to_dcm(sigma), atol=4e-15, rtol=0.0)


@given(vectors, vectors)
def test_sum_is_the_product_of_matrices(first, then):
    expected = matmul(attitude.mrp_to_dcm(then), attitude.mrp_to_dcm(first))
    total = attitude.mrp_add(first, then)
    assert norm(total) <= 1.0 + 1e-15
    assert_allclose(attitude.mrp_to_dcm(total), expected, atol=2e-14, rtol=0.0)


@given(inside, inside)
def test_difference_undoes_the_sum(reference, relative):
    total = attitude.mrp_add(reference, relative)
    found = attitude.mrp_to_dcm(attitude.mrp_subtract(total, reference))
    assert_allclose(found, attitude.mrp_to_dcm(relative), atol=2e-14, rtol=0.0)


@given(vectors, st.floats(0.0, 1e-9))
def test_sum_near_a_full_turn_keeps_its_accuracy(sigma, off):
    # first sigma, then almost all the way on to a full turn: the closed form divides by almost zero there
    assume(norm(sigma) > 1e-2)
    rest = scale((1.0 + off) / norm(sigma) ** 2, sigma)
    found = attitude.mrp_to_dcm(attitude.mrp_add(sigma, rest))
    expected = matmul(attitude.mrp_to_dcm(rest), attitude.mrp_to_dcm(sigma))
    assert_allclose(found, expected, atol=2e-14, rtol=0.0)


@given(inside, rates)
def test_rate_against_a_central_difference_of_the_matrix_equation(sigma, omega):
    # dcm(t) = exp(-[omega x] t) dcm(0) is exact for a constant rate; the step balances truncation and rounding
    h = 1e-5

    def after(t):
        turned = matmul(attitude.rotation_vector_to_dcm(scale(t, omega)), attitude.mrp_to_dcm(sigma))
        mrp = np.array(attitude.dcm_to_mrp(turned))
        shadow = -mrp / max(mrp @ mrp, 1e-12)
        return min(mrp, shadow, key=lambda s: np.linalg.norm(s - sigma))

    difference = (after(h) - after(-h)) / (2.0 * h)
    assert_allclose(attitude.mrp_rate(sigma, omega), difference, atol=2e-9, rtol=0.0)


@given(vectors, st.floats(-12.0, 0.0))
def test_rotation_vector_against_scipy(direction, exponent):
    phi = scale(10.0**exponent, direction)
    expected = Rotation.from_rotvec(phi).as_matrix().T
    assert_allclose(attitude.rotation_vector_to_dcm(phi), expected, atol=2e-15, rtol=0.0)


@given(st.tuples(*[st.floats(-1.0, 1.0, allow_subnormal=False)] * 3), st.floats(-12.0, 0.0))
def test_rotation_vector_against_the_matrix_exponential(direction, exponent):
    x, y, z = phi = scale(10.0**exponent, direction)
    expected = expm(-np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]))
    assert_allclose(attitude.rotation_vector_to_dcm(phi), expected, atol=4e-15, rtol=0.0)


def test_rotation_vector_has_no_seam_between_series_and_closed_form():
    for angle in (math.nextafter(1e-4, 0.0), 1e-4, math.nextafter(1e-4, 1.0)):
        dcm = attitude.rotation_vector_to_dcm((angle, 0.0, 0.0))
        assert_allclose(dcm[1][2], math.sin(angle), rtol=1e-15)
        assert_allclose(1.0 - dcm[1][1], 1.0 - math.cos(angle), atol=2e-16)


def test_identity_is_exact():
    identity = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    zero = (0.0, 0.0, 0.0)
    assert attitude.mrp_to_dcm(zero) == attitude.rotation_vector_to_dcm(zero) == transpose(identity) == identity
    assert attitude.dcm_to_quaternion(identity) == (0.0, 0.0, 0.0, 1.0)
    assert attitude.dcm_to_mrp(identity) == attitude.mrp_shadow(zero) == attitude.mrp_add(zero, zero) == zero


@given(vectors, vectors)
def test_compiled_and_plain_python_agree(a, b):
    assert_allclose(attitude.mrp_add(a, b), attitude.mrp_add.py_func(a, b), rtol=1e-13, atol=1e-15)
    assert_allclose(attitude.mrp_to_dcm(a), attitude.mrp_to_dcm.py_func(a), rtol=0.0, atol=1e-15)
    assert_allclose(attitude.mrp_rate(a, b), attitude.mrp_rate.py_func(a, b), rtol=1e-13, atol=1e-15)


@given(vectors, st.floats(-12.0, 2.0))
def test_rotation_vector_to_mrp_against_scipy(direction, exponent):
    phi = scale(10.0**exponent, direction)
    sigma = attitude.rotation_vector_to_mrp(phi)
    assert np.linalg.norm(sigma) <= 1.0 + 1e-12
    expected = Rotation.from_rotvec(phi)
    assert_allclose(attitude.mrp_to_dcm(sigma), expected.as_matrix().T, atol=1e-12, rtol=0.0)
    assert_allclose(attitude.mrp_angle(sigma), expected.magnitude(), atol=1e-11, rtol=1e-9)
    again = Rotation.from_rotvec(attitude.mrp_to_rotation_vector(sigma))
    assert (again * expected.inv()).magnitude() < 1e-11
