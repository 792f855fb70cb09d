# SPDX-License-Identifier: Apache-2.0
"""Is the filter as good as it says? Errors and innovations against the covariance, and tracking of a turning Sun.

The setting is the filter's own model: cells that answer linearly with white noise of the sigma it assumes, chosen by
the prediction alone (a gate on the outputs would prefer those with positive noise), and a body rate known up to
white noise that makes its process noise. Then NEES on the two tangent axes is chi-square with 2 degrees of freedom,
NIS with one a cell (Bar-Shalom, Li & Kirubarajan 2001, section 5.4).
"""

import math

import numpy as np
import pytest
from okeefe_spacecraft import okeefe_values
from scipy.stats import chi2

from css_common.attitude import rotation_vector_to_dcm
from css_common.vectors import angle_between, multiply, scale, vector_of
from css_estimation.sun import sunline_ekf
from css_estimation.sun.sun_heading import UNAIDED, VALIDITY_VALID
from css_estimation.symmetric import isotropic
from css_sensors.cells import CELLS

RUNS = 60
STEPS = 300
DT = 0.1
CELL_SIGMA = 0.03
PROCESS_SIGMA = 0.01
NORMALS = np.asarray(okeefe_values(CELLS).cells.normals)


def ekf(**changes):
    p = sunline_ekf.parameters(okeefe_values(CELLS + sunline_ekf.PARAMETERS, **changes))
    return p, sunline_ekf.initial_state(p)


def begun(state, sun_b, variance, **changes):
    """The state of a filter that has started, at `sun_b` and with so much variance on each axis."""
    line = state.sunline
    tracking = line.tracking._replace(sun_b=sun_b, **changes)
    return state._replace(sunline=line._replace(started=True, covariance=isotropic(variance), tracking=tracking))


def with_gyro(omega):
    return UNAIDED._replace(gyro_b=omega, gyro_valid=True)


def rate_at(t):
    """A slow tumble [rad/s] of a few deg/s."""
    return (0.03 * math.sin(0.11 * t), 0.02 * math.cos(0.07 * t), 0.015)


def turned(sun_b, omega, dt=DT):
    return multiply(rotation_vector_to_dcm(scale(dt, omega)), sun_b)


def fly_ideal(seed):
    """Errors on the tangent axes normalised (NEES), NIS and its degrees of freedom of each step."""
    rng = np.random.default_rng(seed)
    p, state = ekf(cell_sigma=CELL_SIGMA, process_sigma=PROCESS_SIGMA, gate=1.0)
    drawn = rng.normal(size=3)
    sun_b = vector_of(drawn / np.linalg.norm(drawn))
    start_b = turned(sun_b, tuple(0.05 * rng.normal(size=3)), 1.0)
    state = begun(state, start_b, 0.05**2)
    nees, nis, dof = np.empty(STEPS), np.empty(STEPS), np.empty(STEPS)
    for k in range(STEPS):
        omega = rate_at(k * DT)
        sun_b = turned(sun_b, omega)
        # q dt of the filter is the variance of the angle that the rate noise adds in a step
        measured = tuple(np.add(omega, PROCESS_SIGMA / math.sqrt(DT) * rng.normal(size=3)).tolist())
        outputs = NORMALS @ sun_b + CELL_SIGMA * rng.normal(size=8)
        state, heading = sunline_ekf.step(p, state, None, DT, outputs, with_gyro(measured))
        helper = np.eye(3)[np.argmin(np.abs(heading.sun_b))]
        e1 = np.cross(heading.sun_b, helper)
        e1 /= np.linalg.norm(e1)
        tangent = np.stack((e1, np.cross(heading.sun_b, e1)))
        error = tangent @ np.subtract(sun_b, heading.sun_b)
        covariance = tangent @ np.array(heading.covariance).reshape(3, 3) @ tangent.T
        nees[k] = error @ np.linalg.solve(covariance, error)
        nis[k], dof[k] = heading.nis, heading.nis_dof
    return nees, nis, dof


@pytest.fixture(scope="module")
def ideal_runs():
    nees, nis, dof = zip(*(fly_ideal(seed) for seed in range(RUNS)), strict=True)
    return np.array(nees), np.array(nis), np.array(dof)


def test_nees_averaged_over_runs_stays_in_its_bounds(ideal_runs):
    nees, _, _ = ideal_runs
    low, high = chi2.ppf((0.025, 0.975), 2 * RUNS) / RUNS
    average = nees.mean(axis=0)
    assert np.mean((low < average) & (average < high)) > 0.9
    assert average.mean() == pytest.approx(2.0, abs=0.1)


