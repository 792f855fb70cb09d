# SPDX-License-Identifier: Apache-2.0
"""Faults that are injected into running nodes and cleared again, by services of the nodes."""

from collections import Counter

import numpy as np
import pytest
from rclpy.parameter import Parameter

from css_common import fault_lines
from css_common.codec import Sample, codec_of
from css_common.mission import load_mission
from css_common.schema import shaped_values
from css_common.testing import Bench
from css_msgs.msg import CssVoltages, Faults, SpacecraftState, WheelState
from css_msgs.srv import ClearFault, InjectFault

FLIGHT = ("mission.duration=2.0", "css_array.report_faults=true", "dynamics.report_faults=true")


def inject(bench, node, target, kind, values=(), duration=0.0):
    request = InjectFault.Request(target=target, kind=kind, values=list(values), duration=duration)
    return bench.request(InjectFault, f"{node}/inject_fault", request)


def clear(bench, node, fault=""):
    return bench.request(ClearFault, f"{node}/clear_fault", ClearFault.Request(fault=fault))


@pytest.fixture
def paused():
    """A flight that waits at its first stamp, for its estimator is missing."""
    mission = load_mission("okeefe_2013", FLIGHT)
    with Bench() as bench:
        nodes = {n.name: bench.host(n.component, mission, n.name) for n in mission.nodes if n.name != "ekf"}
        bench.until(lambda: nodes["css_array"].counters["cycles"] == 1, "the cells have answered the first stamp")
        yield bench, mission, nodes


def test_faults_of_a_flight_act_from_their_injection_on_and_are_told(paused):
    bench, mission, nodes = paused
    cells, told = bench.listen("css/voltages", CssVoltages), bench.listen("faults/css_array", Faults)
    wheels, wheels_told = bench.listen("wheels/state", WheelState), bench.listen("faults/dynamics", Faults)
    stuck = inject(bench, "css_array", "cell.1", "stuck", [0.77])
    assert (stuck.success, stuck.fault) == (True, "cell.1 stuck 0.77 from 0.1"), stuck.message
    dead = inject(bench, "dynamics", "wheel.2", "dead", duration=1.0)
    assert (dead.success, dead.fault) == (True, "wheel.2 dead to 1"), dead.message
    node = mission.node("ekf")
    bench.host(node.component, mission, "ekf")
    plant = nodes["dynamics"]
    bench.until(lambda: plant.done, "the flight ends")
    bench.until(lambda: len(cells) >= 19 and len(wheels_told) == 2, "all messages have come")
    assert all(message.voltages[1] == 0.77 for message in cells if message.stamp_ns > mission.epoch_ns)
    (first,) = told
    assert (first.stamp_ns, *first.unit, *first.kind) == (mission.epoch_ns + 10**8, 1, Faults.KIND_STUCK)
    assert first.rows.tolist() == [0.77, 0.0, 0.1, -1.0]
    dead = np.array([message.torque[2] == 0.0 for message in wheels])
    assert np.array_equal(dead, [message.stamp_ns - mission.epoch_ns <= 10**9 for message in wheels])
    assert [(m.stamp_ns - mission.epoch_ns, m.unit.tolist()) for m in wheels_told] == [(10**8, [2]), (10**9, [])]


def test_cleared_faults_are_gone(paused):
    bench, _, nodes = paused
    for cell in (1, 2, 3):
        assert inject(bench, "css_array", f"cell.{cell}", "dead").success
    assert list(clear(bench, "css_array", "cell.2").cleared) == ["cell.2 dead from 0.1"]
    assert nodes["css_array"].component.values.faults == ["cell.1 dead from 0.1", "cell.3 dead from 0.1"]
    assert list(clear(bench, "css_array", "cell.3 dead from 0.1").cleared) == ["cell.3 dead from 0.1"]
    assert list(clear(bench, "css_array").cleared) == ["cell.1 dead from 0.1"]
    assert nodes["css_array"].component.values.faults == []
    answer = clear(bench, "css_array", "cell.1")
    assert not answer.success and "expected none" in answer.message


