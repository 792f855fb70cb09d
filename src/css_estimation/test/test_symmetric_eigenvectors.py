# SPDX-License-Identifier: Apache-2.0
"""Eigenvalues and eigenvectors of symmetric 3 x 3 matrices, of any rank and scale."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from css_estimation.symmetric import eigen


@settings(max_examples=300, deadline=None)
@given(
    arrays.arrays(np.float64, (3, 3), elements=st.floats(-1.0, 1.0)),
    st.integers(0, 3),
    st.sampled_from([1e-150, 1e-6, 1.0, 1e90]),
)
def test_matrix_is_rebuilt_and_vectors_are_orthonormal(factor, rank, size):
    factor[rank:] = 0.0
    m = size * (factor.T @ factor)
    values, vectors = eigen((m[0, 0], m[0, 1], m[0, 2], m[1, 1], m[1, 2], m[2, 2]))
    largest = max(np.abs(m).max(), 1e-300)
    axes = np.array(vectors)
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-14)
    np.testing.assert_allclose(axes.T @ np.diag(values) @ axes / largest, m / largest, atol=1e-14)
    np.testing.assert_allclose(np.array(values) / largest, np.linalg.eigvalsh(m)[::-1] / largest, atol=1e-14)


@pytest.mark.parametrize("values", [(1.0, 1.0, 1.0), (2.0, 1.0, 1.0), (1.0, 1.0, 0.0), (0.0, 0.0, 0.0)])
def test_equal_eigenvalues(values):
    turn = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
    m = turn @ np.diag(values) @ turn.T
    found, vectors = eigen((m[0, 0], m[0, 1], m[0, 2], m[1, 1], m[1, 2], m[2, 2]))
    assert found == pytest.approx(values, abs=1e-14)
    np.testing.assert_allclose(np.array(vectors).T @ np.diag(found) @ vectors, m, atol=1e-14)


def test_no_number_in_no_endless_loop():
    values, _ = eigen((np.nan, 0.1, 0.2, 1.0, 0.3, 1.0))
    assert np.isnan(values).any()
