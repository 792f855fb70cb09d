# SPDX-License-Identifier: Apache-2.0
"""Gain and tilts of cells as states of the Sun filter: against dense matrices, against the truth, and what it names."""

import math

import numpy as np
import pytest
from okeefe_spacecraft import okeefe_values
from sun_filter_flight import DT, SunFilterFlight, outputs_of

from css_common.attitude import rotation_vector_to_dcm
from css_common.vectors import axes_across, matmul, multiply, multiply_transposed, unit
from css_environment.albedo import albedo_output, new_workspace
from css_estimation.nodes.sun_filter import SunFilter
from css_estimation.sun.sun_heading import UNAIDED
from css_estimation.sun_filter import filter_state, sun_filter
from css_estimation.sun_filter.calibration_report import calibration_line, calibration_report, calibration_states
from css_estimation.sun_filter.cell_update import read_cells
from css_estimation.sun_filter.hypotheses import earth_is_elsewhere
from css_estimation.sun_filter.memory import COMMON, DEAD, GAIN, SCALE, X_GAIN, X_SCALE, dcm_of, set_dcm

CELLS = 8
FIRST = GAIN + 2 * CELLS
STATES = FIRST + 3 * CELLS
KEPT = math.exp(-DT / 70.0)  # of clouds
NO_LIGHT = np.zeros(192)
TUMBLING = (0.012, -0.009, 0.007)
KNOWN = {"gain_sigma": 0.02, "tilt_sigma_deg": 1.0}
ESTIMATED = KNOWN | {"calibration__mode": "estimate"}
CONSIDERED = KNOWN | {"calibration__mode": "consider"}
SUN_N = unit((1.0, 0.0, 0.0))


def parameters(**changes):
    return sun_filter.parameters(okeefe_values(SunFilter.table(), **changes))


class Uncalibrated(SunFilterFlight):
    """Cells whose gains and normals nobody told the filter; Earth, clouds and noise err as it expects."""

    def __init__(self, seed, **changes):
        super().__init__((0.1, 0.3, 0.95), TUMBLING, seed, white=0.006, earth=(1.0, 0.4, 0.3), **(ESTIMATED | changes))
        sigmas = [0.02, math.radians(1.0), math.radians(1.0)]
        self.true_states = np.random.default_rng(100 + seed).normal(size=(CELLS, 3)) * sigmas
        cells = self.p.cells.copy()
        for cell, (gain, a, b) in zip(cells, self.true_states, strict=True):
            normal = (float(cell["nx"]), float(cell["ny"]), float(cell["nz"]))
            e1, e2 = axes_across(normal)
            cell["nx"], cell["ny"], cell["nz"] = unit(tuple(np.array(normal) + a * np.array(e1) + b * np.array(e2)))
            cell["gain"] = 1.0 + gain
        self.true_p = self.p._replace(cells=cells)
        self.clouds = self.dice.normal(size=CELLS)
        self.earth = 1.0 + max(-0.9, 0.5 * self.dice.normal())
        self.brightness = 1.0 + 0.02 * self.dice.normal()

    def manoeuvre(self):
        """Turns about one axis of the body after the other, nearly a full circle about each."""
        for axis in ((1.0, 0.0, 0.2), (0.3, 0.3, 0.9), (0.0, 1.0, 0.0), (0.3, -0.8, 0.6), (-0.5, 0.7, 0.5)):
            momentum_b = multiply(self.p.motion.inertia, tuple(0.04 * np.array(axis)))
            self.momentum_n = multiply_transposed(self.dcm_bn, momentum_b)
            self.fly(130.0, gyro=True)

    def voltages(self, part=1.0):
        p, albedo = self.true_p, np.zeros(CELLS)
        albedo_output(self.light, p.cells, p.screen, p.cos_half_view, self.dcm_bn, new_workspace(), albedo)
        dice = self.dice
        self.clouds = KEPT * self.clouds + math.sqrt(1.0 - KEPT**2) * dice.normal(size=CELLS)
        light = outputs_of(p, self.sun_b) + albedo * np.maximum(self.earth * (1.0 + 0.3 * self.clouds), 0.0)
        outputs = p.cells["gain"] * self.brightness * (1.0 + 0.005 * dice.normal()) * part * light
        return outputs + self.white * dice.normal(size=CELLS)


