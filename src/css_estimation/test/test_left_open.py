# SPDX-License-Identifier: Apache-2.0
"""Spans of normals and mirror images in them, against numpy's singular values and matrices."""

import numpy as np
import pytest

from css_common.vectors import vector_of
from css_estimation.sun.cell_layout import CELL
from css_estimation.sun.left_open import mirrored, span_of, spread_along, surely_spans_space, tell_one_sun


def cells_of(normals):
    cells = np.zeros(len(normals), CELL)
    cells["nx"], cells["ny"], cells["nz"] = np.transpose(normals)
    return cells


def drawn(rng, count, dimensions=3):
    """Unit vectors (count, 3) in a random plane, line or all of space."""
    basis = np.linalg.qr(rng.normal(size=(3, 3)))[0][:, :dimensions]
    vectors = rng.normal(size=(count, dimensions)) @ basis.T
    return vectors / np.linalg.norm(vectors, axis=1)[:, None]


def near(rng, off):
    """Two unit vectors that are off a line by an angle [rad], on one side or on both."""
    a, across = np.linalg.qr(rng.normal(size=(3, 2)))[0].T
    return np.array([a, rng.choice([-1.0, 1.0]) * (np.cos(off) * a + np.sin(off) * across)])


SETS = [
    *[lambda rng, n=n, d=d: drawn(rng, n, d) for n in (1, 2, 3, 4, 8) for d in (1, 2, 3)],
    *[lambda rng, off=off: near(rng, off) for off in (1e-9, 1e-3, 0.15, 0.25, np.pi / 2)],
]


@pytest.mark.parametrize("make", SETS)
def test_the_span_and_its_mirror_are_those_of_the_matrix(make):
    rng = np.random.default_rng(7)
    for _ in range(20):
        normals = make(rng)
        # a cell that is not in the mask says nothing
        cells, mask = cells_of(np.vstack([drawn(rng, 1), normals])), (2 << len(normals)) - 2
        span = span_of(cells, mask)
        values, vectors = np.linalg.eigh(normals.T @ normals)
        assert span.rank == np.count_nonzero(values >= 1e-2 * values[-1])
        axes = np.array(span.axes)
        np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-9)
        np.testing.assert_allclose(span.spread, values[::-1], atol=1e-12)
        # of a direction that hardly shows, or of equal ones, any axes are right that have that spread
        np.testing.assert_allclose(spread_along(cells, mask, span.axes), span.spread, atol=1e-9)
        inside = vectors[:, 3 - span.rank :] @ vectors[:, 3 - span.rank :].T
        v = rng.normal(size=3)
        np.testing.assert_allclose(mirrored(span, vector_of(v)), (2.0 * inside - np.eye(3)) @ v, atol=1e-6)
        if surely_spans_space(cells, mask):
            assert span.rank == 3


@pytest.mark.parametrize("make", SETS)
def test_one_sun_is_told_by_normals_of_full_rank_among_the_cells_that_read(make):
    rng = np.random.default_rng(11)
    for _ in range(20):
        normals = make(rng)
        # a cell that would make three dimensions of them has no reading, and dark ones have
        cells = cells_of(np.vstack([drawn(rng, 3), normals]))
        outputs = np.concatenate([[np.nan] * 3, np.maximum(rng.uniform(-1.0, 1.0, len(normals)), 0.0)])
        values = np.linalg.eigvalsh(normals.T @ normals)
        assert tell_one_sun(cells, outputs) == bool(values[0] >= 1e-2 * values[-1])
    outputs[:3] = 0.0
    assert tell_one_sun(cells_of(np.vstack([np.eye(3), normals])), outputs)
