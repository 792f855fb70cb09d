# SPDX-License-Identifier: Apache-2.0
"""Missions that the compiled loop has no place for: stepped node by node, measured as by the loop."""

import numpy as np
import pytest

from css_analysis.estimator_runs import estimator_runs
from css_analysis.flight_metrics import windows_of
from css_analysis.study_summary import configuration_objects
from css_common.mission import MissionError, load_mission, mission_from_text
from css_monte_carlo.case_table import case_table
from css_monte_carlo.chunk import fly_cases
from css_monte_carlo.direct_flight import fly_directly
from css_monte_carlo.mission_flight import MissionFlight
from css_monte_carlo.stepped_flight import SteppedFlight
from css_monte_carlo.study import Configuration, run_study

COARSE = ("mission.period=1.0", "mission.duration=330", "mrp_control.gains.p=0.5")
SHORT = {
    "Sun estimator with control": lambda: (load_mission("okeefe_2013").with_overrides(COARSE), "ekf"),
    "attitude filter": lambda: (load_mission("cubesat_vmm", ["mission.duration=330"]), "attitude_voltage"),
}


@pytest.mark.parametrize(("kind", "guess_deg"), [*((kind, 0.0) for kind in SHORT), ("attitude filter", 20.0)])
def test_cases_are_measured_as_by_the_loop(kind, guess_deg):
    mission, estimator = SHORT[kind]()
    cases = np.array([0, 3])
    compiled, stepped = MissionFlight(mission, estimator), SteppedFlight(mission, estimator)
    assert compiled.measure is stepped.measure
    windows = windows_of(mission)
    expected = case_table(cases, fly_cases(compiled, cases, 10, guess_deg).tallies, 1.0, windows)
    found = case_table(cases, stepped.fly(cases, 10, guess_deg)[0], 1.0, windows)
    assert found.column_names == expected.column_names
    assert len(found.column_names) > 10
    for name in found.column_names:
        for ours, theirs in zip(found[name].to_pylist(), expected[name].to_pylist(), strict=True):
            np.testing.assert_allclose(
                np.array(ours, float), np.array(theirs, float), rtol=1e-5, atol=1e-7, err_msg=name
            )


def test_a_rocket_that_sees_the_sun_through_slits_is_a_study(tmp_path):
    """Slits, field, TRIAD: the attitude that comes two samples later is compared with that of its instant."""
    mission = load_mission("esprit_2006", ["mission.duration=3"])
    configurations = [Configuration("triad", True)]
    study = run_study(mission, configurations, 2, tmp_path / "s", threads=1)
    assert any("no place for the node rocket" in line for line in study.warnings)
    (row, _) = study.cases.to_pylist()
    log = fly_directly(mission.with_overrides(["mission.case=0"]))
    run = next(run for run in estimator_runs(log) if run["estimator"] == "triad")
    assert row["steps_without_estimate"] == run["steps_without_estimate"]
    assert 0.0 < row["first_attitude_s"] < 1.0
    error = next(
        q for q in study.percentiles.to_pylist() if q["quantity"] == "attitude_error_deg" and q["time_s"] == 2.0
    )
    assert 0.0 < error["p95"] < 3.0
    assert row["gyro_bias_error_mean_deg_s"] is None and row["attitude_bias_nees"] is None
    told = configuration_objects(study)[0]
    assert told["attitude_error_mean_deg"] == pytest.approx(np.mean(study.cases["attitude_error_mean_deg"].to_numpy()))
    assert row["attitude_error_mean_deg"] == pytest.approx(run["attitude_error_mean_deg"], rel=1e-9)
    again = run_study(mission, configurations, 2, tmp_path / "again", threads=2)
    for file in ("cases.parquet", "percentiles.parquet", "study.json"):
        assert (tmp_path / "s" / file).read_bytes() == (again.folder / file).read_bytes()


def test_an_event_that_the_loop_has_no_place_for_is_flown(tmp_path):
    text = "/**: {{ros__parameters: {{extends: okeefe_2013, mission: {{duration: 60.0, period: 1.0}}{}}}}}"
    event = ", events: {held: {time: 20.0, node: mrp_control, action: deactivate}}"
    held, free = (
        run_study(mission_from_text(text.format(events), name), [Configuration("ekf", True)], 1, tmp_path / name)
        for name, events in (("held", event), ("free", ""))
    )
    assert any("events.held: the compiled loop switches sensors alone" in line for line in held.warnings)
    assert not free.warnings
    assert held.cases["rate_final_deg_s"].to_pylist() != free.cases["rate_final_deg_s"].to_pylist()


def test_what_measures_nothing_is_refused():
    with pytest.raises(MissionError, match="coning estimates neither Sun nor attitude"):
        SteppedFlight(load_mission("esprit_2006"), "coning")


def test_an_attitude_that_is_solved_for_is_given_no_guess(tmp_path):
    with pytest.raises(MissionError, match="no place for the node rocket: attitude filters can be given no guess"):
        run_study(load_mission("esprit_2006"), [Configuration("triad", True)], 1, tmp_path / "s", guess_deg=5.0)
