# SPDX-License-Identifier: Apache-2.0
"""What people type: estimator requests, missions, options; and what they get when it is wrong."""

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import pytest
from presence import present

from css_analysis.flight_log import read_flight
from css_analysis.quantities import QUANTITIES
from css_bringup import options
from css_bringup.commands import demo, fly
from css_bringup.commands import replay as replay_command
from css_bringup.flight_result import FlightResult, default_bag
from css_bringup.mission_asked_for import mission_of
from css_bringup.processes import Child, Supervisor
from css_bringup.replay_pass import parse_request
from css_bringup.replayed import replayed
from css_bringup.report import flight_object
from css_bringup.verbs import fly as fly_verb
from css_common.command import FAILED, INTERRUPTED, USAGE
from css_common.mission import load_mission
from css_common.mission_file import MissionError
from css_common.preflight import preflight

ROOT = Path(__file__).parents[3]
WITHOUT_ESTIMATOR = "css_sim/dynamics,css_sim/css_array,sunpoint_control/mrp_control"


def test_requests_name_estimator_and_changes():
    request = parse_request("ekf:gyro=off,sigma_voltage=0.2")
    assert request.kind == "ekf"
    assert request.changes == {"use_gyro": "false", "sigma_voltage": "0.2"}
    assert request.label == "ekf_gyro_off_sigma_voltage_0_2"
    assert parse_request("wavg").label == "wavg"


@pytest.mark.parametrize("text", ["", "a b", "ekf:gyro", "ekf:gyro=perhaps", "../ekf"])
def test_requests_of_another_form_are_refused(text):
    with pytest.raises(MissionError):
        parse_request(text)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["no_such_mission"], "no_such_mission"),
        (["okeefe_2013", "--set", "cells.field_of_vew_deg=100"], "did you mean cells.field_of_view_deg?"),
        (["okeefe_2013", "--set", "cells.field_of_view_deg=190"], "at least 1 and at most 180 [deg]"),
        (["[/red]"], "[/red]: no such mission file"),
        (["okeefe_2013", "--set", "spacecraft.inertia=1,0,0,0,1,0,0,0,9"], "triangle inequality"),
        (["okeefe_2013", "--set", "wheels.axes=1,0,0,0,1,0,0,1,0"], "span 2 of 3"),
        (["okeefe_2013", "--duration", "-5"], "above 0"),
        (["okeefe_2013", "--set", "nonsense"], "KEY=VALUE"),
        (["okeefe_2013", "--set", f"graph.nodes={WITHOUT_ESTIMATOR}"], "needs the topic"),
        (["okeefe_2013", "--set", "graph.nodes=css_sim/dynamo"], "no css_sim/nodes/dynamo.py"),
        (["okeefe_2013", "--set", "ekf.gate=-1"], "override ekf.gate: -1.0 given"),
        (["okeefe_2013", "--set", "orbit.eccentricity=0.5"], "puts the perigee at -2989 km; expected at most 0.0442"),
    ],
)
@pytest.mark.parametrize("command", [fly, demo])
def test_a_wrong_mission_is_one_line_and_exit_code_2(command, arguments, said, capfd):
    assert command.main(arguments) == USAGE
    printed = capfd.readouterr().err
    assert said in " ".join(printed.split())
    assert "Traceback" not in printed


CRITERION = "    criteria: {pointing_error_mean: {max: 5.0}}\n"
EVENT = "    events: {off: {time: 2.0, node: gyro, action: deactivate}}\n"


def _mission_file(folder: Path, line: str) -> Path:
    file = folder / "mission.yaml"
    file.write_text(f"/**:\n  ros__parameters:\n    extends: okeefe_2013\n{line}")
    return file


def _mission_of(file: Path, *arguments: str):
    parser = argparse.ArgumentParser()
    options.add_mission_options(parser)
    return mission_of(parser.parse_args([str(file), *arguments]))


def test_a_criterion_that_nobody_measures_is_refused_before_the_flight(tmp_path, capfd):
    assert fly.main([str(_mission_file(tmp_path, CRITERION))]) == USAGE
    said = "criteria.pointing_error_mean: unknown; did you mean pointing_error_mean_deg?"
    assert said in " ".join(capfd.readouterr().err.split())


