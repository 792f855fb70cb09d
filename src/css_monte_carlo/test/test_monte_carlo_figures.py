# SPDX-License-Identifier: Apache-2.0
"""Figures of merit that the loop keeps while flying, against those of a whole flight's log."""

import numpy as np
import pytest
from presence import present

from css_analysis.configured_mission import configured
from css_analysis.estimate_errors import tangent_nees
from css_analysis.estimator_runs import estimator_runs
from css_analysis.flight_metrics import Windows, acquisition, sunlit_passes, windows_of
from css_analysis.sum_measures import percentile_of_histogram
from css_common.mission import load_mission
from css_monte_carlo.case_table import case_table
from css_monte_carlo.case_tallies import BIN_DEG, SAMPLED, sample_count, step_marks
from css_monte_carlo.chunk import fly_cases
from css_monte_carlo.direct_flight import fly_directly
from css_monte_carlo.mission_flight import MissionFlight
from css_monte_carlo.percentiles import over_cases

# A cycle of 1 s keeps an orbit with its eclipse short; without gyro there is something to converge after it.
ORBIT = load_mission("okeefe_2013").with_overrides(["mission.period=1.0", "mrp_control.gains.p=0.5"])
CASES = np.arange(3)


@pytest.fixture(scope="module", params=[("ekf", True), ("wavg", False)])
def flown(request):
    """Rows of the case table and the logs of the same flights."""
    estimator, gyro = request.param
    mission = configured(ORBIT, estimator=estimator, gyro=gyro)
    flight = MissionFlight(mission)
    tallies = fly_cases(flight, CASES, 10).tallies
    rows = case_table(CASES, tallies, 1.0, windows_of(mission)).to_pylist()
    return estimator, rows, [fly_directly(configured(mission, case=int(c), gyro=gyro)) for c in CASES]


def test_flights_are_measured_as_their_logs_are(flown):
    estimator, rows, logs = flown
    for row, log in zip(rows, logs, strict=True):
        (run,) = estimator_runs(log, [estimator])
        assert row["converging_s"] == run["power_positive_s"]
        for key in ("heading_error_mean_deg", "pointing_error_mean_deg", "rate_final_deg_s"):
            assert row[key] == pytest.approx(run[key], rel=1e-9)
        assert row["heading_error_p95_deg"] == pytest.approx(run["heading_error_p95_deg"], abs=2 * BIN_DEG)
        assert row["steps_without_estimate"] == run["steps_without_estimate"]
        assert row["acquired_s"] == present(acquisition(log)) * 1.0


def test_converging_is_split_at_the_first_eclipse(flown):
    _, rows, logs = flown
    for row, log in zip(rows, logs, strict=True):
        first, *later = (sun.converging_s for sun in sunlit_passes(log))
        assert later
        assert (row["converging_first_s"], row["converging_later_s"]) == (first, sum(later))


def test_rates_at_fifty_minutes_are_means_of_the_minute_before(flown):
    estimator, rows, logs = flown
    for row, log in zip(rows, logs, strict=True):
        minute = slice(2941, 3001)
        rate = np.degrees(log.rate[minute]).mean()
        error = log.estimates[estimator].omega_bn_b[minute] - log.having("truth").omega_bn_b[minute]
        assert row["rate_50min_deg_s"] == pytest.approx(rate, rel=1e-9)
        knowledge = np.degrees(np.linalg.norm(error, axis=1)).mean()
        assert row["rate_knowledge_50min_deg_s"] == pytest.approx(knowledge, rel=1e-9)


def test_consistency_is_that_of_the_sampled_steps(flown):
    estimator, rows, logs = flown
    for row, log in zip(rows, logs, strict=True):
        steps, nees = tangent_nees(log, estimator)
        assert row["nees_mean"] == pytest.approx(nees[steps % 10 == 0].mean() / 2.0, rel=1e-6)
        estimates = log.estimates[estimator]
        if estimator == "wavg":
            # an average has an error bar while one cell is lit, and no innovations
            assert row["nis_mean"] is None
            continue
        assert row["nis_mean"] == pytest.approx(estimates.nis.sum() / estimates.nis_dof.sum(), rel=1e-9)


def test_samples_are_those_of_the_log(flown):
    estimator, rows, logs = flown
    for row, log in zip(rows, logs, strict=True):
        assert len(row["rate_deg_s"]) == sample_count(5550, 10) == 555
        np.testing.assert_allclose(row["rate_deg_s"], np.degrees(log.rate[::10]), rtol=1e-6)
        np.testing.assert_allclose(row["pointing_error_deg"], np.degrees(log.pointing_error[::10]), rtol=1e-6)
        error = log.estimates[estimator].omega_bn_b - log.having("truth").omega_bn_b
        expected = np.degrees(np.linalg.norm(error[::10], axis=1))
        np.testing.assert_allclose(row["rate_knowledge_deg_s"], expected, rtol=1e-5)


def test_short_flights_have_no_rates_at_fifty_minutes():
    flight = MissionFlight(ORBIT.with_overrides(["mission.duration=40"]))
    (row,) = case_table(np.arange(1), fly_cases(flight, np.arange(1), 10).tallies, 1.0, windows_of(ORBIT)).to_pylist()
    for key in ("rate_50min_deg_s", "rate_knowledge_50min_deg_s", "acquired_s", "heading_error_mean_deg"):
        assert row[key] is None


def test_marks_of_a_flight_that_begins_in_the_shadow():
    illumination = np.array([0.0, 0.4, 0.6, 1.0, 0.0, 1.0])
    assert (step_marks(illumination, 1.0, Windows()) & 3).tolist() == [0, 0, 3, 3, 0, 1]


def test_percentiles_over_cases_are_numpys():
    samples = np.random.default_rng(5).normal(size=(37, 11)).astype(np.float32)
    samples[3:9, 2] = np.nan
    samples[:, 4] = np.nan
    over = over_cases(samples)
    assert over["count"].tolist() == [37, 37, 31, 37, 0] + [37] * 6
    some = [k for k in range(11) if k != 4]
    for percent in (5, 25, 50, 75, 95):
        expected = np.nanpercentile(samples[:, some].astype(float), percent, axis=0)
        np.testing.assert_allclose(over[f"p{percent:02d}"][some], expected, rtol=1e-6)
    np.testing.assert_allclose(over["mean"][some], np.nanmean(samples[:, some].astype(float), axis=0), rtol=1e-6)
    assert np.isnan(over["mean"][4]) and np.isnan(over["p50"][4])
    assert set(SAMPLED) == {"heading_error_deg", "pointing_error_deg", "rate_deg_s", "rate_knowledge_deg_s"}


def test_percentile_of_a_histogram_is_within_a_bin():
    errors = np.random.default_rng(6).gamma(2.0, 2.0, size=5000)
    counts = np.bincount((errors / BIN_DEG).astype(int), minlength=9000)
    for percent in (5.0, 50.0, 95.0, 100.0):
        assert percentile_of_histogram(counts, percent, BIN_DEG) == pytest.approx(
            np.percentile(errors, percent), abs=BIN_DEG
        )
    assert np.isnan(percentile_of_histogram(np.zeros(10, int), 95.0, BIN_DEG))
