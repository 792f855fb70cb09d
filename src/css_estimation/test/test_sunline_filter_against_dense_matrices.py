# SPDX-License-Identifier: Apache-2.0
"""The filter on tuples against the equations of O'Keefe & Schaub 2013 in matrices, stacked over the cells."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from okeefe_spacecraft import okeefe_values
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from css_common.vectors import mat3
from css_estimation.sun import sunline_ekf
from css_estimation.sun.sunline_filter import constrain, propagate, update_cell, update_cells
from css_estimation.symmetric import congruence, product, row_major
from css_sensors.cells import CELLS


@pytest.fixture
def rng():
    """Numbers of this test alone: they do not depend on which others run."""
    return np.random.default_rng(20130601)


def skew(w):
    return np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])


def dense(p):
    return np.array(row_major(p)).reshape(3, 3)


def upper(m):
    return tuple(float(m[i, j]) for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)))


def random_covariance(rng, scale=0.3):
    a = scale * rng.normal(size=(3, 3))
    return a @ a.T + 1e-4 * np.eye(3)


def random_direction(rng):
    s = rng.normal(size=3)
    return s / np.linalg.norm(s)


def stacked_update(s, p, normals, outputs, variance):
    """Eqs. 11-13 with all cells at once, and the NIS of the stacked innovation."""
    h = np.asarray(normals)
    r = np.diag(np.broadcast_to(variance, len(h)))
    innovation = np.asarray(outputs) - h @ s
    innovation_covariance = h @ p @ h.T + r
    k = p @ h.T @ np.linalg.inv(innovation_covariance)
    a = np.eye(3) - k @ h
    return (
        s + k @ innovation,
        a @ p @ a.T + k @ r @ k.T,
        innovation @ np.linalg.solve(innovation_covariance, innovation),
    )


def test_propagation_is_the_solution_of_the_lyapunov_equation(rng):
    """Eq. 7 with F = -[w x], G = I, integrated numerically."""
    w = np.array([0.03, -0.05, 0.02])
    s, p, q, dt = random_direction(rng), random_covariance(rng), 1e-2, 2.0

    def derivative(_, y):
        x, c = y[:3], y[3:].reshape(3, 3)
        f = -skew(w)
        return np.concatenate((np.cross(x, w), (f @ c + c @ f.T + q * np.eye(3)).ravel()))

    end = solve_ivp(derivative, (0.0, dt), np.concatenate((s, p.ravel())), rtol=1e-11, atol=1e-13).y[:, -1]
    s_hat, p_hat = propagate(tuple(s), upper(p), tuple(w), dt, q)
    np.testing.assert_allclose(s_hat, end[:3], rtol=1e-9)
    np.testing.assert_allclose(dense(p_hat), end[3:].reshape(3, 3), rtol=1e-8, atol=1e-12)
    np.testing.assert_allclose(s_hat, expm(-skew(w) * dt) @ s, rtol=1e-12)


@pytest.mark.parametrize("count", [1, 2, 4, 8])
def test_cells_in_sequence_equal_the_stacked_joseph_update(rng, count):
    for _ in range(50):
        s, p = random_direction(rng), random_covariance(rng)
        normals = [random_direction(rng) for _ in range(count)]
        outputs = rng.uniform(0.0, 1.0, count)
        variance = 10.0 ** rng.uniform(-4, -1)
        expected_s, expected_p, expected_nis = stacked_update(s, p, normals, outputs, variance)
        s_hat, p_hat, nis = tuple(s), upper(p), 0.0
        for n, v in zip(normals, outputs, strict=True):
            s_hat, p_hat, q = update_cell(s_hat, p_hat, tuple(n), float(v), variance)
            nis += q
        np.testing.assert_allclose(s_hat, expected_s, rtol=1e-8, atol=1e-11)
        np.testing.assert_allclose(dense(p_hat), expected_p, rtol=1e-7, atol=1e-12)
        assert nis == pytest.approx(expected_nis, rel=1e-8)


def test_constraint_projects_on_the_tangent_plane(rng):
    for _ in range(50):
        s, p = random_direction(rng), random_covariance(rng, 0.1)
        length = rng.uniform(0.5, 1.5)
        s_hat, p_hat = constrain(tuple(length * s), tuple(s), upper(p), 1e9)
        t = np.eye(3) - np.outer(s, s)
        tangent = t @ p @ t
        expected = tangent + 0.5 * np.trace(tangent) ** 2 * np.outer(s, s)
        np.testing.assert_allclose(s_hat, s, rtol=1e-12, atol=1e-15)
        np.testing.assert_allclose(dense(p_hat), expected, rtol=1e-9, atol=1e-14)


def test_second_moment_along_the_sun_line_is_what_tangent_errors_leave():
    """s turned by small random angles: the second moment of its shortening is trace^2 / 2."""
    sigma = 0.1
    draws = sigma * np.random.default_rng(5).normal(size=(400_000, 2))
    shortening = 1.0 - np.cos(np.hypot(draws[:, 0], draws[:, 1]))
    _, p = constrain((0.0, 0.0, 1.0), (0.0, 0.0, 1.0), (sigma**2, 0.0, 0.0, sigma**2, 0.0, 0.0), 1e9)
    assert p[5] == pytest.approx(np.mean(shortening**2), rel=0.02)


def test_bound_keeps_the_covariance_a_covariance(rng):
    p = random_covariance(rng, 5.0)
    _, bounded = constrain((0.0, 0.0, 1.0), (0.0, 0.0, 1.0), upper(p), 4.0)
    assert np.diag(dense(bounded)).max() == pytest.approx(4.0)
    assert np.linalg.eigvalsh(dense(bounded)).min() > 0.0


def test_a_state_of_no_length_keeps_the_predicted_direction():
    s_hat, _ = constrain((1e-9, 0.0, 0.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0, 1.0, 0.0, 1.0), 4.0)
    assert s_hat == (0.0, 1.0, 0.0)


@settings(max_examples=200)
@given(st.lists(st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(-1, 1)), min_size=1, max_size=40))
def test_covariance_stays_positive_through_any_run_of_cells(directions):
    p, s = (4.0, 0.0, 0.0, 4.0, 0.0, 4.0), (0.0, 0.0, 1.0)
    for n in directions:
        length = math.sqrt(sum(c * c for c in n))
        if length < 1e-3:
            continue
        s, p, _ = update_cell(s, p, tuple(c / length for c in n), 0.5, 1e-8)
    assert np.linalg.eigvalsh(dense(p)).min() > -1e-12


def test_symmetric_helpers(rng):
    m, p = Rotation.random(rng=rng).as_matrix(), random_covariance(rng)
    np.testing.assert_allclose(dense(congruence(mat3(m), upper(p))), m @ p @ m.T, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(product(upper(p), (1.0, 2.0, 3.0)), p @ (1.0, 2.0, 3.0), rtol=1e-13)


# cell 3 is predicted lit and dark, cell 5 is above 0.4 of the brightest, 7 is above it by 0.01
MANY = ((0.7, 0.7, 0.7, 0.0, 0.1, 0.5, 0.27, 0.29), 0b10101111)
TWO = ((0.7, 0.7, 0.0, 0.02, 0.1, 0.0, 0.1, 0.0), 0b1111)


@pytest.mark.parametrize("beyond_edge", [False, True])
@pytest.mark.parametrize(("outputs", "cells", "narrow"), [(*MANY, ()), (*TWO, (2, 3))], ids=["many", "two"])
def test_cells_used_are_the_predicted_and_the_bright_ones(outputs, cells, narrow, beyond_edge):
    p = sunline_ekf.parameters(okeefe_values(CELLS + sunline_ekf.PARAMETERS)).sunline
    predicted_b = (0.0, 0.0, 1.0)  # all four cells of the +z side
    voltages = np.array(outputs)
    prior = (0.01, 0.0, 0.0, 0.01, 0.0, 0.01)
    s, cov, nis, count, mask = update_cells(
        p.layout, p.gate, p.cell_variance, beyond_edge, 0.0, predicted_b, prior, voltages, 0
    )
    assert mask == cells
    assert count == cells.bit_count()
    used = [i for i in range(8) if mask >> i & 1]
    normals = [[p.layout.cells[i][c] for c in ("nx", "ny", "nz")] for i in used]
    # of a dark cell the Sun's cosine is below that at the edge of its view, 0.5, or zero
    variances = p.cell_variance + np.where(np.isin(used, narrow) & beyond_edge, 0.5**2 / 3.0, 0.0)
    expected = stacked_update(np.array(predicted_b), dense(prior), normals, voltages[used], variances)
    np.testing.assert_allclose(s, expected[0], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(dense(cov), expected[1], rtol=1e-8, atol=1e-14)
    assert nis == pytest.approx(expected[2], rel=1e-9)
