# SPDX-License-Identifier: Apache-2.0
"""All kinds of faults in one flight: the same bytes however it flies, told in its recording and in its last lines."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from faults import FLOWN, every_kind
from flights import fly_composed, messages_by_topic
from listing import ROOT

from css_analysis.fault_record import FaultRecord, fault_texts
from css_analysis.flight_log import read_flight
from css_bringup.replay_bag import mission_of_bag, replay
from css_bringup.replay_pass import parse_request
from css_bringup.verbs.fly import conclude
from css_common.case_faults import NEVER
from css_common.codec import codec_of
from css_common.mission import Mission, MissionError, load_mission, mission_from_text
from css_common.preflight import preflight
from css_monte_carlo.chunk import fly_cases
from css_monte_carlo.direct_flight import fly_and_keep, fly_directly
from css_monte_carlo.mission_flight import MissionFlight

CASE = 4
DURATION = 20.0
HEAD = """
/**:
  ros__parameters:
    extends: okeefe_2013
    mission: {duration: %r, case: 4}
    graph:
      nodes: [css_sim/dynamics, css_sim/css_array, css_sim/gyro, css_sim/magnetometer, css_estimation/ekf,
              sunpoint_control/mrp_control]
    magnetometer: {divider: 3}
    rods: {fitted: true}
"""
TAIL = """
mrp_control: {ros__parameters: {dumping: {enabled: true}}}
dynamics: {ros__parameters: {initial: {wheel_speed_rpm: [100.0]}}}
css_array: {ros__parameters: {noise: 0.01}}
"""


def mission_with(faults: str, *overrides: str, duration: float = DURATION) -> Mission:
    return mission_from_text(HEAD % duration + faults + TAIL, "faults.yaml", overrides)


def entry(text: str) -> str:
    return f"    faults:\n      one: {{{text}}}\n"


@pytest.fixture(scope="module")
def mission():
    return mission_with(every_kind(DURATION))


@pytest.fixture(scope="module")
def flown(mission, tmp_path_factory) -> Path:
    bag = tmp_path_factory.mktemp("faults") / "bag"
    result = fly_composed(mission, bag)
    assert result.failure == "" and result.notes == []
    return bag


def trace_of(log):
    estimate = log.estimates["ekf"]
    return np.hstack(
        [log.truth.sigma_bn, log.truth.omega_bn_b, estimate.sun_b, estimate.omega_bn_b, log.rod_command.dipole,
         log.torque_command.torque, log.wheels.speed]
    )  # fmt: skip


def test_the_graph_and_the_direct_flight_have_the_same_bytes(mission, flown):
    recorded = messages_by_topic(flown)
    kept = fly_and_keep(mission, mission.topics)
    assert {f"/{topic}" for topic in kept} <= recorded.keys()
    for topic, samples in kept.items():
        encode = codec_of(mission.topics[topic]).encode
        assert [(s.stamp_ns, encode(s)) for s in samples] == recorded[f"/{topic}"], topic


def test_the_compiled_loop_flies_the_same(mission, flown):
    trace = fly_cases(MissionFlight(mission), np.array([1, CASE]), 10, traced=True).trace
    np.testing.assert_array_equal(trace[1], trace_of(read_flight(flown)))
    other = fly_directly(mission.with_overrides(["mission.case=1"]))
    np.testing.assert_array_equal(trace[0], trace_of(other))


def test_the_estimator_gives_the_bytes_that_flew(flown, tmp_path):
    recorded = mission_of_bag(flown, {}, [], None)
    result = replay(flown, tmp_path / "replay", recorded, [parse_request("ekf")], {})
    comparison = result.replayed[0].comparison
    assert comparison is not None and comparison.compared == 200 and comparison.identical


def test_each_fault_is_told_from_its_begin_to_its_end(mission, flown):
    log = read_flight(flown)
    assert len(mission.faults) == len(FLOWN)
    told = {(f.target, f.kind, round(f.begin_s, 6)): f for f in log.faults}
    for said in mission.faults:
        target, kind, *words = said.line.split()
        kind = "stuck" if kind == "stuck_random" else kind
        begin, end = (float(words[words.index(word) + 1]) for word in ("from", "to"))
        first = round(np.ceil(begin / 0.1 - 1e-6) * 0.1, 6)
        names = [target] if not target.endswith(".all") else [f"{target[:-3]}{axis}" for axis in "xyz"]
        for name in names:
            record = told.pop((name, kind, first))
            assert record.end_s == pytest.approx(np.ceil(end / 0.1 - 1e-6) * 0.1)
            if "stuck_random" not in said.line:
                values = [float(word) for word in words[: words.index("from")]]
                assert [value for value, _ in record.values.values()] == values
    assert told == {}
    directly = fly_directly(mission)
    assert log.faults == directly.faults
    assert log.health == directly.health


def test_a_switched_sensor_forgets_where_it_froze_and_other_changes_do_not():
    text = entry("time: 2.0, target: gyro.x, kind: frozen") + (
        "      two: {time: 1.0, target: magnetometer.y, kind: frozen}\n"
        "      three: {time: 3.0, target: cell.all, kind: frozen}\n"
        "    events:\n"
        "      off: {time: 4.0, node: gyro, action: deactivate}\n"
        "      on: {time: 5.0, node: gyro, action: activate}\n"
        "      change: {time: 6.0, node: mrp_control, action: set, parameter: gains.k, value: 0.2}\n"
    )
    mission = mission_with(text, duration=8.0)
    imu = [s.angular_velocity[0] for s in fly_and_keep(mission, ["gyro/imu"])["gyro/imu"]]
    assert len(set(imu[20:40])) == len(set(imu[50:])) == 1 and imu[20] != imu[50] and len(set(imu[:20])) == 20
    cells = np.array([s.voltages for s in fly_and_keep(mission, ["css/voltages"])["css/voltages"]])
    assert np.all(cells[30:] == cells[30]) and np.any(cells[29] != cells[30])
    trace = fly_cases(MissionFlight(mission), np.array([CASE]), 10, traced=True).trace[0]
    np.testing.assert_array_equal(trace, trace_of(fly_directly(mission)))


def test_cases_of_a_study_draw_their_own_faults():
    text = entry("time: 1.0, within: 5.0, target: wheel.any, kind: dead, probability: 0.5")
    mission = mission_with(text, duration=8.0)
    flight = MissionFlight(mission)
    cases, _ = flight.cases(np.arange(40))
    rows = cases.faults[:, 0]
    acting = rows["first_step"] < NEVER
    assert 8 < np.count_nonzero(acting) < 32
    assert set(rows["unit"][acting]) == {0, 1, 2, 3}
    assert np.all((rows["first_step"][acting] >= 10) & (rows["first_step"][acting] <= 60))
    case = int(np.flatnonzero(acting)[0])
    alone = fly_directly(mission.with_overrides([f"mission.case={case}"]))
    (record,) = alone.faults
    assert record.target == f"wheel.{rows['unit'][case]}"
    assert record.begin_s == pytest.approx(rows["first_step"][case] * 0.1)
    trace = fly_cases(flight, np.array([case]), 10, traced=True).trace[0]
    np.testing.assert_array_equal(trace, trace_of(alone))


def test_an_entry_is_changed_by_its_keys():
    mission = mission_with(entry("time: 1.0, target: cell.2, kind: stuck, level: 0.5"))
    changed = mission.with_overrides(["faults.one.level=0.75", "faults.one.target=cell.3", "faults.one.end=9"])
    assert changed.node("css_array").values.faults == ["cell.3 stuck 0.75 from 1 to 9"]
    assert mission_from_text(changed.text(), "again").faults == changed.faults
    with pytest.raises(MissionError, match=r"faults\.one\.levle"):
        mission.with_overrides(["faults.one.levle=1"])


WRONG = {
    "time: 1.0, kind: dead": "one.target: missing",
    "time: 1.0, target: cell.2": "one.kind: missing",
    "time: 1.0, target: cell.8, kind: dead": "'cell.8': no such target, expected cell.0 to cell.7",
    "time: 1.0, target: star.0, kind: dead": "which does not fly; expected wheel.0 to wheel.3",
    "time: 1.0, target: ekf/cell.0, kind: dead": "which does not fly",
    "time: 1.0, target: cell.1, kind: deaf": "one.kind: 'deaf': no fault of a cell; did you mean dead?",
    "time: 1.0, target: cell.1, kind: stuck": "one.level: missing, expected a number",
    "time: 1.0, target: cell.1, kind: stuck, level: 20.0": "one.level: 20.0 given, expected at least -10",
    "time: 1.0, target: cell.1, kind: dead, level: 0.5": "one.level: unknown, expected target, kind, time",
    "time: 1, target: cell.1, kind: dead": "one.time: 1 given, expected a number written with a point",
    "time: -1.0, target: cell.1, kind: dead": "one.time: -1.0 given",
    "time: 5.0, end: 4.0, target: cell.1, kind: dead": "expected later than 5",
    "time: 5.0, probability: 1.1, target: cell.1, kind: dead": "one.probability: 1.1 given",
    "time: 5.0, target: cell.1, kind: swapped, other: 9.0": "expected a cell from 0 to 7",
}


@pytest.mark.parametrize("text", WRONG)
def test_wrong_entries_are_refused_with_what_would_be_right(text):
    with pytest.raises(MissionError) as error:
        mission_with(entry(text))
    assert str(error.value).startswith("faults.yaml: ") and "\n" not in str(error.value)
    assert WRONG[text] in str(error.value)


def test_a_fault_that_never_comes_is_named():
    (line,) = preflight(mission_with(entry("time: 500.0, target: cell.1, kind: dead")))
    assert line == "fault one at 500 s never comes, the last step is at 19.9 s"


def test_a_value_of_an_entry_has_the_bounds_of_what_fails():
    """A level of 20000 is one of a field in nT, and of no wheel in N m."""
    mission = mission_with(entry("time: 2.0, target: magnetometer.x, kind: stuck, level: 1.0"))
    (changed,) = mission.with_overrides(["faults.one.level=20000"]).faults
    assert changed.line.startswith("magnetometer.x stuck 20000 ")
    with pytest.raises(MissionError, match=r"faults.one.level: 2000000.0 given, expected at least -1e\+06 and at most"):
        mission.with_overrides(["faults.one.level=2e6"])


def test_the_faults_of_the_readme_are_valid():
    text = (ROOT / "src" / "css_sim" / "README.md").read_text()
    found = re.search(r"```yaml\n/\*\*:\n  ros__parameters:\n(    faults:\n.*?)```", text, re.S)
    assert found is not None
    assert len(mission_with(found[1]).faults) == 3


def test_one_line_for_units_that_fail_together():
    records = [
        FaultRecord("cell.4", "stuck", {"level": (0.5, "-")}, 1.0, 2.5),
        FaultRecord("cell.5", "stuck", {"level": (0.5, "-")}, 1.0, 2.5),
        FaultRecord("gyro.x", "bias", {"offset": (0.2, "deg/s")}, 3.0, None),
    ]
    assert fault_texts(records) == [
        "cell.4, cell.5 stuck, level 0.5, from 1 to 2.5 s",
        "gyro.x bias, offset 0.2 deg/s, from 3 s on",
    ]


def test_a_flight_names_its_faults_in_its_last_lines(tmp_path, capfd):
    text = entry("time: 0.5, target: cell.2, kind: stuck, level: 0.7")
    text += "    events:\n      more: {time: 1.0, node: gyro, action: set, parameter: faults, value: [gyro.all dead]}\n"
    mission = mission_with(text, duration=2.0)
    result = fly_composed(mission, tmp_path / "bag")
    conclude(mission, result, as_json=True)
    output = capfd.readouterr().out
    assert "fault: cell.2 stuck, level 0.7, from 0.5 s on" in output
    faults = json.loads(output.strip().splitlines()[-1])["faults"]
    assert faults[0] == "cell.2 stuck, level 0.7, from 0.5 s on"
    assert len(faults) == 2 and faults[1].startswith("gyro: gyro.all dead; set in flight at about ")


def test_a_flight_without_faults_tells_none():
    mission = load_mission("okeefe_2013")
    assert not any("faults" in topic for topic in mission.topics)
