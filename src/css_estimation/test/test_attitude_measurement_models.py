# SPDX-License-Identifier: Apache-2.0
"""Measurement models of the attitude filter: partial derivatives against differences, errors against algebra."""

import math

import numpy as np
import pytest
from okeefe_spacecraft import okeefe_values

from css_common.attitude import rotation_vector_to_dcm
from css_common.vectors import multiply, vector_of
from css_estimation.attitude import attitude_options, flight_references
from css_estimation.attitude.cell_voltages import cell_measurement
from css_estimation.attitude.direction_measurement import normalised_innovation
from css_estimation.attitude.earth_on_cells import EarthOnCells
from css_estimation.attitude.field_direction import biased_field_measurement, field_measurement
from css_estimation.attitude.lit_sun_vector import lit_sun, sun_vector_measurement
from css_estimation.attitude.slow_errors import BRIGHTNESS, FIELD, MAGNETOMETER
from css_estimation.sun.cell_calibration import SCALE, TILT_1, TILT_2, nominal
from css_sensors.cells import CELLS

FACES = [1.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -1.0]
TABLE = CELLS + attitude_options.PARAMETERS + flight_references.PARAMETERS
STEP = 1e-6
NONE = np.zeros(3)
NEVER = -2.0
"""Cosine of the Sun below which a cell looks away: none does."""


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
    return multiply(rotation_vector_to_dcm(vector_of(np.asarray(turn))), v)


def gradient(function, v):
    """Derivative to the attitude error of what a function predicts for direction `v`."""
    return np.array([(function(turned(a, STEP, v)) - function(turned(a, -STEP, v))) / (2.0 * STEP) for a in range(3)])


def earth(light, slopes=None, brightness=1.0):
    """Light of the Earth on cells, whose brightness is an error of the filter."""
    light = np.asarray(light, dtype=float)
    slopes = np.zeros((len(light), 3)) if slopes is None else slopes
    return EarthOnCells(True, light, slopes, brightness, BRIGHTNESS, 1)


def dark(cells):
    """An Earth without light that is no error of the filter."""
    return EarthOnCells(False, np.zeros(cells), np.zeros((cells, 3)), 1.0, 0, 0)


def test_field(rng):
    field_b = tuple(3e-5 * c for c in direction(rng))
    m = field_measurement(field_b, field_b, (200e-9) ** 2)
    assert m.dof == 2 and m.residual == (0.0, 0.0, 0.0)
    assert m.variance == pytest.approx((200e-9 / 3e-5) ** 2)
    for k in range(2):

        def component(true_b, k=k):
            return field_measurement(true_b, field_b, 1.0).residual[k]

        np.testing.assert_allclose(m.rows[k].attitude, gradient(component, field_b), atol=1e-9)
        assert m.rows[k].one.errors == m.rows[k].other.errors == 0


