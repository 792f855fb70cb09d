# SPDX-License-Identifier: Apache-2.0
"""Quantities of made-up flights in which every angle and time is known."""

import io
import json

import numpy as np
import pytest
from presence import present
from rich.console import Console
from synthetic_flight import DT, columns, estimates, flight, stamps, tilted, truth

from css_analysis.estimate_errors import heading_errors, tangent_nees
from css_analysis.estimator_runs import estimator_runs
from css_analysis.flight_log import FlightLog
from css_analysis.flight_metrics import Windows, acquisition, sunlit_passes
from css_analysis.flight_summary import criteria_failures, summary_table
from css_analysis.quantities import flight_quantities
from css_common.mission import load_mission
from css_msgs.msg import AttitudeEstimate, ControlStatus


def steps(seconds: float) -> int:
    return round(seconds / DT)


def slewing_flight(error_deg: float = 3.0) -> FlightLog:
    """100 s at 90 deg, 200 s at 10 deg, 50 s eclipse at 80 deg, 20 s at 40 deg, 130 s at 5 deg."""
    spans = [(100.0, 90.0, 1.0), (200.0, 10.0, 1.0), (50.0, 80.0, 0.2), (20.0, 40.0, 0.8), (130.0, 5.0, 1.0)]
    pointing = np.concatenate([np.full(steps(t), a) for t, a, _ in spans])
    lit = np.concatenate([np.full(steps(t), f) for t, _, f in spans])
    return flight(pointing, lit, ekf=estimates(tilted(pointing + error_deg)))


def test_all_quantities_of_a_known_flight():
    log = slewing_flight()
    present(log.truth).omega_bn_b[:, 1] = np.radians(1.0)
    present(log.truth).omega_bn_b[-steps(60.0) :, 1] = np.radians(0.25)
    (run,) = estimator_runs(log)
    counted = 200.0 + 20.0 + 130.0
    after = 200.0 * 10.0 + 20.0 * 40.0 + 130.0 * 5.0
    assert run == {
        "estimator": "ekf",
        "gyro": "off",
        "flown": False,
        "power_positive_s": pytest.approx(120.0),
        "heading_error_mean_deg": pytest.approx(3.0),
        "heading_error_p95_deg": pytest.approx(3.0),
        "heading_error_eclipse_deg": pytest.approx(3.0),
        "heading_error_dawn_deg": pytest.approx(3.0),
        "attitude_error_mean_deg": None,
        "attitude_error_p95_deg": None,
        "attitude_nees": None,
        "pointing_error_mean_deg": pytest.approx(after / counted),
        "pointing_error_sunlit_deg": pytest.approx((100.0 * 90.0 + after) / (100.0 + counted)),
        "heading_error_sunlit_deg": pytest.approx(3.0),
        "rate_final_deg_s": pytest.approx(0.25),
        "steps_without_estimate": 0,
        "isolated_cells": [],
    }
    assert list(run)[3:-1] == list(flight_quantities(Windows()))


def test_acquisition_is_the_first_minute_within_thirty_degrees():
    assert acquisition(slewing_flight()) == steps(100.0)
    passing = np.concatenate([np.full(steps(59.9), 29.0), [31.0], np.full(steps(61.0), 29.0)])
    assert acquisition(flight(passing)) == steps(59.9) + 1
    assert acquisition(flight(np.full(601, 10.0))) == 0
    assert acquisition(flight(np.full(600, 10.0))) is None, "59.9 s are no minute"
    assert acquisition(flight(np.full(900, 10.0), np.repeat([1.0, 0.0, 1.0], 300))) is None


def test_the_final_rate_is_that_of_the_last_minute():
    """A rate that grows with time: its mean over a window tells where the window begins."""
    log = flight(np.full(steps(200.0), 10.0), ekf=estimates(tilted(np.full(steps(200.0), 10.0))))
    time = np.arange(steps(200.0)) * DT
    present(log.truth).omega_bn_b[:, 0] = np.radians(0.01 * time)
    (run,) = estimator_runs(log)
    assert run["rate_final_deg_s"] == pytest.approx(0.01 * (time[-1] - 0.5 * (60.0 - DT)))


def test_an_attitude_counts_from_three_hundred_seconds_on():
    count = steps(400.0)
    log = flight(np.full(count, 10.0))
    log.mission = load_mission("cubesat_vmm")
    assert log.mission.values.measures.settled_time == 300.0
    # an error that falls with time about z, in the quaternion of an attitude whose truth is b = n
    error = np.radians(5.0 - 0.01 * np.arange(count) * DT)
    quaternion = np.stack((0.0 * error, 0.0 * error, np.sin(0.5 * error), np.cos(0.5 * error)), 1)
    covariance = np.tile((np.radians(2.0) ** 2 * np.eye(6)).ravel(), (count, 1))
    log.attitudes["filter"] = columns(
        AttitudeEstimate, stamps(count), q_bn=quaternion, covariance=covariance, validity=2
    )
    (run,) = estimator_runs(log)
    settled = np.degrees(error[steps(300.0) :])
    assert run["attitude_error_mean_deg"] == pytest.approx(np.mean(settled), rel=1e-6)
    assert run["attitude_error_p95_deg"] == pytest.approx(np.percentile(settled, 95.0), rel=1e-6)
    assert run["attitude_nees"] == pytest.approx(np.mean((settled / 2.0) ** 2), rel=1e-3)