def light_of(p, x, theta):
    """Outputs of all cells by the model alone, at an attitude that errs by `theta` in n; written anew."""
    # dcm_bn = dcm_bn(estimated) (1 - [theta x])
    dcm_bn = matmul(dcm_of(x), rotation_vector_to_dcm(tuple(theta)))
    sun_b = np.array(multiply(dcm_bn, SUN_N))
    outputs = np.zeros(CELLS)
    for i, cell in enumerate(p.cells):
        normal = (float(cell["nx"]), float(cell["ny"]), float(cell["nz"]))
        e1, e2 = axes_across(normal)
        g, a, b = x[X_GAIN + 2 * CELLS + 3 * i : X_GAIN + 2 * CELLS + 3 * i + 3]
        tilted = np.array(unit(tuple(np.array(normal) + a * np.array(e1) + b * np.array(e2))))
        outputs[i] = (1.0 + g) * (1.0 + x[X_GAIN + i]) * (1.0 + x[X_SCALE]) * (tilted @ sun_b)
    return outputs


def slopes_of(p, x, seen):
    """(n, states) derivatives of the outputs that are seen to the error state, by differences."""
    slopes = np.zeros((len(seen), STATES))
    step = 1e-6
    for k in range(3):
        theta = np.zeros(3)
        theta[k] = step
        slopes[:, k] = ((light_of(p, x, theta) - light_of(p, x, -theta)) / (2.0 * step))[seen]
    estimates = {SCALE: X_SCALE}
    estimates |= {GAIN + i: X_GAIN + i for i in range(CELLS)}
    estimates |= {FIRST + s: X_GAIN + 2 * CELLS + s for s in range(3 * CELLS)}
    for state, at in estimates.items():
        more, less = x.copy(), x.copy()
        more[at] += step
        less[at] -= step
        slopes[:, state] = ((light_of(p, more, np.zeros(3)) - light_of(p, less, np.zeros(3))) / (2.0 * step))[seen]
    slopes[:, COMMON] = light_of(p, x, np.zeros(3))[seen]
    return slopes


@pytest.mark.parametrize("learns", [True, False], ids=["estimated", "considered"])
def test_a_reading_of_all_cells_is_the_kalman_filter_s_or_schmidt_s(learns):
    """Batch update with dense matrices and slopes by differences; considered states have no gain (Schmidt)."""
    p = parameters(**ESTIMATED, albedo__unknown=0.0, nis_gate=1e6)
    memory, dice = sun_filter.initial_memory(p), np.random.default_rng(3)
    x, covariance = memory.estimates[0], memory.covariances[0]
    set_dcm(x, rotation_vector_to_dcm((0.02, -1.35, 0.15)))
    x[X_SCALE] = 0.01
    x[X_GAIN : X_GAIN + CELLS] = 0.003 * dice.normal(size=CELLS)
    at = X_GAIN + 2 * CELLS
    x[at:] = np.where(np.arange(3 * CELLS) % 3 == 0, 0.02, 0.0) * dice.normal(size=3 * CELLS)
    root = 0.01 * dice.normal(size=(STATES, STATES))
    before = root @ root.T / 10.0
    before[COMMON], before[:, COMMON] = 0.0, 0.0
    before[COMMON, COMMON] = p.errors.common
    covariance[:] = before
    seen = np.flatnonzero(outputs_of(p, multiply(dcm_of(x), SUN_N)) > 0.3)
    assert len(seen) >= 3
    slopes = slopes_of(p, x, seen)
    innovation = 0.01 * dice.normal(size=len(seen))
    voltages = np.zeros(CELLS)
    voltages[seen] = light_of(p, x, np.zeros(3))[seen] + innovation
    expected_x = x.copy()
    estimate_args = (p, voltages, SUN_N, 1.0, 0.0, False, learns, NO_LIGHT, STATES, x, covariance, memory)
    reading = read_cells(*estimate_args)

    gain = before @ slopes.T @ np.linalg.inv(slopes @ before @ slopes.T + p.errors.noise * np.eye(len(seen)))
    left = np.eye(STATES) - gain @ slopes
    after = left @ before @ left.T + p.errors.noise * gain @ gain.T
    correction = gain @ innovation
    if not learns:
        # cell after cell, for that is what a filter without gain for all states does not do in one
        after, correction = before, np.zeros(STATES)
        for slope, difference in zip(slopes, innovation, strict=True):
            gain = after @ slope / (slope @ after @ slope + p.errors.noise)
            gain[FIRST:] = 0.0
            correction = correction + gain * (difference - slope @ correction)
            left = np.eye(STATES) - np.outer(gain, slope)
            after = left @ after @ left.T + p.errors.noise * np.outer(gain, gain)
    np.testing.assert_allclose(covariance, after, atol=1e-6 * np.max(before))
    np.testing.assert_allclose(x[at:] - expected_x[at:], correction[FIRST:], atol=1e-7)
    assert reading.nis_dof == len(seen)
    turned = matmul(dcm_of(expected_x), rotation_vector_to_dcm(tuple(correction[:3])))
    np.testing.assert_allclose(dcm_of(x), turned, atol=1e-7)
    if not learns:
        np.testing.assert_array_equal(covariance[FIRST:, FIRST:], before[FIRST:, FIRST:])