def test_every_measured_quantity_may_be_a_criterion(tmp_path):
    limits = ", ".join(f"{quantity}: {{max: 5.0}}" for quantity in QUANTITIES)
    measures = "    measures: {late_time: 300.0, detumbled_rate_deg_s: 0.5}\n"
    mission = _mission_of(_mission_file(tmp_path, f"{measures}    criteria: {{{limits}}}\n"))
    assert set(mission.criteria) == set(QUANTITIES)


@pytest.mark.parametrize(
    ("quantity", "needs"),
    [
        ("power_positive_late", "measures.late_time and measures.detumbled_rate_deg_s"),
        ("detumbled_s", "measures.detumbled_rate_deg_s"),
    ],
)
def test_a_criterion_of_what_the_mission_does_not_measure_is_refused_before_the_flight(
    tmp_path, capfd, quantity, needs
):
    measures = "    measures: {late_time: 0.0, detumbled_rate_deg_s: 0.0}\n"
    file = _mission_file(tmp_path, f"{measures}    criteria: {{{quantity}: {{max: 1.0}}}}\n")
    assert fly.main([str(file)]) == USAGE
    assert f"criteria.{quantity}: measured only with {needs} above 0" in " ".join(capfd.readouterr().err.split())


@pytest.mark.parametrize(("duration", "warned"), [("2.0", True), ("2.1", False)])
def test_an_event_after_the_last_step_is_named(tmp_path, duration, warned):
    mission = _mission_of(_mission_file(tmp_path, EVENT), "--duration", duration)
    assert [event.name for event in mission.events] == ["off"]
    said = ["event off at 2 s never comes, the last step is at 1.9 s"] if warned else []
    assert preflight(mission) == said


@pytest.mark.parametrize("text", ["", "# nothing yet\n", "{}", "/**: {ros__parameters: {}}"])
def test_a_file_without_parameters_is_no_mission(tmp_path, capfd, text):
    (tmp_path / "empty.yaml").write_text(text)
    assert fly.main([str(tmp_path / "empty.yaml")]) == USAGE
    assert "empty.yaml: holds no parameters" in capfd.readouterr().err


def test_a_recording_is_replaced_only_when_asked_for(tmp_path, capfd):
    arguments = ["okeefe_2013", "--out", str(tmp_path / "bag"), "--duration"]
    assert fly.main([*arguments, "1"]) != USAGE
    assert fly.main([*arguments, "2"]) == USAGE
    assert "--overwrite" in capfd.readouterr().err
    assert present(read_flight(tmp_path / "bag").truth).stamp_ns.size == 10
    assert fly.main([*arguments, "2", "--overwrite"]) != USAGE
    assert present(read_flight(tmp_path / "bag").truth).stamp_ns.size == 20


def test_the_recorder_of_processes_replaces_only_when_asked_for(tmp_path):
    mission = load_mission("okeefe_2013")
    for overwrite in (False, True):
        supervisor = Supervisor(mission, tmp_path / "bag", tmp_path / "logs", overwrite=overwrite)
        assert ("--overwrite" in present(supervisor.recorder).command) == overwrite
        supervisor.clean()


def test_a_log_begins_with_its_flight_and_goes_on_after_a_restart(tmp_path):
    log = tmp_path / "node.log"
    log.write_text("of an earlier flight\n")
    child = Child("node", [sys.executable, "-c", "print('started')"], log)
    for starts in (1, 2):
        child.start()
        present(child.process).wait()
        child.stop(0.0)
        assert log.read_text() == "started\n" * starts


@pytest.mark.parametrize("text", ["/a", "/a:/b", "/a=/b", ":=/b", "/a:=", ":=", ""])
def test_a_remapping_of_another_form_is_one_line(text, capfd):
    assert replay_command.main(["nothing", "--remap", "/x:=/y", text]) == USAGE
    printed = capfd.readouterr().err
    assert f"--remap {text!r}: expected OLD:=NEW" in printed and printed.count("\n") == 1


def test_a_missing_recording_is_one_line_and_exit_code_2(tmp_path, capfd):
    assert replay_command.main([str(tmp_path / "nothing")]) == USAGE
    assert "nothing" in capfd.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_an_unwritable_folder_is_one_line(tmp_path, capfd):
    blocked = tmp_path / "file"
    blocked.write_text("not a folder")
    assert fly.main(["okeefe_2013", "--duration", "1", "--out", str(blocked / "bag")]) == USAGE
    assert "Traceback" not in capfd.readouterr().err


