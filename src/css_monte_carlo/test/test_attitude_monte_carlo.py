# SPDX-License-Identifier: Apache-2.0
"""Attitude filters in the compiled loop: the same numbers as on the nodes, and the paper's comparison of models."""

from functools import cache

import numpy as np
import pytest
from presence import present

from css_analysis.estimate_errors import attitude_errors
from css_analysis.estimator_runs import estimator_runs
from css_analysis.flight_metrics import windows_of
from css_common.attitude import mrp_to_quaternion
from css_common.mission import load_mission, mission_from_text
from css_monte_carlo.case_table import case_table
from css_monte_carlo.case_tallies import BIN_DEG
from css_monte_carlo.chunk import fly_cases
from css_monte_carlo.direct_flight import fly_directly
from css_monte_carlo.mission_flight import MissionFlight

FOUR = "cells.normals=1,0,0,-1,0,0,0,1,0,0,-1,0"
FIVE = f"{FOUR},0,0,1"
VECTOR, VOLTAGE = "attitude_vector", "attitude_voltage"
FILTERS = (VECTOR, VOLTAGE)


def mission(*overrides):
    return load_mission("cubesat_vmm", overrides)


EVENTS = """
    events:
      off: {time: 60.0, node: gyro, action: deactivate}
      blind: {time: 70.0, node: magnetometer, action: deactivate}
      tuned: {time: 90.0, node: attitude_voltage, action: set, parameter: cell_sigma, value: 0.05}
      on: {time: 120.0, node: gyro, action: activate}
      failed: {time: 150.0, node: css_array, action: set, parameter: faults, value: ['2 dead']}
      seen: {time: 200.0, node: magnetometer, action: activate}
"""
LIT = ("css_array.albedo.enabled=true",)
# DiGregorio & Crassidis know white noise alone
WHITE = tuple(f"{name}.{key}" for name in FILTERS for key in ("error_model=white", "albedo.compensate=false"))
BESIDE = """/**:
  ros__parameters:
    extends: okeefe_2013
    mission: {name: beside, duration: 400.0, period: 1.0}
    measures: {settled_time: 300.0}
    graph:
      nodes: [css_sim/dynamics, css_sim/css_array, css_sim/gyro, css_sim/magnetometer, css_estimation/ekf,
              "css_estimation/attitude_filter:attitude_voltage", sunpoint_control/mrp_control]
    rods: {fitted: true}
    magnetometer: {divider: 3}
mrp_control:
  ros__parameters:
    gains: {p: 0.5}
    dumping: {enabled: true}
"""
VARIANTS = {
    "as the mission is": lambda: mission("mission.case=3"),
    "a slower magnetometer, the Earth's light and calibration": lambda: mission(
        "mission.case=7",
        "magnetometer.divider=3",
        *LIT,
        "css_array.misalignment_deg=1",
        "attitude_voltage.calibration.mode=estimate",
        "attitude_vector.reference.field_degree=6",
    ),
    "readings that a calibration corrects": lambda: mission(
        "mission.case=4",
        "css_array.scale_cell_error=0.1",
        "cells.measured.scales=1.03,0.97,1.1,0.9,1.013,0.987",
        "cells.measured.darks=0.01,-0.01,0.003,0.007,-0.002,0.0",
        "gyro.measured.bias_deg_h=1.3,-4.5,0.7",
        "magnetometer.measured.bias_nt=120.0,-35.0,77.0",
        "magnetometer.measured.matrix=1.02,0.003,-0.004,0.003,0.97,0.011,-0.004,0.011,1.013",
    ),
    "each case has its own Earth": lambda: mission("mission.case=2", *LIT, "css_array.albedo.draw=per_cell"),
    "scripted changes": lambda: mission_from_text(
        mission().text().replace("ros__parameters:", "ros__parameters:" + EVENTS, 1), "scripted"
    ),
    "rods and wheels that nobody commands": lambda: mission(
        "rods.fitted=true",
        "wheels.fitted=true",
        "wheels.axes=1,0,0,0,1,0,0,0,1",
        "wheels.inertia=1e-5",
        "wheels.max_torque=1e-4",
        "wheels.max_speed_rpm=6000",
        "dynamics.initial.wheel_speed_rpm=50",
    ),
    "no gyro": lambda: mission_from_text(BESIDE.replace("css_sim/gyro, ", ""), "no gyro"),
    "beside a Sun estimator that controls": lambda: mission_from_text(BESIDE, "beside"),
    "by the light of the Earth": lambda: load_mission("okeefe_earthlight").with_overrides(
        ["mission.case=3", "measures.settled_time=60", "earthlight.albedo.factor=1.1"]
    ),
    "by the light of the Earth, without gyro": lambda: load_mission("okeefe_earthlight").with_overrides(
        ["mission.case=12", "measures.settled_time=60", "earthlight.use_gyro=false"]
    ),
}


