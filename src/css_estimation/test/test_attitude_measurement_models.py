# SPDX-License-Identifier: Apache-2.0
"""Measurement models of the attitude filter: partial derivatives against differences, errors against algebra."""

import math

import numpy as np
import pytest
from okeefe_spacecraft import okeefe_values

from css_common.attitude import rotation_vector_to_dcm
from css_common.sections import CELLS
from css_common.vectors import multiply
from css_estimation.attitude import attitude_options, flight_references
from css_estimation.attitude.cell_voltages import cell_measurement
from css_estimation.attitude.direction_measurement import normalised_innovation
from css_estimation.attitude.field_direction import field_measurement
from css_estimation.attitude.lit_sun_vector import lit_sun, sun_vector_measurement
from css_estimation.sun.cell_calibration import SCALE, TILT_1, TILT_2, nominal

FACES = [1.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -1.0]
TABLE = CELLS + attitude_options.PARAMETERS + flight_references.PARAMETERS
STEP = 1e-6


@pytest.fixture
def rng():
    """Numbers of this test alone: they do not depend on which others run."""
    return np.random.default_rng(5)


def parameters(**changes):
    changes.setdefault("cells__normals", FACES)
    changes.setdefault("cells__field_of_view_deg", 180.0)
    changes.setdefault("cells__clip_normal", [0.0, 0.0, 0.0])
    return attitude_options.parameters(okeefe_values(TABLE, **changes))


def direction(rng):
    v = rng.normal(size=3)
    return tuple((v / np.linalg.norm(v)).tolist())


def turned(axis, angle, v):
    """Components of `v` once the body has turned: what the true attitude makes of a predicted direction."""
    turn = [0.0, 0.0, 0.0]
    turn[axis] = angle
    return multiply(rotation_vector_to_dcm(tuple(turn)), v)


def gradient(function, v):
    """Derivative to the attitude error of what a function predicts for direction `v`."""
    return np.array([(function(turned(a, STEP, v)) - function(turned(a, -STEP, v))) / (2.0 * STEP) for a in range(3)])


def test_field(rng):
    field_b = tuple(3e-5 * c for c in direction(rng))
    m = field_measurement(field_b, field_b, (200e-9) ** 2)
    assert m.dof == 2 and m.residual == (0.0, 0.0, 0.0)
    assert m.variance == pytest.approx((200e-9 / 3e-5) ** 2)
    for k in range(2):

        def component(true_b, k=k):
            return field_measurement(true_b, field_b, 1.0).residual[k]

        np.testing.assert_allclose(m.rows[k], gradient(component, field_b), atol=1e-9)


@pytest.mark.parametrize("bad", [(0.0, 0.0, 0.0), (math.nan, 0.0, 0.0), (math.inf, 0.0, 0.0), (1.0, 0.0, 0.0)])
def test_what_is_no_field_gives_no_measurement(bad):
    assert field_measurement(bad, (3e-5, 0.0, 0.0), 1e-14).dof == 0
    assert field_measurement((3e-5, 0.0, 0.0), bad, 1e-14).dof == 0


def test_sun_vector_is_the_least_squares_solution_with_its_covariance(rng):
    p = parameters(cells__normals=[c for _ in range(5) for c in direction(rng)])
    cells = p.cells.layout.cells
    n = np.stack([cells["nx"], cells["ny"], cells["nz"]], axis=1)
    outputs = np.abs(rng.normal(size=5)) + 0.2
    predicted_b = direction(rng)
    sun = lit_sun(cells, outputs, 0b11111, int(np.argmax(outputs)))
    np.testing.assert_allclose(sun.vector, np.linalg.lstsq(n, outputs, rcond=None)[0], atol=1e-12)
    m = sun_vector_measurement(sun, predicted_b, 0.02**2)
    covariance = rng.normal(size=(6, 6))
    covariance = covariance @ covariance.T
    # the textbook form: residual s - s_predicted, H = [s_predicted x], R = sigma^2 (N^T N)^-1
    x, y, z = predicted_b
    h = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    s = h @ covariance[:3, :3] @ h.T + 0.02**2 * np.linalg.inv(n.T @ n)
    residual = np.array(sun.vector) - predicted_b
    assert normalised_innovation(covariance, m) == pytest.approx(residual @ np.linalg.solve(s, residual), rel=1e-8)


