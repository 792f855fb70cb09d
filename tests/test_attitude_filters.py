# SPDX-License-Identifier: Apache-2.0
"""Two attitude filters side by side on real topics, and again from the recording."""

import pytest
from flights import fly_composed, messages_by_topic
from presence import present

from css_analysis.estimator_runs import estimator_runs
from css_analysis.flight_figures import write_figures
from css_bringup.replay_bag import mission_of_bag, replay
from css_bringup.replay_pass import parse_request
from css_bringup.report import unmet
from css_common.mission import load_mission
from css_monte_carlo.direct_flight import fly_directly

NAMES = ("attitude_vector", "attitude_voltage")


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    bag = tmp_path_factory.mktemp("flight") / "bag"
    mission = load_mission("cubesat_vmm", ["mission.duration=420"])
    return fly_composed(mission, bag), bag


def test_both_filters_fly_on_one_graph(flight, tmp_path):
    result, bag = flight
    assert result.messages_lost == 0 and not result.failure
    messages = messages_by_topic(bag)
    assert "/wheels/state" not in messages
    assert {len(messages[f"/{name}/attitude"]) for name in NAMES} == {420}
    directly = fly_directly(result.mission)
    runs = estimator_runs(directly)
    assert [run["estimator"] for run in runs] == list(NAMES)
    assert all(run["attitude_error_mean_deg"] < 1.0 and not run["flown"] for run in runs)
    assert not unmet(result, runs)
    names = {file.name for file in write_figures(directly, tmp_path / "figures")}
    assert "attitude_error.png" in names and "heading_error.png" not in names


def test_a_replay_gives_the_bytes_that_flew_and_the_same_errors(flight, tmp_path):
    result, bag = flight
    mission = mission_of_bag(bag, {}, [], None)
    changed = ("attitude_voltage:gyro=off", "attitude_voltage:cells_used=lit")
    requests = [parse_request(text) for text in (*NAMES, *changed)]
    again = replay(bag, tmp_path / "replay", mission, requests, {})
    assert all(present(run.comparison).identical for run in again.replayed[:2])
    assert again.replayed[2].comparison is None and again.messages == 4 * 420
    directly = {run["estimator"]: run for run in estimator_runs(fly_directly(result.mission))}
    for run in again.runs[:2]:
        expected = directly[run["estimator"]]
        assert run["attitude_error_mean_deg"] == pytest.approx(expected["attitude_error_mean_deg"], rel=1e-12)
    assert again.runs[2]["gyro"] == "off"
    assert again.runs[3]["attitude_error_mean_deg"] < 1.0