@cache
def flown_by_nodes(variant):
    """A variant as it flies, and the log of its nodes."""
    flown = VARIANTS[variant]().with_overrides(["mission.duration=400"])
    return flown, fly_directly(flown)


@pytest.mark.parametrize("variant", VARIANTS)
def test_the_nodes_estimate_something(variant):
    # before the comparison, so that no test compiles both the nodes and the loop
    _, log = flown_by_nodes(variant)
    assert log.attitudes
    assert all(np.any(columns.validity > 0) for columns in log.attitudes.values())


@pytest.mark.parametrize("variant", VARIANTS)
def test_a_case_is_the_flight_of_the_nodes_bit_for_bit(variant):
    flown, log = flown_by_nodes(variant)
    case = flown.values.mission.case
    assert log.attitudes
    for name in log.attitudes:
        flight = MissionFlight(flown, name)
        result = fly_cases(flight, np.array([case + 1, case]), 1, traced=True)
        trace, columns = result.trace[1], log.attitudes[name]
        np.testing.assert_array_equal(trace[:, 0:3], present(log.truth).sigma_bn)
        np.testing.assert_array_equal(trace[:, 3:6], present(log.truth).omega_bn_b)
        np.testing.assert_array_equal(trace[:, 9:12], columns.omega_bn_b)
        np.testing.assert_array_equal(trace[:, 12:15], columns.gyro_bias_b)
        estimated = columns.validity > 0
        quaternions = [mrp_to_quaternion(tuple(sigma)) for sigma in trace[estimated, 6:9]]
        np.testing.assert_array_equal(quaternions, columns.q_bn[estimated])
        if log.wheels is not None:
            np.testing.assert_array_equal(trace[:, -log.wheels.speed.shape[1] :], log.wheels.speed)
        check_figures(flight, result.tallies, log, name)


def check_figures(flight, tallies, log, name):
    """Row 1 of the tallies against what is measured in the flight's log."""
    steps, errors, _ = attitude_errors(log, name)
    period = flight.mission.values.mission.period
    times = steps * period
    windows = windows_of(flight.mission)
    row = case_table(np.arange(2), tallies, period, windows).to_pylist()[1]
    samples = np.array(row["attitude_error_deg"])
    np.testing.assert_allclose(samples[steps], np.degrees(errors), rtol=1e-6, atol=1e-6)
    run = next(run for run in estimator_runs(log) if run["estimator"] == name)
    assert row["attitude_error_mean_deg"] == pytest.approx(run["attitude_error_mean_deg"], rel=1e-12)
    assert row["attitude_error_p95_deg"] == pytest.approx(run["attitude_error_p95_deg"], abs=2 * BIN_DEG, rel=0.01)
    assert row["attitude_error_max_deg"] == pytest.approx(
        np.degrees(errors[times >= windows.settled_time].max()), rel=1e-12
    )
    assert row["attitude_nees"] == pytest.approx(run["attitude_nees"], rel=1e-12)
    assert row["steps_without_estimate"] == run["steps_without_estimate"]
    assert row["first_attitude_s"] == pytest.approx(times[0])


def test_cases_do_not_depend_on_their_company():
    flight = MissionFlight(mission("mission.duration=60"), VOLTAGE)
    together = fly_cases(flight, np.array([4, 5, 6]), 1, traced=True).trace
    np.testing.assert_array_equal(fly_cases(flight, np.array([6]), 1, traced=True).trace[0], together[2])


CASES = np.arange(12)


def flown_totals(*overrides, guess_deg=0.0, cases=CASES, filters=FILTERS):
    """Totals of all cases by filter."""
    flown = mission(*overrides)
    return {name: fly_cases(MissionFlight(flown, name), cases, 1, guess_deg).tallies.totals for name in filters}


@pytest.fixture(scope="module")
def totals():
    """Totals of the paper's filters, from the start that Sun and field give, by set of diodes."""
    sets = {"six": (), "five": (FIVE,), "four": (FOUR,)}
    return {name: flown_totals(*overrides, *WHITE) for name, overrides in sets.items()}


def mean(totals, quantity, name):
    return totals[name][quantity].sum() / totals[name]["settled"].sum()


@pytest.mark.parametrize("diodes", ["six", "five", "four"])
def test_voltages_are_never_worse_than_the_vector(totals, diodes):
    t = totals[diodes]
    assert mean(t, "error_sum", VOLTAGE) < 1.05 * mean(t, "error_sum", VECTOR)
    # no case diverges
    assert max(t[name]["error_max"].max() for name in FILTERS) < 5.0