def test_gains_and_tilts_are_found_within_their_error_bars():
    squares, largest = [], 0.0
    # the last of them begins with a wrong turn about the Sun line
    for seed in (0, 1, 7):
        flight = Uncalibrated(seed)
        flight.manoeuvre()
        states, covariance = calibration_states(flight.p, flight.memory)
        error = (states - flight.true_states).ravel()
        sigma = np.sqrt(np.diag(covariance))
        largest = max(largest, float(np.max(np.abs(error) / sigma)))
        squares.append(error @ np.linalg.solve(covariance, error) / len(error))
        # not every cell has seen the Sun long enough
        told = np.array([row.observable for row in calibration_report(flight.p, flight.memory)])[: len(error)]
        assert np.count_nonzero(told) >= 18
        assert np.sqrt(np.mean(error[told] ** 2)) < 0.5 * np.sqrt(np.mean(flight.true_states.ravel()[told] ** 2))
    # 72 numbers: mean square 1 with a standard deviation of 0.17, and one in 20 000 beyond 4
    assert 0.4 < np.mean(squares) < 1.6
    assert largest < 4.0


def test_considered_cells_keep_what_was_known_of_them_and_widen_the_error_bar():
    exact = {"calibration__mode": "off", "gain_sigma": 0.0, "tilt_sigma_deg": 0.0}
    flights = [Uncalibrated(5, **changes) for changes in (CONSIDERED, exact)]
    traces = [np.trace(np.reshape(flight.fly(60.0, gyro=True).covariance, (3, 3))) for flight in flights]
    assert traces[0] > 4.0 * traces[1]
    states, covariance = calibration_states(flights[0].p, flights[0].memory)
    np.testing.assert_array_equal(states, 0.0)
    np.testing.assert_array_equal(covariance, np.diag(np.tile([0.02**2, *[math.radians(1.0) ** 2] * 2], CELLS)))
    assert flights[1].memory.estimates.shape[1] == X_GAIN + 2 * CELLS, "without states of calibration no room for them"


def test_a_gap_keeps_the_calibration_and_a_wrong_estimate_loses_it():
    flight = Uncalibrated(1)
    flight.fly(150.0, gyro=True)
    known, covariance = calibration_states(flight.p, flight.memory)
    assert np.any(known != 0.0)
    flight.algorithm.step(flight.p, flight.state, flight.memory, 60.0, flight.voltages(), flight_aiding(flight))
    kept, kept_covariance = calibration_states(flight.p, flight.memory)
    np.testing.assert_array_equal(kept, known)
    np.testing.assert_array_equal(kept_covariance, covariance)
    # now the Sun is somewhere else, and no turn has brought it there
    flight = Uncalibrated(1)
    flight.fly(150.0, gyro=True)
    flight.dcm_bn = matmul(rotation_vector_to_dcm((2.5, 0.0, 0.0)), flight.dcm_bn)
    for _ in range(round(60.0 / DT)):
        if flight.step(gyro=True).mode == filter_state.MODE_SEARCHING:
            break
    states, covariance = calibration_states(flight.p, flight.memory)
    np.testing.assert_array_equal(states, 0.0)
    assert covariance[0, 0] == pytest.approx(0.02**2)