def test_a_field_that_errs_lastingly(rng):
    """Three components; derivatives to the attitude, to a bias in b and to an error of the model in n."""
    dcm_bn = rotation_vector_to_dcm(tuple(rng.normal(size=3).tolist()))
    field_n, bias_b = (tuple((k * rng.normal(size=3)).tolist()) for k in (3e-5, 3e-6))

    def predicted(turn=(0.0, 0.0, 0.0), off_n=NONE, off_b=NONE):
        turned = np.array(rotation_vector_to_dcm(vector_of(np.asarray(turn)))) @ np.array(dcm_bn)
        return tuple((turned @ (np.array(field_n) + off_n) + bias_b + off_b).tolist())

    def residual(**off):
        return np.array(biased_field_measurement(predicted(**off), dcm_bn, field_n, bias_b, 1.0).residual)

    m = biased_field_measurement(predicted(), dcm_bn, field_n, bias_b, (200e-9) ** 2)
    assert m.dof == 3 and np.abs(m.residual).max() < 1e-15
    assert m.variance == pytest.approx((200e-9 / np.linalg.norm(predicted())) ** 2)
    for name, size, of in (
        ("turn", 1e-6, lambda row: row.attitude),
        ("off_b", 1e-9, lambda row: row.one.slopes),
        ("off_n", 1e-9, lambda row: row.other.slopes),
    ):
        steps = size * np.eye(3)
        numeric = np.stack([(residual(**{name: d}) - residual(**{name: -d})) / (2.0 * size) for d in steps], axis=1)
        np.testing.assert_allclose(np.array([of(row) for row in m.rows]), numeric, rtol=1e-6, atol=1e-6 / size * 1e-6)
    assert {(row.one.first, row.other.first) for row in m.rows} == {(MAGNETOMETER, FIELD)}


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
    m = sun_vector_measurement(sun, cells, 0b11111, predicted_b, 1.0, dark(5), 0.02**2)
    covariance = rng.normal(size=(6, 6))
    covariance = covariance @ covariance.T
    # the textbook form: residual s - s_predicted, H = [s_predicted x], R = sigma^2 (N^T N)^-1
    x, y, z = predicted_b
    h = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    s = h @ covariance[:3, :3] @ h.T + 0.02**2 * np.linalg.inv(n.T @ n)
    residual = np.array(sun.vector) - predicted_b
    assert normalised_innovation(covariance, m) == pytest.approx(residual @ np.linalg.solve(s, residual), rel=1e-8)


def test_the_earth_moves_a_sun_vector(rng):
    """Derivatives of the vector to the attitude, through the light that is taken off, and to the Earth's brightness."""
    p = parameters(cells__normals=[c for _ in range(5) for c in direction(rng)])
    cells, mask, intensity, brightness = p.cells.layout.cells, 0b10111, 0.97, 1.2
    outputs, light = np.abs(rng.normal(size=5)) + 0.2, 0.1 * np.abs(rng.normal(size=5))
    slopes, predicted_b = 0.1 * rng.normal(size=(5, 3)), direction(rng)

    def measured(turn=NONE, off=0.0):
        """Outputs relative to the Sun once the Earth is brighter, and the body turned."""
        seen = outputs + ((brightness + off) * (light + slopes @ turn) - brightness * light) / intensity
        sun = lit_sun(cells, seen, mask, int(np.argmax(outputs)))
        return sun_vector_measurement(sun, cells, mask, predicted_b, intensity, earth(light, slopes, brightness), 1.0)

    m = measured()
    without = sun_vector_measurement(
        lit_sun(cells, outputs, mask, int(np.argmax(outputs))), cells, mask, predicted_b, intensity, dark(5), 1.0
    )
    for k in range(3):
        by_turn = [(measured(d).residual[k] - measured(-d).residual[k]) / (2.0 * STEP) for d in STEP * np.eye(3)]
        earths = np.subtract(m.rows[k].attitude, without.rows[k].attitude)
        np.testing.assert_allclose(earths, by_turn, atol=1e-7)
        by_brightness = (measured(off=STEP).residual[k] - measured(off=-STEP).residual[k]) / (2.0 * STEP)
        assert m.rows[k].other.slopes[0] == pytest.approx(by_brightness, abs=1e-7)
        assert (m.rows[k].other.first, m.rows[k].other.errors) == (BRIGHTNESS, 1)


@pytest.mark.parametrize(("mask", "rank"), [(0b000101, 2), (0b000001, 1), (0b010101, 3), (0b001100, 1)])
def test_normals_that_do_not_span_space_give_no_sun_vector(mask, rank):
    p = parameters()
    outputs = np.full(6, 0.5)
    sun = lit_sun(p.cells.layout.cells, outputs, mask, int(mask & -mask).bit_length() - 1)
    assert sun.rank == rank
    m = sun_vector_measurement(sun, p.cells.layout.cells, mask, (0.0, 0.6, 0.8), 1.0, dark(6), 1e-4)
    assert m.dof == (3 if rank == 3 else 0)