def test_nis_is_chi_square_with_a_degree_of_freedom_a_cell(ideal_runs):
    _, nis, dof = ideal_runs
    total = int(dof.sum())
    low, high = chi2.ppf((0.0005, 0.9995), total)
    assert low < nis.sum() < high
    per_step = dof.sum(axis=0)
    inside = (chi2.ppf(0.025, per_step) < nis.sum(axis=0)) & (nis.sum(axis=0) < chi2.ppf(0.975, per_step))
    assert np.mean(inside) > 0.9


def test_innovations_of_successive_steps_are_uncorrelated(ideal_runs):
    _, nis, dof = ideal_runs
    excess = ((nis - dof) / np.sqrt(2.0 * np.maximum(dof, 1.0))).ravel()
    for lag in (1, 2, 5):
        correlation = np.corrcoef(excess[lag:], excess[:-lag])[0, 1]
        assert abs(correlation) < 3.3 / math.sqrt(excess.size)


def test_distribution_of_nees_is_chi_square(ideal_runs):
    """Not the mean alone: shares of the samples beyond the quantiles, on samples far enough apart."""
    nees = ideal_runs[0][:, ::50].ravel()
    for level in (0.5, 0.9, 0.99):
        beyond = np.mean(nees > chi2.ppf(level, 2))
        spread = math.sqrt(level * (1.0 - level) / nees.size)
        assert abs(beyond - (1.0 - level)) < 4.0 * spread, level


def cell_outputs(sun_b):
    """Cosine cells with their view cone and the body plane that hides the other side."""
    cosines = NORMALS @ sun_b
    return np.where((cosines >= 0.5) & (NORMALS[:, 2] * sun_b[2] > 0.0), cosines, 0.0)


def test_tracks_a_turning_sun_that_one_or_two_cells_see():
    """Motion makes visible what one or two cells cannot show (the point of the paper's filter).

    The Sun wanders near the equator of the dual pyramid, where the weighted average errs by 30 to 60 deg.
    """
    omega = tuple(math.radians(c) for c in (0.15, -0.1, 0.5))
    sun_b = (math.cos(0.35), 0.0, math.sin(0.35))
    p, state = ekf()
    errors, lit = [], []
    for _ in range(1200):
        sun_b = turned(sun_b, omega)
        outputs = cell_outputs(sun_b)
        state, heading = sunline_ekf.step(p, state, None, DT, outputs, with_gyro(omega))
        errors.append(angle_between(heading.sun_b, sun_b))
        lit.append(np.count_nonzero(outputs))
    assert max(lit) <= 2
    assert errors[0] > math.radians(15.0)
    assert max(errors[50:]) < math.radians(3.0)


def test_without_gyro_it_converges_once_more_cells_see_the_sun():
    """At 0.54 deg/s from the equator to the pole: an error of tens of degrees ends where a third cell lights up."""
    omega = (0.0, math.radians(-0.54), 0.0)
    sun_b = (math.cos(0.35), 0.0, math.sin(0.35))
    p, state = ekf()
    for _ in range(1200):
        sun_b = turned(sun_b, omega)
        outputs = cell_outputs(sun_b)
        state, heading = sunline_ekf.step(p, state, None, DT, outputs, UNAIDED)
        few = np.count_nonzero(outputs) <= 2
        error = angle_between(heading.sun_b, sun_b)
        if not few and error < math.radians(2.0):
            break
    assert error < math.radians(2.0)
    assert heading.omega_bn_b[1] == pytest.approx(omega[1], rel=0.2)


@pytest.mark.parametrize("seed", range(20))
def test_finds_the_sun_from_a_wrong_start(seed):
    """A state on the other side of the sky is left within seconds of motion."""
    rng = np.random.default_rng(seed)
    drawn = rng.normal(size=3)
    sun_b = vector_of(drawn / np.linalg.norm(drawn))
    axis = np.cross(sun_b, rng.normal(size=3))  # a turn about the Sun line itself would show nothing new
    omega = tuple((math.radians(2.0) * axis / np.linalg.norm(axis)).tolist())
    p, state = ekf()
    wrong_b = tuple(-c for c in sun_b)
    state = begun(state, wrong_b, 0.01, validity=VALIDITY_VALID)
    for _ in range(900):
        sun_b = turned(sun_b, omega)
        state, heading = sunline_ekf.step(p, state, None, DT, cell_outputs(sun_b), with_gyro(omega))
    assert angle_between(heading.sun_b, sun_b) < math.radians(8.0)
