# SPDX-License-Identifier: Apache-2.0
"""Messages that are lost, late, doubled or damaged, clocks that step and processes that die, in whole flights."""

from pathlib import Path

import numpy as np
import pytest
from flights import fly_composed, messages_by_topic
from presence import present

from css_analysis.flight_log import read_flight
from css_analysis.spin_flight import read_spinning
from css_bringup.commands import fly
from css_bringup.composed import ComposedFlight
from css_bringup.processes import fly_processes
from css_bringup.replay_bag import mission_of_bag, replay
from css_bringup.replay_pass import parse_request
from css_common import link_kinds
from css_common.link import is_gap
from css_common.mission import Mission, MissionError, load_mission, mission_from_text
from css_monte_carlo.direct_flight import fly_directly
from css_monte_carlo.study import Configuration, run_study

HEAD = """
/**:
  ros__parameters:
    extends: okeefe_2013
    mission: {duration: %r, case: 4}
    faults:
"""
ALL = """
      lost: {time: 1.0, end: 3.0, target: message.css/voltages, kind: dropped, share: 0.4}
      slow_bus: {time: 4.0, end: 6.0, target: message.gyro/imu, kind: late, cycles: 3.0}
      echo: {time: 5.0, end: 7.0, target: message.ekf/sun_estimate, kind: doubled, share: 0.5}
      swap: {time: 8.0, end: 10.0, target: message.css/voltages, kind: reordered, share: 0.5}
      damage: {time: 11.0, end: 13.0, target: message.gyro/imu, kind: corrupted, share: 0.5}
      no_command: {time: 13.0, end: 14.0, target: message.wheels/torque_command, kind: dropped, share: 1.0}
      ahead: {time: 15.0, end: 16.0, target: clock.gyro, kind: step, offset: 0.4}
      behind: {time: 17.0, end: 18.0, target: clock.css_array, kind: step, offset: -0.4}
      far: {time: 19.0, end: 20.0, target: clock.gyro, kind: step, offset: 500.0}
"""


def mission_with(faults: str, duration: float = 24.0) -> Mission:
    return mission_from_text(HEAD % duration + faults, "links.yaml")


@pytest.fixture(scope="module")
def flown(tmp_path_factory) -> Path:
    bag = tmp_path_factory.mktemp("links") / "bag"
    result = fly_composed(mission_with(ALL), bag)
    assert result.failure == "" and result.steps == 240
    text = "\n".join(result.notes)
    assert "ekf: 10 messages of gyro refused (stamp_back)" not in text
    assert "time held" not in text and "silent beyond" not in text  # nobody has waited for what never came
    assert "messages of cells refused (stamp_back)" in text
    return bag


def test_a_flight_is_the_same_in_processes(flown, tmp_path):
    result = fly_processes(mission_with(ALL), tmp_path / "bag", tmp_path / "logs")
    assert result.failure == ""
    expected, found = messages_by_topic(flown), messages_by_topic(tmp_path / "bag")
    for topic in mission_with(ALL).topics:
        # a topic of events has nothing on it where nothing happens
        assert found.get(f"/{topic}") == expected.get(f"/{topic}"), topic


def test_the_estimator_gives_the_bytes_that_flew(flown, tmp_path):
    recorded = mission_of_bag(flown, {}, [], None)
    result = replay(flown, tmp_path / "replay", recorded, [parse_request("ekf")], {})
    comparison = result.replayed[0].comparison
    assert comparison is not None and comparison.compared == 240 and comparison.unmatched == 0
    # arrival of messages with the time of another day is not in a recording, whose order is that of stamps
    begin = mission_with(ALL).epoch_ns + 19 * 10**9
    assert min(comparison.different, default=begin) >= begin


def test_each_fault_is_told(flown):
    told = [record.text() for record in read_flight(flown).faults]
    assert sorted(told) == sorted(
        [
            "message.css/voltages dropped, share 0.4, from 1 to 3 s",
            "message.gyro/imu late, cycles 3, from 4 to 6 s",
            "message.ekf/sun_estimate doubled, share 0.5, from 5 to 7 s",
            "message.css/voltages reordered, share 0.5, from 8 to 10 s",
            "message.gyro/imu corrupted, share 0.5, from 11 to 13 s",
            "message.wheels/torque_command dropped, share 1, from 13 to 14 s",
            "clock.gyro step, offset 0.4 s, from 15 to 16 s",
            "clock.css_array step, offset -0.4 s, from 17 to 18 s",
            "clock.gyro step, offset 500 s, from 19 to 20 s",
        ]
    )