def test_clouds_that_are_none_make_the_turn_be_looked_for_again_and_the_calibration_doubted():
    flight = Uncalibrated(2)
    flight.fly(150.0, gyro=True)
    memory = flight.memory
    best = int(np.argmax(memory.weights))
    clouds = memory.estimates[best, X_GAIN + CELLS : X_GAIN + 2 * CELLS]
    assert not earth_is_elsewhere(flight.p, memory.estimates[best])
    memory.weights[:] = np.where(np.arange(len(memory.weights)) == best, 0.0, DEAD)
    clouds[:] = np.where(np.arange(CELLS) == 3, 4.1, 0.0)
    assert earth_is_elsewhere(flight.p, memory.estimates[best]), "one cell is enough"
    clouds[:] = [2.5, -2.5] * (CELLS // 2)
    assert not earth_is_elsewhere(flight.p, memory.estimates[best])
    clouds[:] = [3.0, -3.0] * (CELLS // 2)
    assert earth_is_elsewhere(flight.p, memory.estimates[best]), "and all together with less of each"
    clouds[:] = [5.0, -5.0] * (CELLS // 2)
    learnt, _ = calibration_states(flight.p, memory)
    heading = flight.step(gyro=True)
    assert heading.mode == filter_state.MODE_EARTH
    assert np.all(memory.weights > DEAD), "all turns are possible again"
    states, covariance = calibration_states(flight.p, memory)
    np.testing.assert_allclose(states, learnt, atol=0.005)
    np.testing.assert_array_equal(covariance, np.diag(np.tile([0.02**2, *[math.radians(1.0) ** 2] * 2], CELLS)))


def flight_aiding(flight):
    return UNAIDED._replace(gyro_b=flight.omega, gyro_valid=True, sky=flight.sky)


def test_what_no_flight_tells_is_named():
    """A body at rest cannot tell cells that are all turned from another attitude; cells in the dark tell nothing."""
    at_rest, turning = Uncalibrated(2), Uncalibrated(2)
    at_rest.momentum_n = (0.0, 0.0, 0.0)
    reports = []
    at_rest.fly(300.0, gyro=True)
    turning.manoeuvre()
    for flight in (at_rest, turning):
        reports.append({row.name: row for row in calibration_report(flight.p, flight.memory)})
    still, moved = reports
    assert all(row.sigma <= 1.0001 * row.prior for report in reports for row in report.values())
    turns = [f"turn of all cells about {axis}" for axis in "xyz"]
    assert not any(still[name].observable for name in turns)
    assert all(moved[name].observable for name in turns)
    for dark in (4, 5, 6, 7):
        assert not still[f"cell {dark}: gain"].observable
        assert still[f"cell {dark}: tilt 1"].sigma == pytest.approx(still[f"cell {dark}: tilt 1"].prior)
    assert sum(row.observable for row in moved.values()) > 20
    assert not moved["gain of all cells"].observable
    line = calibration_line(list(still.values()))
    assert "turn of all cells about x" in line and "not: " in line
    assert calibration_report(parameters(), sun_filter.initial_memory(parameters())) == []


def test_cells_are_not_calibrated_by_an_earth_that_is_not_predicted():
    orbit = {"orbit__source": "elements"}
    estimated, considered = ESTIMATED | orbit, CONSIDERED | orbit | {"use_orbit": False}
    for changes, refused in ((estimated, False), (estimated | {"use_orbit": False}, True), (considered, False)):
        messages = list(sun_filter.conflicts(okeefe_values(SunFilter.table(), **changes)))
        assert [message.startswith("calibration.mode: estimate given") for message in messages] == [True] * refused


def test_a_turn_of_all_cells_is_told_with_its_sign():
    p = parameters(**ESTIMATED)
    memory = sun_filter.initial_memory(p)
    memory.weights[0] = 0.0
    turn = np.radians([0.3, -0.2, 0.5])
    for i, cell in enumerate(p.cells):
        normal = (float(cell["nx"]), float(cell["ny"]), float(cell["nz"]))
        moved = np.cross(turn, normal)
        at = X_GAIN + 2 * CELLS + 3 * i
        memory.estimates[0, at + 1 : at + 3] = [moved @ np.array(axis) for axis in axes_across(normal)]
    report = {row.name: row for row in calibration_report(p, memory)}
    told = [report[f"turn of all cells about {axis}"].value for axis in "xyz"]
    np.testing.assert_allclose(told, [0.3, -0.2, 0.5], atol=1e-12)
    assert report["gain of all cells"].prior == pytest.approx(2.0 / math.sqrt(8.0))
