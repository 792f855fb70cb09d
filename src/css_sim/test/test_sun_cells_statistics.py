# SPDX-License-Identifier: Apache-2.0
"""Distributions of the cells' random errors (Kolmogorov-Smirnov and chi-square at 1e-4, fixed seeds), determinism."""

import math

import numpy as np
import pytest
from okeefe_spacecraft import okeefe_values
from scipy import stats

from css_common.random_streams import random_key
from css_sensors.cells import CELLS
from css_sim import cell_errors, cell_screen, sun_cells
from css_sim.fault_effects import NO_FAULTS

SIGNIFICANCE = 1e-4
STEPS = 20_000
KEY = random_key(20130601, 7)
LIGHT = np.full(8, 0.6)


def build(**changes):
    """Parameters, error statistics and nominal cells."""
    changes = {"warp": False, "degradation": 0.0, "output_low": -10.0, "output_high": 10.0} | changes
    values = okeefe_values(CELLS + sun_cells.PARAMETERS + cell_screen.PARAMETERS + cell_errors.PARAMETERS, **changes)
    nominal = cell_errors.nominal_cells(values.cells.normals, cell_screen.cell_sides(values))
    return sun_cells.parameters(values), cell_errors.error_model(values), nominal


def record(p, cells, steps, key=KEY):
    """Outputs (len(steps), 8) in the dark with equal albedo on all cells."""
    out = np.zeros((len(steps), 8))
    for k, step in enumerate(steps):
        sun_cells.sample(p, cells, NO_FAULTS, key, step, (0.0, 0.0, 1.0), 0.0, LIGHT, out[k])
    return out


def draws(model, nominal, cases):
    """Tables of cells (cases, 8) of many cases."""
    drawn = np.zeros((cases, 8), cell_errors.CELL)
    for case in range(cases):
        cell_errors.draw_cells(model, random_key(5, case), nominal, drawn[case])
    return drawn


def uniform(sample, low, high):
    return stats.kstest(sample, "uniform", (low, high - low)).pvalue > SIGNIFICANCE


def normal(sample, sigma):
    return stats.kstest(sample, "norm", (0, sigma)).pvalue > SIGNIFICANCE


def uncorrelated(a, b):
    return stats.pearsonr(a, b).pvalue > SIGNIFICANCE


def test_common_degradation_is_one_uniform_draw_a_step():
    p, _, cells = build(degradation=0.05)
    loss = 1 - record(p, cells, range(STEPS)) / LIGHT
    assert uniform(loss[:, 0], 0, 0.05)
    assert np.ptp(loss, axis=1).max() < 1e-15
    assert uncorrelated(loss[1:, 0], loss[:-1, 0])


def test_degradation_per_cell_is_uniform_and_independent():
    p, _, cells = build(degradation=0.05, degradation_mode="per_cell")
    loss = 1 - record(p, cells, range(STEPS)) / LIGHT
    assert all(uniform(loss[:, i], 0, 0.05) for i in range(8))
    correlation = np.corrcoef(loss.T)[np.triu_indices(8, 1)]
    # 28 pairs, each normal with 1/sqrt(n)
    assert np.abs(correlation).max() < stats.norm.isf(SIGNIFICANCE / 28 / 2) / math.sqrt(STEPS)


def test_noise_is_white_normal_and_independent_between_cells():
    p, _, cells = build(noise=0.02)
    noise = record(p, cells, range(STEPS)) - LIGHT
    assert all(normal(noise[:, i], 0.02) for i in range(8))
    assert all(uncorrelated(noise[1:, i], noise[:-1, i]) for i in range(8))
    correlation = np.corrcoef(noise.T)[np.triu_indices(8, 1)]
    assert np.abs(correlation).max() < stats.norm.isf(SIGNIFICANCE / 28 / 2) / math.sqrt(STEPS)


@pytest.mark.parametrize("changes", [{"noise": 0.02}, {"degradation": 0.05}])
def test_draws_do_not_depend_on_the_order_of_steps(changes):
    p, _, cells = build(**changes)
    steps = np.random.default_rng(1).permutation(200)
    assert np.array_equal(record(p, cells, steps), record(p, cells, range(200))[steps])


def test_cases_and_seeds_differ():
    p, _, cells = build(noise=0.02)
    outputs = [record(p, cells, range(5), random_key(*k)) for k in [(1, 0), (1, 1), (2, 0), (1 << 32, 0)]]
    for i in range(4):
        for j in range(i):
            assert np.all(outputs[i] != outputs[j])


def test_scale_errors_common_and_per_cell():
    _, model, nominal = build(scale_common_error=0.1)
    gain = draws(model, nominal, 5000)["gain"]
    assert np.ptp(gain, axis=1).max() == 0
    assert normal(gain[:, 0] - 1, 0.1)
    _, model, nominal = build(scale_cell_error=0.05)
    gain = draws(model, nominal, 5000)["gain"]
    assert all(normal(gain[:, i] - 1, 0.05) for i in range(8))
    assert uncorrelated(gain[:, 0], gain[:, 1])


def test_a_wrong_calibration_scales_all_cells_of_every_case():
    _, model, nominal = build(scale_common_error=0.1)
    _, wrong, _ = build(scale_common_error=0.1, scale=0.8)
    np.testing.assert_allclose(draws(wrong, nominal, 50)["gain"], 0.8 * draws(model, nominal, 50)["gain"])


def test_lasting_degradation_and_bias():
    _, model, nominal = build(fixed_degradation=0.2, bias=0.03)
    drawn = draws(model, nominal, 5000)
    assert all(uniform(drawn["gain"][:, i], 0.8, 1.0) for i in range(8))
    assert all(normal(drawn["bias"][:, i], 0.03) for i in range(8))
    assert uncorrelated(drawn["gain"][:, 2], drawn["bias"][:, 2])


def test_misaligned_normals_are_unit_and_tilt_alike_in_all_directions():
    sigma = math.radians(2.0)
    _, model, nominal = build(misalignment_deg=2.0)
    drawn = draws(model, nominal, 5000)
    for i in range(8):
        true = np.stack([drawn[f][:, i] for f in ("nx", "ny", "nz")], axis=1)
        design = np.array([nominal[f][i] for f in ("nx", "ny", "nz")])
        np.testing.assert_allclose(np.linalg.norm(true, axis=1), 1.0, atol=1e-14)
        tilt = np.arctan2(np.linalg.norm(np.cross(design, true), axis=1), true @ design)
        assert stats.kstest(tilt, "rayleigh", (0, sigma)).pvalue > SIGNIFICANCE
        across = np.cross(design, [0.3, 0.5, 0.81])
        across /= np.linalg.norm(across)
        azimuth = np.arctan2(true @ np.cross(design, across), true @ across)
        assert uniform(azimuth, -math.pi, math.pi)
    # the structure that clips the view does not move with the cell
    assert np.array_equal(drawn["side"], np.broadcast_to(nominal["side"], drawn["side"].shape))


def test_errors_act_as_gain_then_offset():
    p, _, cells = build()
    cells["gain"], cells["bias"] = 0.9, 0.02
    assert record(p, cells, [0])[0] == pytest.approx(0.9 * LIGHT + 0.02)