def gaps(bag: Path, topic: str) -> list[int]:
    """Cycles for which a topic has a gap."""
    first = messages_by_topic(bag)["/truth"][0][0]
    return [round((stamp - first) / 1e8) for stamp, data in messages_by_topic(bag)[topic] if is_gap(data)]


def test_without_a_voltage_there_is_no_estimate_no_command_and_the_wheels_rest(tmp_path):
    bag = tmp_path / "bag"
    fly_composed(
        mission_with("      a: {time: 1.0, end: 2.0, target: message.css/voltages, kind: dropped, share: 0.5}"), bag
    )
    lost = gaps(bag, "/css/voltages")
    assert lost and set(lost) < set(range(10, 20))
    assert gaps(bag, "/ekf/sun_estimate") == gaps(bag, "/wheels/torque_command") == lost
    log = read_flight(bag)
    # the torque of the step that ended at a stamp
    rests = np.flatnonzero(np.all(present(log.wheels).torque[1:] == 0.0, axis=1))
    assert rests.tolist() == lost
    assert len(log.estimates["ekf"]) == 240 - len(lost)


def test_a_lost_command_is_a_torque_of_zero(tmp_path):
    line = "      a: {time: 1.0, end: 2.0, target: message.wheels/torque_command, kind: dropped, share: 1.0}"
    fly_composed(mission_with(line, 4.0), tmp_path / "bag")
    torque = present(read_flight(tmp_path / "bag").wheels).torque
    assert np.all(torque[11:21] == 0.0) and np.all(np.any(torque[1:11] != 0.0, axis=1))


def test_a_message_that_comes_twice_changes_nothing(tmp_path):
    line = "      a: {time: 1.0, target: message.css/voltages, kind: doubled, share: 1.0}"
    fly_composed(mission_with(line, 4.0), tmp_path / "doubled")
    fly_composed(mission_from_text((HEAD % 4.0).replace("    faults:\n", ""), "x"), tmp_path / "plain")
    found, expected = messages_by_topic(tmp_path / "doubled"), messages_by_topic(tmp_path / "plain")
    assert len(found["/css/voltages"]) == 40 + 30
    assert found["/truth"] == expected["/truth"] and found["/ekf/sun_estimate"] == expected["/ekf/sun_estimate"]


WRONG = {
    "target: message.css/voltage, kind: dropped, share: 0.5": "'message.css/voltage' given, which does not fly",
    "target: message.truth, kind: dropped, share: 0.5": "which does not fly; expected message.wheels/state",
    "target: clock.dynamics, kind: step, offset: 1.0": "expected clock.css_array, clock.gyro",
    "target: process.ekff, kind: killed": "which does not fly; expected process.dynamics, process.css_array",
    "target: message.css/voltages, kind: deaf": "no fault of a message, expected late, dropped, doubled",
    "target: message.css/voltages, kind: dropped, share: 1.5": "one.share: 1.5 given",
    "target: process.ekf, kind: frozen, seconds: 0.0": "one.seconds: 0.0 given",
}


@pytest.mark.parametrize("text", WRONG)
def test_wrong_entries_are_refused_with_what_would_be_right(text):
    with pytest.raises(MissionError) as error:
        mission_with(f"      one: {{time: 1.0, {text}}}")
    assert str(error.value).startswith("links.yaml: ") and "\n" not in str(error.value)
    assert WRONG[text] in str(error.value)


NEEDS_A_GRAPH = {
    "message": "target: message.css/voltages, kind: dropped, share: 0.5",
    "clock": "target: clock.gyro, kind: step, offset: 1.0",
    "process": "target: process.ekf, kind: killed",
}


