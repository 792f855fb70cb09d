# SPDX-License-Identifier: Apache-2.0
"""Figures of merit of attitude filters from steps whose every error is known."""

from typing import NamedTuple

import numpy as np
import pytest

from css_common.attitude import mrp_add, rotation_vector_to_mrp
from css_common.kernel import typed_call
from css_estimation.attitude.attitude_solution import VALIDITY_NONE, VALIDITY_VALID, AttitudeSolution
from css_monte_carlo.attitude_tallies import SAMPLED, new_tallies, tally_step
from css_monte_carlo.case_tallies import SUNLIT
from css_monte_carlo.failing_units import NOTHING_FAILS
from css_monte_carlo.health_tallies import NO_ACTUATORS_LEFT
from css_monte_carlo.step_truth import Truth

_tally = typed_call(tally_step)
SIGMA = (0.2, -0.1, 0.3)
BIAS = (0.001, -0.002, 0.0005)
ZERO = (0.0, 0.0, 0.0)
TRUTH = Truth(SIGMA, ZERO, (0.0, 0.0, 1.0), (0.0, 0.0, 1.0), ZERO, BIAS, 0.0, NOTHING_FAILS)
STEPS, SETTLED = 40, 25


class Memory(NamedTuple):
    """Of a filter's memory what is read."""

    covariance: np.ndarray


@pytest.fixture
def steps():
    """Errors of attitude [rad] and bias [rad/s], (steps, 6), and a covariance."""
    rng = np.random.default_rng(8)
    a = 0.02 * rng.normal(size=(6, 6))
    return 0.02 * rng.normal(size=(STEPS, 6)), a @ a.T + 1e-5 * np.eye(6)


def tallied(errors, covariance, waiting=3):
    """Tallies of a flight whose filter knows nothing in the first steps; cells that count grow by one a step."""
    tallies = new_tallies(1, STEPS, 2.0, 10, 2.0 * SETTLED)
    for step, error in enumerate(errors.tolist()):
        estimated = mrp_add(SIGMA, rotation_vector_to_mrp(tuple(-e for e in error[:3])))
        bias_b = tuple(b - e for b, e in zip(BIAS, error[3:], strict=True))
        validity = VALIDITY_NONE if step < waiting else VALIDITY_VALID
        lit_mask = (1 << step % 32) - 1
        solution = AttitudeSolution(estimated, ZERO, bias_b, 0.0, 0.5 * step, 3, lit_mask, validity, 0, 1)
        _tally(
            tallies, 0, step, SUNLIT if step % 2 else 0, TRUTH, None, solution, Memory(covariance), NO_ACTUATORS_LEFT
        )
    return tallies


def test_sums_are_over_the_settled_steps(steps):
    errors, covariance = steps
    tallies = tallied(errors, covariance)
    totals, settled = tallies.totals[0], errors[SETTLED:]
    angle, bias = (np.degrees(np.linalg.norm(part, axis=1)) for part in (settled[:, :3], settled[:, 3:]))
    assert (totals["first_step"], totals["settled"], totals["innovations"]) == (3, STEPS - SETTLED, 3 * len(settled))
    assert totals["error_sum"] == pytest.approx(angle.sum(), rel=1e-9)
    assert totals["error_max"] == pytest.approx(angle.max(), rel=1e-9)
    assert totals["bias_sum"] == pytest.approx(bias.sum(), rel=1e-9)
    assert totals["nis_sum"] == pytest.approx(0.5 * sum(range(SETTLED, STEPS)))

    def squared(e, p):
        return np.einsum("ki,ij,kj->", e, np.linalg.inv(p), e)

    assert totals["nees6_sum"] == pytest.approx(squared(settled, covariance), rel=1e-8)
    assert totals["nees3_sum"] == pytest.approx(squared(settled[:, :3], covariance[:3, :3]), rel=1e-8)
    assert totals["without_estimate"] == 1  # of the first three steps one is sunlit
    assert tallies.histogram[0].sum() == len(settled)


def test_samples_are_of_every_tenth_step_with_an_estimate(steps):
    errors, covariance = steps
    samples = dict(zip(SAMPLED, tallied(errors, covariance).samples[0], strict=True))
    assert all(len(column) == 4 and np.isnan(column[0]) for column in samples.values())
    sampled = errors[10::10]
    np.testing.assert_allclose(
        samples["attitude_error_deg"][1:], np.degrees(np.linalg.norm(sampled[:, :3], axis=1)), rtol=1e-6
    )
    bias = np.degrees(np.linalg.norm(sampled[:, 3:], axis=1))
    np.testing.assert_allclose(samples["gyro_bias_error_deg_s"][1:], bias, rtol=1e-6)
    np.testing.assert_allclose(
        samples["attitude_sigma_deg"][1:], np.degrees(np.sqrt(np.trace(covariance[:3, :3]))), rtol=1e-6
    )
    assert samples["cells_lit"][1:].tolist() == [10, 20, 30]


def test_a_covariance_that_is_none_is_no_consistency(steps):
    errors, covariance = steps
    covariance[5] = covariance[:, 5] = 0.0
    assert tallied(errors, covariance).totals[0]["nees6_sum"] == np.inf
