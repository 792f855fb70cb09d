# SPDX-License-Identifier: Apache-2.0
"""Flights in one process: the order of calls, scripted changes, and the figures of O'Keefe & Schaub 2013.

The paper's figures are means over 1000 cases; here a few cases of the first ten minutes, which are sunlit, and one
case through the eclipse. `./sunpoint reproduce okeefe` flies all of them.
"""

import numpy as np
import pytest
from presence import present
from synthetic_flight import record

from css_analysis.configured_mission import configured
from css_analysis.estimator_runs import estimator_runs
from css_analysis.flight_log import read_flight
from css_analysis.flight_metrics import sunlit_passes
from css_common.mission import load_mission, mission_from_text
from css_common.mission_file import MissionError
from css_monte_carlo.direct_flight import fly_directly
from css_msgs.msg import SunEstimate

TEN_MINUTES = "mission.duration=600"
CASES = range(3)


def short(*overrides: str, duration: float = 20.0):
    return load_mission("okeefe_2013").with_overrides([f"mission.duration={duration}", *overrides])


@pytest.fixture(scope="module")
def cases():
    """Runs of a few cases, by estimator, with gyro."""
    mission = load_mission("okeefe_2013").with_overrides([TEN_MINUTES])
    return {
        estimator: [
            estimator_runs(fly_directly(configured(mission, case=case, estimator=estimator)))[0] for case in CASES
        ]
        for estimator in ("ekf", "wavg")
    }


def test_the_kalman_filter_is_within_the_papers_error(cases):
    mean = np.mean([run["heading_error_mean_deg"] for run in cases["ekf"]])
    assert mean < 2.4


@pytest.mark.parametrize("case", [6, 30])
def test_a_spacecraft_whose_cells_look_to_one_side_finds_the_sun_behind_them(case):
    """Four cells at 45 deg to +z, and the Sun behind the body when it has come to rest: that is no night."""
    normals = "0.7071068,0,0.7071068,0,0.7071068,0.7071068,-0.7071068,0,0.7071068,0,-0.7071068,0.7071068"
    cells = f"cells.normals={normals}", "cells.clip_normal=0,0,0", "cells.field_of_view_deg=120"
    log = fly_directly(short(*cells, f"mission.case={case}", duration=240.0))
    cosines = log.sun_b @ np.asarray(log.array_normal_b)
    assert np.any(cosines[:1500] < 0.0) and np.all(cosines[-100:] > np.cos(np.radians(30.0)))
    assert np.all(log.estimates["ekf"].eclipse == SunEstimate.ECLIPSE_SUNLIT)


def test_every_case_is_power_positive_within_three_minutes(cases):
    for run in (*cases["ekf"], *cases["wavg"]):
        assert run["flown"] and run["gyro"] == "on"
        assert run["power_positive_s"] is not None and run["power_positive_s"] < 180.0


def test_the_weighted_average_has_the_error_that_its_map_predicts(cases):
    mean = np.mean([run["heading_error_mean_deg"] for run in cases["wavg"]])
    assert 4.0 < mean < 7.0


def test_the_kalman_filter_beats_the_average_in_every_case(cases):
    for ekf, wavg in zip(cases["ekf"], cases["wavg"], strict=True):
        assert ekf["heading_error_mean_deg"] < wavg["heading_error_mean_deg"]


def test_after_the_eclipse_the_sun_is_found_again():
    # two minutes before the shadow, which takes 35.9 min of an orbit (56.6 min are sunlit)
    log = fly_directly(short("orbit.true_anomaly_deg=123.2", "mission.case=1", duration=2500.0))
    before, after = sunlit_passes(log)
    assert before.acquired_s is not None and after.acquired_s is not None
    assert (after.start_s - before.end_s) / 60.0 == pytest.approx(35.9, abs=0.2)
    eclipsed = log.estimates["ekf"].eclipse == SunEstimate.ECLIPSE_ECLIPSED
    assert np.mean(eclipsed == ~log.sunlit) > 0.98
    assert estimator_runs(log)[0]["steps_without_estimate"] == 0