@pytest.mark.parametrize("used", ["lit_or_expected", "lit"])
def test_voltage_partials(rng, used):
    p = parameters(
        cells_used=used, calibration__mode="estimate", calibration__alignment=True, cells__normals=[*direction(rng)] * 3
    ).cells
    sun_b, intensity, brightness = direction(rng), 0.97, 1.3
    light, slopes = np.array([0.0, 0.1, 0.0]), 0.1 * rng.normal(size=(3, 3))
    if np.dot([p.layout.cells[1][n] for n in ("nx", "ny", "nz")], sun_b) < 0.0:
        sun_b = tuple(-c for c in sun_b)
    calibration = nominal(3)
    calibration[1] = 1.1, 0.02, -0.03

    def measured(true_b=sun_b, table=calibration, turn=NONE, bright=brightness):
        seen = earth(light + slopes @ turn, slopes, bright)
        return -cell_measurement(p, table, 1, 0.0, True, true_b, intensity, seen, NEVER).residual

    m = cell_measurement(p, calibration, 1, 0.7, True, sun_b, intensity, earth(light, slopes, brightness), NEVER)
    assert m.residual == pytest.approx(0.7 - measured())
    by_earth = [(measured(turn=d) - measured(turn=-d)) / (2.0 * STEP) for d in STEP * np.eye(3)]
    np.testing.assert_allclose(m.partials.attitude, gradient(measured, sun_b) + by_earth, atol=1e-8)
    assert m.partials.other.first == BRIGHTNESS and m.partials.other.errors == 1
    by_brightness = (measured(bright=brightness + STEP) - measured(bright=brightness - STEP)) / (2.0 * STEP)
    assert m.partials.other.slopes[0] == pytest.approx(by_brightness, abs=1e-8)
    assert (m.partials.one.first, m.partials.one.errors) == (p.calibration_at + 3, 3)
    for column, tolerance in ((SCALE, 1e-8), (TILT_1, 2e-3), (TILT_2, 2e-3)):
        up, down = calibration.copy(), calibration.copy()
        up[1, column] += STEP
        down[1, column] -= STEP
        numeric = (measured(table=up) - measured(table=down)) / (2.0 * STEP)
        # tilts are taken about the nominal normal, of first order in those already found
        bound = tolerance if column == SCALE else tolerance + 0.04 * 1.1
        assert m.partials.one.slopes[column] == pytest.approx(numeric, abs=bound)


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
    m = cell_measurement(p, nominal(6), 0, 0.5, is_lit, sun_b, 1.0, dark(6), NEVER)
    assert m.used == is_used
    assert 0.5 - m.residual == pytest.approx(predicted)
    assert m.partials.attitude == pytest.approx((0.0, -sun_b[2], 0.0))


def test_an_uncertain_albedo_makes_a_cell_count_less():
    p = parameters(albedo__share_sigma=0.5).cells
    m = cell_measurement(p, nominal(6), 0, 0.5, True, (0.6, 0.0, 0.8), 1.0, earth(np.full(6, 0.2), None, 1.5), NEVER)
    assert m.residual == pytest.approx(0.5 - 0.6 - 1.5 * 0.2)
    assert m.variance == pytest.approx(0.02**2 + (0.5 * 1.5 * 0.2) ** 2)


@pytest.mark.parametrize("is_lit", [True, False])
def test_a_cell_that_looks_away_from_the_sun_measures_the_earth(is_lit):
    p = parameters().cells
    slopes = np.tile([0.1, 0.2, 0.3], (6, 1))
    sun_b = (-0.6, 0.0, 0.8)
    m = cell_measurement(p, nominal(6), 0, 0.5, is_lit, sun_b, 1.0, earth(np.full(6, 0.2), slopes, 1.5), -0.5)
    assert m.used and not m.calibrates
    assert m.residual == pytest.approx(0.5 - 1.5 * 0.2)
    assert m.partials.attitude == pytest.approx((0.15, 0.3, 0.45))
    assert m.partials.other.slopes[0] == pytest.approx(0.2)
    unlit = cell_measurement(p, nominal(6), 0, 0.5, is_lit, sun_b, 1.0, earth(np.zeros(6)), -0.5)
    assert not unlit.used