def test_a_line_is_parsed_when_it_comes_and_not_with_every_one_that_follows(paused, monkeypatch):
    bench, _, nodes = paused
    parsed: Counter[str] = Counter()
    target_of = fault_lines._target

    def counted(word, units):
        parsed[word] += 1
        return target_of(word, units)

    monkeypatch.setattr(fault_lines, "_target", counted)
    targets = {"css_array": ("cell.any", "stuck", [0.5]), "gyro": ("clock.gyro", "step", [0.1])}
    for node, (target, kind, values) in targets.items():
        for duration in range(1, 31):
            assert inject(bench, node, target, kind, values, float(duration)).success
        assert 30 <= parsed[target] <= 4 * 30  # asked for, checked, drawn
    before = sum(parsed.values())
    for node, name, value in (("css_array", "noise", 0.02), ("gyro", "io.deadline", 0.7)):
        (result,) = nodes[node].set_parameters([Parameter(name, value=value)])
        assert result.successful, result.reason
    assert sum(parsed.values()) == before
    assert len(nodes["css_array"].component._failing.table) == len(nodes["gyro"].stepper.link.faults) == 30


@pytest.mark.parametrize(
    ("node", "target", "kind", "values", "duration", "expected"),
    [
        ("css_array", "cell.9", "dead", [], 0.0, "expected cell.0 to cell.7, cell.all or cell.any"),
        ("css_array", "cell.1", "stukc", [], 0.0, "did you mean stuck?"),
        ("css_array", "cell.1", "stuck", [], 0.0, "expected stuck with level"),
        ("css_array", "cell.1", "stuck", [float("nan")], 0.0, "expected a finite number"),
        ("css_array", "cell.1", "stuck", [11.0], 0.0, "at most 10"),
        ("css_array", "cell.1", "dead", [], -1.0, "duration: -1 given"),
        ("css_array", "cell.1 dead", "dead", [], 0.0, "expected one word"),
        ("css_array", "cell.1", "swapped", [8.0], 0.0, "expected a cell from 0 to 7"),
        ("gyro", "gyro.x", "silent", [], 0.0, "expected gyro.all"),
        ("dynamics", "rod.0", "dead", [], 0.0, "no such target"),
    ],
)
def test_what_is_wrong_is_said_and_changes_nothing(paused, node, target, kind, values, duration, expected):
    bench, _, nodes = paused
    answer = inject(bench, node, target, kind, values, duration)
    assert not answer.success
    assert expected in answer.message
    assert nodes[node].component.values.faults == []


def test_a_tachometer_cannot_fail_where_nobody_tells_the_true_speeds():
    mission = load_mission("okeefe_2013")
    with Bench() as bench:
        node = bench.host(mission.node("dynamics").component, mission, "dynamics")
        answer = inject(bench, "dynamics", "tachometer.0", "scaled", [1.1])
        assert not answer.success and "report_faults" in answer.message
        assert node.component.values.faults == []


def test_a_node_that_is_restarted_says_that_nothing_fails_any_more():
    mission = load_mission("okeefe_2013", FLIGHT)
    told = []
    for begin in (0, 3):
        array = mission.node("css_array")
        component = array.component("css_array", array.values)
        for step in range(begin, begin + 3):
            stamp_ns = component.epoch_ns + step * component.period_ns
            truth = codec_of(SpacecraftState).sample(stamp_ns, "eci", sun_n=np.array([0.0, 0.0, 1.0]))
            sample = component.cycle(stamp_ns, {"truth": truth}).get("faults")
            if sample is not None:
                assert isinstance(sample, Sample)
                told.append(sample.unit.tolist())
            if step == 1:
                component.tune(with_faults(array, ["cell.1 dead"]))
    assert told == [[1], []]


def with_faults(node, lines):
    """Values of a node with these faults."""
    table = node.component.table()
    return shaped_values(table, {**node.canonical, "faults": lines})