@pytest.mark.parametrize("sort", NEEDS_A_GRAPH)
def test_what_only_the_graph_has_is_refused_elsewhere(sort, tmp_path):
    mission = mission_with(f"      one: {{time: 1.0, {NEEDS_A_GRAPH[sort]}}}", 2.0)
    for way in (
        lambda: fly_directly(mission),
        lambda: run_study(mission, [Configuration("ekf", True)], 2, tmp_path / "study"),
    ):
        with pytest.raises(MissionError, match=rf"faults\.one: '{sort}\..*the graph alone.*expected \./sunpoint fly"):
            way()
    if sort == "process":
        with pytest.raises(MissionError, match=r"faults\.one: 'process\.ekf killed from 1' needs .*fly --processes"):
            ComposedFlight(mission)


def test_a_study_of_a_node_s_own_lines_is_refused_too(tmp_path):
    text = (HEAD % 2.0).replace("    faults:\n", "") + "gyro: {ros__parameters: {io: {faults: [clock.gyro step 1]}}}"
    with pytest.raises(MissionError, match=r"gyro: io\.faults: 'clock\.gyro step 1' flies on the graph alone"):
        run_study(mission_from_text(text, "x.yaml"), [Configuration("ekf", True)], 2, tmp_path / "study")


def test_an_event_that_sets_them_is_refused_too():
    text = (HEAD % 2.0).replace(
        "faults:", "events: {a: {time: 1.0, node: gyro, action: set, parameter: io.faults, value: [clock.gyro step 1]}}"
    )
    with pytest.raises(MissionError, match=r"events\.a: 'clock\.gyro step 1' flies on the graph alone"):
        fly_directly(mission_from_text(text, "x.yaml"))


def test_the_command_says_so_and_ends_with_2(tmp_path, capfd):
    path = tmp_path / "mission.yaml"
    path.write_text(HEAD % 2.0 + f"      one: {{time: 1.0, {NEEDS_A_GRAPH['process']}}}\n")
    assert fly.main([str(path), "--no-record"]) == 2
    assert "expected ./sunpoint fly --processes" in " ".join(capfd.readouterr().err.split())


def test_processes_die_hang_and_are_slow_at_their_time(tmp_path):
    """A sensor has no memory: started again, it says what it would have said."""
    bag = tmp_path / "bag"
    mission = mission_with(
        "      dies: {time: 2.0, target: process.css_array, kind: killed}\n"
        "      again: {time: 6.0, target: process.css_array, kind: killed}\n"
        "      hangs: {time: 3.0, target: process.gyro, kind: frozen, seconds: 0.3}\n"
        "      crawls: {time: 4.0, end: 5.0, target: process.ekf, kind: slow, seconds: 0.01}\n",
        8.0,
    )
    result = fly_processes(mission, bag, tmp_path / "logs")
    assert result.failure == ""
    killed = [note for note in result.notes if "died" in note]
    assert killed == [
        f"css_array died (SIGKILL), as its fault 'process.css_array killed from {time}' says, and was restarted"
        for time in (2, 6)
    ]
    fly_composed(mission_from_text((HEAD % 8.0).replace("    faults:\n", ""), "x"), tmp_path / "plain")
    found, expected = messages_by_topic(bag), messages_by_topic(tmp_path / "plain")
    for topic in ("/truth", "/ekf/sun_estimate", "/wheels/torque_command", "/css/voltages"):
        assert found[topic] == expected[topic], topic
    told = {(f.target, f.kind, f.begin_s) for f in read_flight(bag).faults}
    assert told == {
        ("process.css_array", "killed", 2.0), ("process.css_array", "killed", 6.0),
        ("process.gyro", "frozen", 3.0), ("process.ekf", "slow", 4.0),
    }  # fmt: skip


def test_all_kinds_fly_here():
    said = ALL + "killed, frozen, slow"
    assert all(kind.name in said for kind in link_kinds.KINDS)


def test_gaps_are_no_pulses_to_those_who_read_a_spinning_flight(tmp_path):
    entry = "faults.a.target=message.slits/step"
    lost = [entry, "faults.a.kind=dropped", "faults.a.share=0.2", "faults.a.time=2"]
    mission = load_mission("esprit_2006", ["mission.duration=20", *lost])
    result = fly_composed(mission, tmp_path / "bag")
    assert result.failure == ""
    assert len(gaps(tmp_path / "bag", "/slits/step")) > 100
    flight = present(read_spinning(tmp_path / "bag"))
    assert all(sample.frame_id == "bus" for sample in (*flight.attitudes, *flight.coning.values()))
