# SPDX-License-Identifier: Apache-2.0
"""Tuples of floats against numpy's arrays."""

import math
from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from css_common import vectors as v

components = st.floats(-1e3, 1e3, allow_subnormal=False)
vec3 = st.tuples(components, components, components)
mat3 = st.tuples(vec3, vec3, vec3)
# three products and two sums of numbers up to 1e6
ROUNDING: dict[str, Any] = {"rtol": 1e-12, "atol": 1e-9}


@given(vec3, vec3, components)
def test_products_and_sums(a, b, k):
    assert_allclose(v.dot(a, b), np.dot(a, b), **ROUNDING)
    assert_allclose(v.cross(a, b), np.cross(a, b), **ROUNDING)
    assert v.add(a, b) == tuple(np.add(a, b))
    assert v.subtract(a, b) == tuple(np.subtract(a, b))
    assert v.scale(k, a) == tuple(k * np.array(a))
    assert_allclose(v.norm(a), np.linalg.norm(a), rtol=1e-15, atol=1e-150)


@given(mat3, mat3, vec3)
def test_matrices(m, n, a):
    assert_allclose(v.multiply(m, a), np.array(m) @ a, **ROUNDING)
    assert_allclose(v.multiply_transposed(m, a), np.array(m).T @ a, **ROUNDING)
    assert_allclose(v.matmul(m, n), np.array(m) @ np.array(n), **ROUNDING)
    assert v.transpose(m) == tuple(map(tuple, np.array(m).T))


@given(mat3)
def test_arrays_come_in_as_tuples(m):
    array = np.array(m)
    assert v.mat3(array) == m
    assert v.row(array, 1) == m[1]


@given(vec3)
def test_unit_has_length_one_or_is_zero(a):
    length = v.norm(v.unit(a))
    assert length == 0.0 or math.isclose(length, 1.0, abs_tol=1e-15)
    assert all(math.isfinite(x) for x in v.unit(a))


def test_unit_never_gives_nan():
    for a in ((0.0, 0.0, 0.0), (1e-300, 0.0, 0.0), (5e-324, 5e-324, 0.0), (1e300, 1e300, 0.0)):
        assert not any(math.isnan(x) for x in v.unit(a))


@given(st.floats(-16.0, math.log10(math.pi)), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
def test_angle_between_is_accurate_from_tiny_to_a_half_turn(exponent, scale_a, scale_b):
    angle = 10.0**exponent
    a = v.scale(10.0**scale_a, (1.0, 0.0, 0.0))
    b = v.scale(10.0**scale_b, (math.cos(angle), math.sin(angle), 0.0))
    assert math.isclose(v.angle_between(a, b), angle, rel_tol=1e-14, abs_tol=0.0)
