# SPDX-License-Identifier: Apache-2.0
"""Studies of attitude filters: the same bytes however they are run, and beside Sun estimators."""

import numpy as np
import pytest

from css_analysis.errors import StudyError
from css_analysis.flight_metrics import Windows
from css_analysis.quantities import attitude_quantities, study_quantities
from css_analysis.study_summary import configuration_objects, rows_of
from css_common.mission import load_mission, mission_from_text
from css_monte_carlo import study
from css_monte_carlo.attitude_tallies import SAMPLED
from css_monte_carlo.schedulers import DaskScheduler
from css_monte_carlo.study import Configuration, read_study, run_study

EVENTS = "events: {off: {time: 310.0, node: gyro, action: deactivate}}"
MISSION = mission_from_text(
    load_mission("cubesat_vmm", ["mission.duration=360"])
    .text()
    .replace("ros__parameters:", f"ros__parameters:\n    {EVENTS}", 1),
    "scripted",
)
CONFIGURATIONS = (
    Configuration("attitude_vector", True),
    Configuration("attitude_voltage", True),
    Configuration("attitude_voltage", False, ("css_array.albedo.enabled=true", "css_array.albedo.draw=per_cell")),
    Configuration("attitude_voltage", True, ("mission.epoch=2013-12-01T06:00:00Z", "orbit.raan_deg=245")),
)
CASES = 5
FIGURES = [quantity.name for quantity in attitude_quantities(Windows())]
HEADING_FIGURES = [quantity.study_column for quantity in study_quantities(Windows())]


def fly(folder, **options):
    return run_study(MISSION, CONFIGURATIONS, CASES, folder, guess_deg=20.0, **options)


def contents(folder):
    return {file.name: file.read_bytes() for file in folder.iterdir()}


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A study flown in one go by one thread."""
    return fly(tmp_path_factory.mktemp("studies") / "whole", threads=1)


def test_tables_hold_every_case_and_time(whole):
    assert MISSION.events
    assert whole.cases.column_names == ["estimator", "gyro", "overrides", "case", *FIGURES]
    assert whole.cases.num_rows == len(CONFIGURATIONS) * CASES
    assert set(whole.percentiles["quantity"].to_pylist()) == set(SAMPLED)
    error = rows_of(whole.percentiles, estimator="attitude_vector", quantity="attitude_error_deg")
    assert error["time_s"].to_pylist() == [float(t) for t in range(360)]
    # without a gyro from 310 s on, errors grow
    median = error["p50"].to_numpy()
    assert median[340:].mean() > 2.0 * median[250:310].mean()


def test_filters_share_their_guess(whole):
    first = rows_of(whole.percentiles, quantity="attitude_sigma_deg", time_s=0.0)["p50"].to_numpy()
    assert np.all(first < 20.0 * np.sqrt(3.0) + 1.0) and len(first) == len(CONFIGURATIONS)
    assert whole.manifest["attitude_filters"] == ["attitude_vector", "attitude_voltage"]
    assert whole.manifest["guess_deg"] == 20.0


def test_another_date_and_orbit_are_other_flights_of_the_same_cases(whole):
    here = rows_of(whole.cases, estimator="attitude_voltage", gyro=True, overrides="")
    (elsewhere,) = [" ".join(c.overrides) for c in CONFIGURATIONS if "orbit.raan_deg=245" in c.overrides]
    there = rows_of(whole.cases, estimator="attitude_voltage", gyro=True, overrides=elsewhere)
    assert here["case"].equals(there["case"])
    a, b = (rows["attitude_error_mean_deg"].to_numpy() for rows in (here, there))
    assert np.all(a != b) and np.all(b < 2.0)


def test_another_guess_is_another_study(whole):
    with pytest.raises(StudyError, match="guess_deg"):
        run_study(MISSION, CONFIGURATIONS, CASES, whole.folder, guess_deg=10.0)


@pytest.mark.parametrize("chunk_cases", [1, 3])
def test_bytes_do_not_depend_on_threads_or_chunks(whole, tmp_path, monkeypatch, chunk_cases):
    monkeypatch.setattr(study, "CHUNK_CASES", chunk_cases)
    fly(tmp_path / "other", threads=3)
    assert contents(tmp_path / "other") == contents(whole.folder)


def test_interrupted_study_goes_on_and_ends_with_the_same_bytes(whole, tmp_path, monkeypatch):
    monkeypatch.setattr(study, "CHUNK_CASES", 2)

    def stop(done: int, total: int) -> None:
        if done >= 4:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fly(tmp_path / "s", progress=stop)
    with pytest.raises(StudyError, match="holds no complete study"):
        read_study(tmp_path / "s")
    assert fly(tmp_path / "s").flown < len(CONFIGURATIONS) * CASES * 360
    assert contents(tmp_path / "s") == contents(whole.folder)


def test_cluster_gives_the_same_bytes(whole, tmp_path, monkeypatch):
    monkeypatch.setattr(study, "CHUNK_CASES", 3)
    fly(tmp_path / "s", scheduler=DaskScheduler("local", workers=2))
    assert contents(tmp_path / "s") == contents(whole.folder)


BESIDE = """/**:
  ros__parameters:
    extends: okeefe_2013
    mission: {name: beside, duration: 330.0, period: 1.0}
    measures: {settled_time: 300.0}
    graph:
      nodes: [css_sim/dynamics, css_sim/css_array, css_sim/gyro, css_sim/magnetometer, css_estimation/ekf,
              css_estimation/attitude_filter, sunpoint_control/mrp_control]
mrp_control:
  ros__parameters:
    gains: {p: 0.5}
"""


def test_a_filter_beside_the_sun_estimator_that_controls(tmp_path):
    """Columns of the other kind are null; the Sun estimator's are those that it has alone."""
    mission = mission_from_text(BESIDE, "beside")
    ekf = Configuration("ekf", True)
    both = run_study(mission, [ekf, Configuration("attitude_filter", True)], 2, tmp_path / "both")
    alone = run_study(mission, [ekf], 2, tmp_path / "alone")
    rows = rows_of(both.cases, estimator="ekf")
    assert rows.select(alone.cases.column_names).equals(alone.cases)
    assert all(rows[name].null_count == 2 for name in FIGURES if name not in HEADING_FIGURES)
    rows = rows_of(both.cases, estimator="attitude_filter")
    assert all(rows[name].null_count == 2 for name in HEADING_FIGURES if name not in FIGURES)
    assert rows["attitude_error_mean_deg"].null_count == 0
    summary = configuration_objects(both)
    assert "converging_mean_s" in summary[0] and "attitude_nees" in summary[1]