@pytest.mark.parametrize(("mask", "rank"), [(0b000101, 2), (0b000001, 1), (0b010101, 3), (0b001100, 1)])
def test_normals_that_do_not_span_space_give_no_sun_vector(mask, rank):
    p = parameters()
    outputs = np.full(6, 0.5)
    sun = lit_sun(p.cells.layout.cells, outputs, mask, int(mask & -mask).bit_length() - 1)
    assert sun.rank == rank
    assert sun_vector_measurement(sun, (0.0, 0.6, 0.8), 1e-4).dof == (3 if rank == 3 else 0)


@pytest.mark.parametrize("used", ["lit_or_expected", "lit"])
def test_voltage_partials(rng, used):
    p = parameters(
        cells_used=used, calibration__mode="estimate", calibration__alignment=True, cells__normals=[*direction(rng)] * 3
    ).cells
    sun_b, intensity, albedo = direction(rng), 0.97, 0.1
    if np.dot([p.layout.cells[1][n] for n in ("nx", "ny", "nz")], sun_b) < 0.0:
        sun_b = tuple(-c for c in sun_b)
    calibration = nominal(3)
    calibration[1] = 1.1, 0.02, -0.03

    def measured(true_b, table=calibration):
        return -cell_measurement(p, table, 1, 0.0, True, true_b, intensity, albedo).residual

    m = cell_measurement(p, calibration, 1, 0.7, True, sun_b, intensity, albedo)
    assert m.residual == pytest.approx(0.7 - measured(sun_b))
    np.testing.assert_allclose(m.partials.attitude, gradient(measured, sun_b), atol=1e-8)
    assert (m.partials.first, m.partials.errors) == (9, 3)
    for column, tolerance in ((SCALE, 1e-8), (TILT_1, 2e-3), (TILT_2, 2e-3)):
        up, down = calibration.copy(), calibration.copy()
        up[1, column] += STEP
        down[1, column] -= STEP
        numeric = (measured(sun_b, up) - measured(sun_b, down)) / (2.0 * STEP)
        # tilts are taken about the nominal normal, of first order in those already found
        bound = tolerance if column == SCALE else tolerance + 0.04 * 1.1
        assert m.partials.calibration[column] == pytest.approx(numeric, abs=bound)


@pytest.mark.parametrize(
    ("used", "is_lit", "cosine", "is_used", "predicted"),
    [
        ("lit_or_expected", True, 0.6, True, 0.6),
        ("lit_or_expected", True, -0.6, True, 0.0),
        ("lit_or_expected", False, 0.6, True, 0.6),
        ("lit_or_expected", False, -0.6, False, 0.0),
        ("lit", True, 0.6, True, 0.6),
        ("lit", True, -0.6, True, -0.6),
        ("lit", False, 0.6, False, 0.6),
    ],
)
def test_which_cells_are_used_and_what_is_expected_of_them(used, is_lit, cosine, is_used, predicted):
    p = parameters(cells_used=used).cells
    sun_b = (cosine, 0.0, math.sqrt(1.0 - cosine**2))
    m = cell_measurement(p, nominal(6), 0, 0.5, is_lit, sun_b, 1.0, 0.0)
    assert m.used == is_used
    assert 0.5 - m.residual == pytest.approx(predicted)
    assert m.partials.attitude == pytest.approx((0.0, -sun_b[2], 0.0))


def test_an_uncertain_albedo_makes_a_cell_count_less():
    p = parameters(albedo__share_sigma=0.5).cells
    m = cell_measurement(p, nominal(6), 0, 0.5, True, (0.6, 0.0, 0.8), 1.0, 0.2)
    assert m.residual == pytest.approx(0.5 - 0.8)
    assert m.variance == pytest.approx(0.02**2 + 0.1**2)