def test_darkness_does_not_count():
    pointing = np.full(2000, 10.0)
    lit = np.repeat([1.0, 0.0], 1000)
    run = estimator_runs(flight(pointing, lit, ekf=estimates(tilted(pointing + np.repeat([2.0, 60.0], 1000)))))[0]
    assert run["heading_error_p95_deg"] == pytest.approx(2.0)
    assert run["power_positive_s"] == 0.0


def test_a_flight_that_never_points_has_no_figures_of_acquisition():
    pointing = np.full(2000, 31.0)
    run = estimator_runs(flight(pointing, ekf=estimates(tilted(pointing))))[0]
    assert run["power_positive_s"] is None
    assert run["heading_error_mean_deg"] is None and run["heading_error_p95_deg"] is None
    assert run["pointing_error_mean_deg"] is None
    assert run["rate_final_deg_s"] == 0.0


def test_within_thirty_degrees_in_the_dark_is_not_power_positive():
    run = estimator_runs(flight(np.repeat([50.0, 5.0], 100), np.repeat([1.0, 0.0], 100)))
    assert run == []
    log = flight(np.repeat([50.0, 5.0], 100), np.repeat([1.0, 0.0], 100), ekf=estimates(tilted(np.zeros(200))))
    assert estimator_runs(log)[0]["power_positive_s"] is None


def test_steps_without_estimate_do_not_count_but_are_counted():
    pointing = np.full(1000, 10.0)
    ekf = estimates(tilted(pointing + 2.0))
    ekf.validity[:50] = 0
    ekf.sun_b[:50] = 0.0
    ekf.validity[50:100] = 1
    run = estimator_runs(flight(pointing, ekf=ekf))[0]
    assert run["heading_error_mean_deg"] == pytest.approx(2.0)
    assert run["steps_without_estimate"] == 50


def test_slower_and_shorter_estimates():
    pointing = np.full(1000, 10.0)
    slow = estimates(tilted(pointing + 2.0))
    for name, values in vars(slow).items():
        setattr(slow, name, values[::10])
    run = estimator_runs(flight(pointing, ekf=slow))[0]
    assert run["heading_error_mean_deg"] == pytest.approx(2.0)
    assert run["steps_without_estimate"] == 900


def test_foreign_telemetry_has_no_figures_at_all():
    log = FlightLog("foreign", estimates={"obc": estimates(tilted(np.zeros(100)), rate_source=1)})
    (run,) = estimator_runs(log)
    named = {"estimator": "obc", "gyro": "on", "flown": False, "isolated_cells": []}
    assert run == named | dict.fromkeys(flight_quantities(Windows()))
    assert acquisition(log) is None and sunlit_passes(log) == []


def test_flight_figures_belong_to_all_estimators():
    pointing = np.concatenate([np.full(300, 60.0), np.full(900, 12.0)])
    log = flight(pointing, ekf=estimates(tilted(pointing + 1.0)), wavg=estimates(tilted(pointing + 5.0)))
    log.mission = load_mission("okeefe_2013")
    log.control = columns(ControlStatus, stamps(1200))
    first, second = estimator_runs(log)
    assert (first["flown"], second["flown"]) == (True, False)
    assert first["gyro"] == "on", "by the parameter of the node"
    of_the_flight = ("power_positive_s", "pointing_error_mean_deg", "pointing_error_sunlit_deg", "rate_final_deg_s")
    for quantity in of_the_flight:
        assert first[quantity] == second[quantity]
    assert second["heading_error_mean_deg"] == pytest.approx(5.0)
    assert estimator_runs(log, flown="wavg")[1]["flown"]


def test_passes_split_first_acquisition_and_the_one_after_eclipse():
    first, second = sunlit_passes(slewing_flight())
    assert first.start_s == 0.0 and first.converging_s == pytest.approx(100.0)
    assert first.acquired_s == pytest.approx(100.0)
    assert second.start_s == pytest.approx(350.0) and second.converging_s == pytest.approx(20.0)
    assert second.acquired_s == pytest.approx(20.0)
    (only,) = sunlit_passes(flight(np.full(1000, 40.0)))
    assert only.acquired_s is None and only.converging_s == pytest.approx(100.0)


def test_a_truth_of_one_step():
    log = FlightLog("short", truth=truth(np.array([10.0])), estimates={"ekf": estimates(tilted([12.0]))})
    run = estimator_runs(log)[0]
    assert run["power_positive_s"] == 0.0 and run["heading_error_mean_deg"] is None