def test_without_gyro_the_rate_comes_from_the_sun():
    log = fly_directly(configured(short(), gyro=False))
    assert estimator_runs(log)[0]["gyro"] == "off"
    sources = set(log.estimates["ekf"].rate_source.tolist())
    assert SunEstimate.RATE_SUN in sources and SunEstimate.RATE_GYRO not in sources


def test_a_flight_is_repeatable_and_a_case_is_not_another():
    first, again, other = (fly_directly(configured(short(), case=case)) for case in (1, 1, 2))
    np.testing.assert_array_equal(present(first.truth).sigma_bn, present(again.truth).sigma_bn)
    np.testing.assert_array_equal(first.estimates["ekf"].covariance, again.estimates["ekf"].covariance)
    assert not np.array_equal(present(first.truth).sigma_bn, present(other.truth).sigma_bn)


def test_estimators_beside_the_flown_one_do_not_change_the_flight():
    nodes = [*load_mission("okeefe_2013").values.graph.nodes, "css_estimation/wavg"]
    both = fly_directly(short(f"graph.nodes={','.join(nodes)}"))
    alone = fly_directly(short())
    assert set(both.estimates) == {"ekf", "wavg"} and both.flown == "ekf"
    np.testing.assert_array_equal(present(both.truth).sigma_bn, present(alone.truth).sigma_bn)
    assert [run["flown"] for run in estimator_runs(both)] == [True, False]


def test_another_estimator_takes_the_place_of_the_flown_one():
    mission = configured(short(), estimator="wavg", gyro=False)
    assert [node.name for node in mission.nodes] == ["dynamics", "css_array", "gyro", "wavg", "mrp_control"]
    assert mission.values.graph.estimator == "wavg"
    assert mission.node("wavg").values.use_gyro is False
    with pytest.raises(MissionError, match="ekff"):
        configured(short(), estimator="ekff")


def test_an_estimator_without_a_gyro_flies_with_it_on_alone():
    mission = load_mission("esprit_2006")
    assert configured(mission, estimator="triad").text() == mission.text()
    with pytest.raises(MissionError, match=r"gyro off given, but triad uses no gyro; expected gyro on"):
        configured(mission, estimator="triad", gyro=False)


def test_a_mission_without_control_tumbles_on():
    nodes = ["css_sim/dynamics", "css_sim/css_array", "css_sim/gyro", "css_estimation/ekf"]
    log = fly_directly(short(f"graph.nodes={','.join(nodes)}"))
    assert log.control is None and log.flown is None
    body = load_mission("okeefe_2013").values.spacecraft.inertia
    momentum = np.linalg.norm(present(log.truth).omega_bn_b @ body, axis=1)
    assert np.ptp(momentum) < 0.01 * momentum[0]


def test_scripted_changes_come_when_they_are_due():
    text = """
/**:
  ros__parameters:
    extends: okeefe_2013
    mission: {duration: 20.0}
    events:
      off: {time: 5.0, node: gyro, action: deactivate}
      on: {time: 10.0, node: gyro, action: activate}
      slow: {time: 15.0, node: ekf, action: set, parameter: use_gyro, value: false}
"""
    log = fly_directly(mission_from_text(text, "scripted"))
    source = log.estimates["ekf"].rate_source
    time = log.time(log.estimates["ekf"])
    expected = ((time < 5.0) | (time >= 10.0)) & (time < 15.0)
    np.testing.assert_array_equal(source == SunEstimate.RATE_GYRO, expected)


def test_the_log_equals_the_one_of_a_recording(tmp_path):
    log = fly_directly(short())
    topics = {"/truth": log.truth, "/ekf/sun_estimate": log.estimates["ekf"], "/control/status": log.control}
    kinds = {f"/{topic}": kind for topic, kind in present(log.mission).topics.items()}
    folder = record(
        tmp_path / "flight",
        {topic: (kinds[topic], present(columns)) for topic, columns in topics.items()},
        present(log.mission).text(),
    )
    again = read_flight(folder)
    assert estimator_runs(again) == estimator_runs(log)


def test_missions_that_cannot_fly_are_refused():
    with pytest.raises(MissionError, match="nothing can fly"):
        fly_directly(mission_from_text("/**: {ros__parameters: {graph: {nodes: []}}}", "no plant"))
