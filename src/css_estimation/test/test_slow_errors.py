# SPDX-License-Identifier: Apache-2.0
"""Lasting errors of the attitude filter: how they are carried on, and that they are found."""

import numpy as np
import pytest
from attitude_scene import Run, Scene, options
from scipy.linalg import expm

from css_estimation.attitude.slow_errors import (
    BRIGHTNESS,
    END,
    FIELD,
    FIELD_RATE,
    MAGNETOMETER,
    correct,
    field_error,
    forget,
    magnetometer_bias,
    new_slow,
    relax,
)
from css_estimation.sun.error_covariance import FURTHER


def slow_parameters(**changes):
    return options(**changes).slow


def variances(p):
    field = [p.field_variance] * 3 + [p.field_variance * p.field_rate**2] * 3
    return np.array([p.bias_variance] * 3 + field + [p.brightness_variance])


def test_they_are_carried_on_by_their_processes():
    p = slow_parameters(reference__field_degree=6)
    rng = np.random.default_rng(1)
    slow, covariance = new_slow() + rng.normal(size=10), np.zeros((END, END))
    forget(p, covariance, slow.copy())
    np.testing.assert_allclose(np.diag(covariance)[FURTHER:], variances(p))
    before, dt = slow.copy(), 40.0
    b = p.field_rate
    forward = expm(dt * np.array([[0.0, 1.0], [-b * b, -2.0 * b]]))
    relax(p, covariance, slow, dt)
    np.testing.assert_array_equal(slow[:3], before[:3])
    np.testing.assert_allclose(slow[3:6], forward[0, 0] * before[3:6] + forward[0, 1] * before[6:9], rtol=1e-12)
    np.testing.assert_allclose(slow[6:9], forward[1, 0] * before[3:6] + forward[1, 1] * before[6:9], rtol=1e-12)
    assert slow[9] - 1.0 == pytest.approx(np.exp(-dt * p.brightness_rate) * (before[9] - 1.0))
    # unmeasured, only the walk of the bias adds to what is not known
    grown = variances(p) + np.array([p.bias_noise * dt] * 3 + [0.0] * 7)
    np.testing.assert_allclose(np.diag(covariance)[FURTHER:], grown, rtol=1e-9)


def test_the_field_error_lasts_as_long_as_the_first_polynomial_that_is_left_out():
    """Curvature of P_7 (cos theta) at the speed over ground against that of the process's correlation."""
    p = slow_parameters(reference__field_degree=6)
    theta = 7.2e3 / 6.371e6 * 20.0
    legendre = np.polynomial.legendre.legval(np.cos(theta), [0.0] * 7 + [1.0])
    decay = 20.0 * p.field_rate
    assert (1.0 + decay) * np.exp(-decay) == pytest.approx(legendre, abs=2e-3)


def test_a_short_model_of_the_field_errs_by_what_it_leaves_out():
    short, whole = slow_parameters(reference__field_degree=6), slow_parameters()
    assert np.sqrt(whole.field_variance) == pytest.approx(20e-9)
    assert 100e-9 < np.sqrt(short.field_variance) < 200e-9


def test_corrections_go_to_what_they_are_of():
    p, slow, correction = slow_parameters(), new_slow(), np.arange(END, dtype=float)
    correct(p, slow, correction)
    assert magnetometer_bias(slow) == tuple(correction[MAGNETOMETER:FIELD])
    assert field_error(slow) == tuple(correction[FIELD:FIELD_RATE])
    assert slow[-1] == 10.0  # an Earth brighter than that there is not
    correct(p, slow, np.full(END, -100.0))
    assert slow[BRIGHTNESS - FURTHER] == 0.0


def test_the_white_error_model_has_none():
    p = options(error_model="white")
    run = Run(p)
    assert run.memory.covariance.shape == (6, 6)
    slow = new_slow()
    correct(p.slow, slow, np.ones(6))
    np.testing.assert_array_equal(slow, new_slow())


class Biased(Scene):
    """A magnetometer that is off by 150 nT along one axis."""

    bias_b = np.array([0.0, 150e-9, 0.0])

    def field(self):
        return tuple(np.add(super().field(), self.bias_b).tolist())


@pytest.mark.parametrize("model", ["vector", "voltage"])
def test_a_bias_of_the_magnetometer_is_found(model):
    nees, errors = {}, {}
    for errors_are in ("lasting", "white"):
        values = []
        for seed in range(4):
            scene, run = Biased(seed), Run(options(sun_model=model, error_model=errors_are))
            for k in range(600):
                run.step(scene, 1.0 if k else 0.0)
                if k >= 300:
                    values.append((run.error_deg(scene), run.nees(scene)))
                scene.advance()
            if errors_are == "lasting":
                sigma = np.sqrt(np.diag(run.memory.covariance)[MAGNETOMETER:FIELD])
                assert (sigma < 40e-9).all()
                assert (np.abs(run.memory.slow[:3] - scene.bias_b) < 4.0 * sigma).all()
        errors[errors_are], nees[errors_are] = np.mean(values, axis=0)
    assert errors["lasting"] < 0.85 * errors["white"]
    # four flights alone scatter by a fifth
    assert nees["lasting"] < 4.5 < 1.5 * 4.5 < nees["white"]