def test_unwritable_figures_are_one_line(tmp_path, capfd):
    blocked = tmp_path / "file"
    blocked.write_text("not a folder")
    reference = str(ROOT / "bags" / "reference")
    code = replay_command.main([reference, "--out", str(tmp_path / "bag"), "--figures", str(blocked / "figures")])
    assert code == USAGE
    printed = capfd.readouterr().err
    assert "figures cannot be written" in printed and "Traceback" not in printed


def test_recordings_never_share_a_folder(tmp_path):
    mission = load_mission("okeefe_2013")
    first = default_bag(mission, tmp_path)
    first.mkdir()
    second = default_bag(mission, tmp_path)
    assert second != first and not second.exists()


def test_result_counts_what_the_cycles_must_have_produced(tmp_path):
    mission = load_mission("okeefe_2013")
    full = {f"/{topic}": 100 for topic in mission.topics}
    result = FlightResult(mission, steps=100, simulated_s=10.0, wall_s=2.0, bag=tmp_path, recorded=full)
    assert result.messages_lost == 0
    assert result.realtime_factor == 5.0
    result.recorded = full | {"/css/voltages": 97}
    assert result.messages_lost == 3
    assert result.messages_recorded == 100 * len(full) - 3


def test_a_recorder_that_died_is_what_a_failed_flight_reports(tmp_path, capfd):
    (tmp_path / "flight_0.mcap").write_bytes(b"")
    mission = load_mission("okeefe_2013")
    result = FlightResult(mission, steps=100, bag=tmp_path, failure="recorder died (SIGKILL)")
    assert fly_verb.conclude(mission, result, as_json=True) == FAILED
    printed = capfd.readouterr()
    assert printed.err.splitlines() == ["the flight failed: recorder died (SIGKILL)"]
    assert json.loads(printed.out.splitlines()[-1])["runs"] == []


@pytest.mark.parametrize(
    ("came", "code", "said"),
    [
        ({}, 0, []),
        ({"interrupted": True}, INTERRUPTED, ["interrupted"]),
        ({"failure": "dynamics died"}, FAILED, ["the flight failed: dynamics died"]),
    ],
)
def test_what_came_of_a_flight_is_said_once_and_is_its_exit_code(came, code, said, capfd):
    mission = load_mission("okeefe_2013")
    assert fly_verb.conclude(mission, FlightResult(mission, **came), as_json=False) == code
    assert capfd.readouterr().err.splitlines() == said


def test_cycles_that_fail_in_a_replay_are_counted_and_the_first_is_reported():
    mission = load_mission("okeefe_2013")
    told: list[Any] = []
    run = replayed(parse_request("wavg"), mission, mission, [], frozenset())
    run.begin(told.append)
    assert [run.step(mission.epoch_ns + k, {}) for k in range(3)] == 3 * [[]]
    assert run.failures == 3 and run.messages == 0
    (line,) = told
    assert line.startswith("wavg: cycle failed: KeyError('cells')") and line.endswith("counted, not reported)")


def test_json_result_has_the_documented_keys(tmp_path):
    result = FlightResult(load_mission("okeefe_2013"), bag=tmp_path)
    assert list(json.loads(json.dumps(flight_object(result, [])))) == [
        "mission", "case", "seed", "simulated_s", "wall_s", "cpu_s", "realtime_factor",
        "messages_recorded", "messages_lost", "bag", "runs", "domain", "failure", "incidents", "warnings",
        "criteria",
    ]  # fmt: skip


def test_json_has_every_criterion_with_value_limit_and_verdict(tmp_path):
    run = dict.fromkeys(QUANTITIES) | {"estimator": "ekf", "gyro": "on", "flown": True, "heading_error_mean_deg": 1.75}
    result = FlightResult(load_mission("okeefe_2013"), bag=tmp_path)
    common = {"estimator": "ekf", "bound": "max"}
    assert json.loads(json.dumps(flight_object(result, [run])))["criteria"] == [
        {**common, "quantity": "heading_error_mean_deg", "value": 1.75, "limit": 2.4, "passed": True},
        {**common, "quantity": "power_positive_s", "value": None, "limit": 180.0, "passed": False},
    ]