def test_heading_errors_name_their_steps():
    pointing = np.full(10, 10.0)
    ekf = estimates(tilted(pointing + np.arange(10)))
    log = flight(pointing, ekf=ekf)
    at, errors = heading_errors(log, "ekf")
    np.testing.assert_array_equal(at, np.arange(10))
    np.testing.assert_allclose(np.degrees(errors), np.arange(10), atol=1e-10)


def test_nees_of_drawn_errors_is_chi_square_of_two():
    random = np.random.default_rng(4)
    n, sigma = 20000, np.array([0.01, 0.03])
    sun_b = tilted(np.full(n, 35.0), azimuth=0.7)
    # two axes across the Sun line with different variances; a large variance along the line must not matter
    e1 = tilted(np.full(n, 125.0), azimuth=0.7)
    e2 = np.cross(sun_b, e1)
    draws = random.normal(size=(n, 2)) * sigma
    true_sun = sun_b + draws[:, :1] * e1 + draws[:, 1:] * e2
    covariance = sum(s**2 * np.einsum("ki,kj->kij", e, e) for s, e in ((0.01, e1), (0.03, e2), (0.5, sun_b)))
    ekf = estimates(sun_b, covariance=covariance.reshape(n, 9))
    ekf.covariance[:5, 0] = -1.0
    log = FlightLog("drawn", truth=truth(np.zeros(n), sun_n=true_sun), estimates={"ekf": ekf})
    at, nees = tangent_nees(log, "ekf")
    assert at[0] == 5 and len(nees) == n - 5
    # mean 2, variance 4: four standard errors of the mean
    assert abs(np.mean(nees) - 2.0) < 4.0 * 2.0 / np.sqrt(n)
    assert abs(np.mean(nees > 5.991) - 0.05) < 4.0 * np.sqrt(0.05 * 0.95 / n)


def test_headings_in_eclipse_and_at_dawn_are_told_apart():
    """Errors of 2 deg in sunlight, 8 in eclipse, 5 in the first minute after it."""
    pointing = np.full(steps(300.0), 10.0)
    lit = np.concatenate([np.full(steps(100.0), 1.0), np.full(steps(80.0), 0.2), np.full(steps(120.0), 1.0)])
    error = np.full(len(lit), 2.0)
    error[steps(100.0) : steps(180.0)] = 8.0
    error[steps(180.0) : steps(240.0)] = 5.0
    (run,) = estimator_runs(flight(pointing, lit, ekf=estimates(tilted(pointing + error))))
    assert run["heading_error_eclipse_deg"] == pytest.approx(8.0)
    assert run["heading_error_dawn_deg"] == pytest.approx(5.0)
    assert run["heading_error_sunlit_deg"] == pytest.approx((160.0 * 2.0 + 60.0 * 5.0) / 220.0)
    (run,) = estimator_runs(
        flight(pointing[: steps(90.0)], lit[: steps(90.0)], ekf=estimates(tilted(pointing + error)[: steps(90.0)]))
    )
    assert run["heading_error_eclipse_deg"] is None and run["heading_error_dawn_deg"] is None


def test_runs_are_valid_json_and_a_plain_table():
    log = slewing_flight()
    log.estimates["none"] = estimates(np.zeros((len(present(log.truth)), 3)), validity=0)
    runs = estimator_runs(log)
    assert json.loads(json.dumps(runs, allow_nan=False)) == runs
    out = io.StringIO()
    Console(file=out, width=100).print(summary_table(runs, "a flight"))
    text = out.getvalue()
    assert "\x1b" not in text
    row = next(line for line in text.splitlines() if "ekf" in line)
    assert "120.0" in row and "3.00" in row
    assert "-" in next(line for line in text.splitlines() if "none" in line)


def test_criteria():
    runs = estimator_runs(slewing_flight())
    runs[0]["flown"] = True
    beside = runs[0] | {"estimator": "wavg", "flown": False, "heading_error_mean_deg": 50.0}
    never = runs[0] | {"heading_error_mean_deg": None}
    met = {"heading_error_mean_deg": {"max": 4.0, "min": 1.0}, "power_positive_s": {"max": 120.1}}
    assert criteria_failures(met, [*runs, beside]) == []
    assert criteria_failures({"heading_error_mean_deg": {"max": 2.4}}, runs) == [
        "ekf: heading_error_mean_deg is 3, above criteria.heading_error_mean_deg.max 2.4"
    ]
    assert "below criteria.rate_final_deg_s.min" in criteria_failures({"rate_final_deg_s": {"min": 1.0}}, runs)[0]
    assert "has no value" in criteria_failures(met, [never])[0]
    dark = [runs[0] | {"power_positive_late": None}]
    assert criteria_failures({"power_positive_late": {"min": 0.9}}, dark)[0].endswith(
        "has no sunlight, or measures.late_time is 0"
    )
    assert "did you mean power_positive_s?" in criteria_failures({"power_positve_s": {"max": 1.0}}, runs)[0]
    assert len(criteria_failures({"heading_error_mean_deg": {"max": 4.0}}, [beside])) == 1, "a replay: all are judged"
    assert criteria_failures(met, []) != []
    assert criteria_failures({}, []) == []