@pytest.mark.parametrize("diodes", ["six", "five", "four"])
@pytest.mark.parametrize("f", FILTERS)
def test_filters_are_consistent_where_cells_are_gaussian(totals, diodes, f):
    """15 % of 3; twelve cases alone leave the field-only filter of four diodes a scatter of as much again."""
    tolerance = 0.3 if diodes == "four" and f == VECTOR else 0.15
    assert mean(totals[diodes], "nees3_sum", f) == pytest.approx(3.0, rel=tolerance)
    assert mean(totals[diodes], "nees6_sum", f) == pytest.approx(6.0, rel=tolerance)
    nis = totals[diodes][f]["nis_sum"].sum() / totals[diodes][f]["innovations"].sum()
    assert nis == pytest.approx(1.0, abs=0.05)


def test_four_diodes_in_a_plane_want_voltages(totals):
    """From a guess 20 deg off, as without a Sun vector the vector filter has nothing better."""
    t = flown_totals(FOUR, *WHITE, guess_deg=20.0)
    assert mean(t, "error_sum", VECTOR) > 2.0 * mean(t, "error_sum", VOLTAGE)
    assert mean(t, "error_sum", VOLTAGE) < 1.2 * mean(totals["six"], "error_sum", VOLTAGE)


# Of 1000 cases with four diodes those whose guess, 42 deg off, had ended in a false attitude for ten minutes.
FALSE = np.array([167, 423, 623])


@pytest.mark.parametrize("overrides", [WHITE, ()], ids=["white", "lasting"])
def test_no_guess_ends_in_a_false_attitude(overrides):
    (t,) = flown_totals(FOUR, *overrides, guess_deg=20.0, cases=FALSE, filters=(VOLTAGE,)).values()
    assert t["error_max"].max() < 1.5
    # of three cases, with 500 independent errors each at the most
    assert t["nees3_sum"].sum() / t["settled"].sum() == pytest.approx(3.0, rel=0.3)


ALBEDO = "css_array.albedo.enabled=true"
OTHER_FIELDS = ("magnetometer.bias_nt=100", *(f"{name}.reference.field_degree=6" for name in FILTERS))
TRUTHS = {
    "no light of the Earth": (),
    "light of the Earth": (ALBEDO,),
    "cells that do not read below zero": (ALBEDO, "css_array.output_low=0"),
    "an Earth half as bright again": (ALBEDO, "css_array.albedo.factor=1.5"),
    "another model of it": (ALBEDO, "css_array.albedo.reflectivity=knocke"),
}


@pytest.mark.parametrize("truth", TRUTHS)
def test_the_filter_is_right_and_knows_it(totals, truth):
    """As the mission is, whatever the Earth: 0.3 deg, and consistent within a fifth."""
    t = flown_totals(*TRUTHS[truth])
    for f in FILTERS:
        assert mean(t, "error_sum", f) < min(0.3, 1.1 * mean(totals["six"], "error_sum", f))
        assert mean(t, "nees3_sum", f) == pytest.approx(3.0, rel=0.2)
        assert t[f]["error_max"].max() < 2.0


def test_white_errors_are_dear_where_the_earth_shines(totals):
    t = flown_totals(ALBEDO, *WHITE)
    for f in FILTERS:
        assert mean(t, "error_sum", f) > 3.0 * mean(totals["six"], "error_sum", f)
        assert mean(t, "nees3_sum", f) > 20.0


def test_a_biased_magnetometer_and_a_coarse_field_model():
    """Over the hours of a day, as the omitted field differs from place to place: consistent within a fifth."""
    sums = {f: np.zeros(3) for f in FILTERS}
    white = np.zeros(3)
    for hour in range(0, 24, 4):
        where = f"mission.epoch=2013-06-01T{hour:02d}:00:00Z"
        cases = 100 * hour + np.arange(2)
        t = flown_totals(ALBEDO, where, *OTHER_FIELDS, cases=cases)
        for f in FILTERS:
            sums[f] += [t[f][name].sum() for name in ("nees3_sum", "error_sum", "settled")]
        t = flown_totals(ALBEDO, where, *OTHER_FIELDS, f"{VOLTAGE}.error_model=white", cases=cases, filters=(VOLTAGE,))
        white += [t[VOLTAGE][name].sum() for name in ("nees3_sum", "error_sum", "settled")]
    for nees, error, steps in sums.values():
        assert nees / steps == pytest.approx(3.0, rel=0.2)
        assert error / steps < 0.4
    assert white[0] / white[2] > 10.0


def test_a_coarser_field_model_than_the_truths(totals):
    """Harmonics up to degree 8 of 13 leave out some 40 nT, a fifth of the magnetometer's noise."""
    coarse = [f"{name}.reference.field_degree=8" for name in FILTERS]
    t = flown_totals(*coarse)
    for f in FILTERS:
        assert mean(t, "error_sum", f) != mean(totals["six"], "error_sum", f)
        assert mean(t, "error_sum", f) < 1.2 * mean(totals["six"], "error_sum", f)
