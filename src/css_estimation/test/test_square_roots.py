# SPDX-License-Identifier: Apache-2.0
"""Roots of covariances, and points about them, against dense matrices."""

import numpy as np
import pytest
from okeefe_spacecraft import okeefe_values

from css_common.declared import builder, table_of
from css_estimation.sun.square_root import add_vector, set_diagonal, solve_lower, take_vector
from css_estimation.sun.unscented import (
    POINTS,
    STATES,
    PointParameters,
    draw_points,
    gather_points,
    new_memory,
    spread_of,
    update,
)

CELLS = 8


@pytest.fixture
def rng():
    """Numbers of this test alone: they do not depend on which others run."""
    return np.random.default_rng(2001)


def points(**changes):
    changed = {f"points__{name}": value for name, value in changes.items()}
    return builder(PointParameters)(okeefe_values(table_of(PointParameters), **changed))


def random_root(rng, size=STATES):
    a = rng.normal(size=(size, size))
    return np.linalg.cholesky(a @ a.T + 0.01 * np.eye(size))


def filled(rng):
    memory = new_memory(CELLS)
    memory.x[:], memory.root[:] = rng.normal(size=STATES), random_root(rng)
    return memory


@pytest.mark.parametrize("size", [1, 3, 6])
def test_a_vector_added_and_taken_away(rng, size):
    for _ in range(50):
        root = random_root(rng)
        before, v = root[:size, :size] @ root[:size, :size].T, rng.normal(size=STATES)
        rest = root[size:].copy()
        add_vector(root, size, v.copy())
        added = before + np.outer(v[:size], v[:size])
        np.testing.assert_allclose(root[:size, :size] @ root[:size, :size].T, added, rtol=1e-12, atol=1e-13)
        assert np.all(np.diag(root)[:size] > 0.0) and np.array_equal(root, np.tril(root))
        assert take_vector(root, size, v.copy())
        np.testing.assert_allclose(root[:size, :size] @ root[:size, :size].T, before, rtol=1e-9, atol=1e-10)
        np.testing.assert_array_equal(root[size:], rest)


def test_vectors_alone_make_a_root():
    """From nothing, column by column, some states without any variance."""
    root, columns = np.zeros((4, 4)), np.array([[1.0, 0.0, 2.0, 0.0], [0.5, 0.0, -1.0, 0.0]])
    for column in columns:
        add_vector(root, 4, column.copy())
    np.testing.assert_allclose(root @ root.T, columns.T @ columns, atol=1e-15)


@pytest.mark.parametrize("excess", [1.0, 1.1, np.nan])
def test_more_than_there_is_cannot_be_taken(rng, excess):
    root = random_root(rng)
    assert not take_vector(root, STATES, excess * root[:, 0])


def test_solve(rng):
    root, b = random_root(rng), rng.normal(size=STATES)
    solution = b.copy()
    solve_lower(root, STATES, solution)
    np.testing.assert_allclose(root @ solution, b, rtol=1e-10)


@pytest.mark.parametrize(("alpha", "kappa"), [(0.02, 0.0), (0.5, 1.0), (1.0, 0.0)])
def test_points_have_the_moments_of_the_estimate(rng, alpha, kappa):
    memory, p = filled(rng), points(alpha=alpha, kappa=kappa)
    draw_points(p, memory)
    weights = np.full(POINTS, p.spread.weight)
    weights[0] = 1.0 - 2 * STATES * p.spread.weight
    deviation = memory.points - memory.x
    np.testing.assert_allclose(weights @ deviation, 0.0, atol=1e-10)
    np.testing.assert_allclose((weights * deviation.T) @ deviation, memory.root @ memory.root.T, rtol=1e-9, atol=1e-10)


def test_the_spread_is_that_of_the_scaled_transform():
    """lambda = alpha^2 (n + kappa) - n."""
    alpha, beta, kappa, n = 0.3, 2.0, 1.0, STATES
    lam = alpha**2 * (n + kappa) - n
    spread = spread_of(alpha, beta, kappa)
    assert spread.gamma == pytest.approx(np.sqrt(n + lam))
    assert spread.weight == pytest.approx(0.5 / (n + lam))
    assert spread.middle == pytest.approx(lam / (n + lam) + 1.0 - alpha**2 + beta)


def test_prediction_of_a_linear_model_is_that_of_a_kalman_filter(rng):
    memory, p, m = filled(rng), points(), rng.normal(size=(STATES, STATES))
    x, covariance, noise = memory.x.copy(), memory.root @ memory.root.T, rng.uniform(0.0, 1.0, STATES)
    draw_points(p, memory)
    memory.points[:] = memory.points @ m.T
    assert gather_points(p, tuple(noise.tolist()), memory)
    np.testing.assert_allclose(memory.x, m @ x, rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(memory.root @ memory.root.T, m @ covariance @ m.T + np.diag(noise), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("count", [1, 3, CELLS])
def test_update_by_a_linear_model_is_that_of_a_kalman_filter(rng, count):
    memory, p, variance = filled(rng), points(), 0.03
    h, readings = rng.normal(size=(count, STATES)), rng.normal(size=count)
    x, covariance = memory.x.copy(), memory.root @ memory.root.T
    draw_points(p, memory)
    memory.outputs[:, :count], memory.readings[:count] = memory.points @ h.T, readings
    sound, nis = update(p, memory, count, variance)
    s = h @ covariance @ h.T + variance * np.eye(count)
    gain, innovation = covariance @ h.T @ np.linalg.inv(s), readings - h @ x
    assert sound
    np.testing.assert_allclose(memory.x, x + gain @ innovation, rtol=1e-7, atol=1e-8)
    np.testing.assert_allclose(memory.root @ memory.root.T, covariance - gain @ s @ gain.T, rtol=1e-7, atol=1e-8)
    assert nis == pytest.approx(innovation @ np.linalg.solve(s, innovation), rel=1e-7)


def test_a_quadratic_model_has_the_mean_and_variance_of_normal_errors(rng):
    """x^2 of a normal x: the mean m^2 + v exactly, the variance 4 m^2 v + 2 v^2 by beta = 2, less what alpha hides."""
    memory, alpha = new_memory(CELLS), 0.02
    p = points(alpha=alpha)
    mean, variance = 1.5, 0.2
    memory.x[0] = mean
    set_diagonal(memory.root, (variance, 1.0, 1.0, 1.0, 1.0, 1.0))
    draw_points(p, memory)
    memory.points[:, 0] **= 2
    assert gather_points(p, (0.0,) * STATES, memory)
    assert memory.x[0] == pytest.approx(mean**2 + variance, rel=1e-9)
    # sum of w dev^2 + (beta - alpha^2) (mean shift)^2 + fourth-order part of the points, alpha^2 (n + kappa) v^2
    expected = 4.0 * mean**2 * variance + (2.0 - alpha**2) * variance**2 + alpha**2 * STATES * variance**2
    assert memory.root[0, 0] ** 2 == pytest.approx(expected, rel=1e-6)
    assert memory.root[0, 0] ** 2 == pytest.approx(4.0 * mean**2 * variance + 2.0 * variance**2, rel=1e-3)


@pytest.mark.parametrize("centre", [True, False])
def test_the_estimate_is_the_mean_or_the_moved_one(rng, centre):
    memory, p = filled(rng), points(centre=centre)
    draw_points(p, memory)
    memory.points[:] = memory.points**2
    moved = memory.points[0].copy()
    gather_points(p, (0.1,) * STATES, memory)
    assert np.array_equal(memory.x, moved if centre else memory.mean)
    assert not np.allclose(moved, memory.mean, rtol=1e-3)
