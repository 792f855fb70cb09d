# SPDX-License-Identifier: Apache-2.0
"""Faults injected into a flight by service are lines with their times: a mission with these flies the same bytes."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from flights import fly_composed, messages_by_topic, operator_of, samples
from rclpy.client import Client
from test_faults_in_flight import CASE, mission_with, trace_of

from css_analysis.faults_flown import faults_flown
from css_analysis.flight_log import read_flight
from css_bringup.composed import ComposedFlight
from css_common.fault_lines import parse_line
from css_common.mission import Mission
from css_monte_carlo.chunk import fly_cases
from css_monte_carlo.mission_flight import MissionFlight
from css_msgs.msg import Faults
from css_msgs.srv import InjectFault

DURATION = 12.0
TELL = [f"{node}.report_faults=true" for node in ("css_array", "gyro", "magnetometer", "dynamics")]

# when it is asked for [s], node, target, kind, values, duration
OF_UNITS = [
    (1.0, "css_array", "cell.2", "stuck", [0.7], 0.0),
    (1.5, "gyro", "gyro.y", "bias", [0.4], 4.0),
    (2.0, "css_array", "cell.any", "noisy", [0.2], 3.0),
    (3.0, "dynamics", "wheel.1", "dead", [], 2.0),
    (4.0, "magnetometer", "magnetometer.all", "spikes", [4000.0, 0.3], 0.0),
    (5.0, "css_array", "cell.4-5", "frozen", [], 0.0),
    (6.0, "dynamics", "rod.0", "intermittent", [0.5, 0.5], 0.0),
]
OF_LINKS = [
    (1.0, "css_array", "message.css/voltages", "dropped", [0.4], 2.0),
    (4.0, "ekf", "message.ekf/sun_estimate", "corrupted", [0.5], 1.0),
    (6.0, "gyro", "clock.gyro", "step", [0.3], 1.0),
    (8.0, "mrp_control", "message.wheels/torque_command", "late", [2.0], 1.0),
]


def fly_with_requests(mission: Mission, bag: Path, asked: list[tuple]) -> list[str]:
    """Flies a mission with an operator who injects faults; the lines that the nodes answer."""
    waiting, answers = list(asked), []
    clients: dict[str, Client] = {}
    with ComposedFlight(mission, bag) as flight:

        def ask() -> None:
            elapsed = (flight.plant.stamp_ns - mission.epoch_ns) / 1e9
            while waiting and elapsed >= waiting[0][0]:
                _, node, target, kind, values, duration = waiting.pop(0)
                request = InjectFault.Request(target=target, kind=kind, values=values, duration=duration)
                answers.append(clients[node].call_async(request))

        with operator_of(flight, ask) as operator:
            for _, node, *_ in asked:
                clients[node] = operator.create_client(InjectFault, f"{node}/inject_fault")
            result = flight.fly()
        assert result.failure == "" and not waiting
    given = [answer.result() for answer in answers]
    assert all(answer.success for answer in given), [answer.message for answer in given]
    return [answer.fault for answer in given]


def entries(lines: list[str], mission: Mission) -> str:
    """The section of a mission with these lines."""
    text = "    faults:\n"
    for k, line in enumerate(lines):
        sort = line.partition(".")[0]
        host = next(n.host for n in mission.nodes if sort in n.host.units and _has(n.host, line))
        fault = parse_line(line, *host)
        values = "".join(f", {v.parameter.name}: {x!r}" for v, x in zip(fault.kind.values, fault.values, strict=True))
        end = f", end: {fault.end_s!r}" if np.isfinite(fault.end_s) else ""
        times = f"time: {fault.start_s!r}{end}"
        text += f"      f{k}: {{{times}, target: {line.split()[0]}, kind: {fault.kind.name}{values}}}\n"
    return text


def _has(host, line: str) -> bool:
    try:
        parse_line(line, *host)
    except ValueError:
        return False
    return True


@pytest.fixture(scope="module")
def live(tmp_path_factory) -> tuple[Path, list[str]]:
    bag = tmp_path_factory.mktemp("live") / "bag"
    return bag, fly_with_requests(mission_with("", *TELL, duration=DURATION), bag, OF_UNITS)


def same_but_told(found: Path, expected: Path, apart: Callable[[str], bool]) -> None:
    a, b = messages_by_topic(found), messages_by_topic(expected)
    topics = {t for t in a.keys() | b.keys() if not apart(t)}
    assert len(topics) > 6
    for topic in sorted(topics):
        assert a[topic] == b[topic], topic


def test_faults_of_a_script_give_the_bytes_of_those_that_were_injected(live, tmp_path):
    bag, lines = live
    assert len(lines) == len(OF_UNITS) and all(" from " in line for line in lines)
    scripted = mission_with(entries(lines, mission_with("")), *TELL, duration=DURATION)
    assert sorted(entry.line for entry in scripted.faults) == sorted(lines)
    result = fly_composed(scripted, tmp_path / "bag")
    assert result.failure == ""
    same_but_told(tmp_path / "bag", bag, lambda topic: topic in ("/parameter_events", "/faults/dynamics"))
    # the plant has told the stamp that it stands at when it is asked, and tells of it at the next one
    rows = [[s.rows.tolist() for s in samples(b, "/faults/dynamics", Faults)] for b in (tmp_path / "bag", bag)]
    assert rows[0] == rows[1] and rows[0]
    assert len(read_flight(bag).faults) >= len(OF_UNITS)


def test_the_compiled_loop_flies_the_faults_that_were_injected(live):
    bag, lines = live
    scripted = mission_with(entries(lines, mission_with("")), *TELL, duration=DURATION)
    trace = fly_cases(MissionFlight(scripted), np.array([CASE]), 10, traced=True).trace[0]
    np.testing.assert_array_equal(trace, trace_of(read_flight(bag)))


def test_faults_of_messages_and_clocks_too(tmp_path):
    lines = fly_with_requests(mission_with("", duration=DURATION), tmp_path / "live", OF_LINKS)
    scripted = mission_with(entries(lines, mission_with("")), duration=DURATION)
    fly_composed(scripted, tmp_path / "script")
    same_but_told(
        tmp_path / "script", tmp_path / "live", lambda topic: topic == "/parameter_events" or topic.endswith("/link")
    )
    flown = faults_flown(read_flight(tmp_path / "live"), tmp_path / "live").faults
    assert len(flown) == len(OF_LINKS)
    assert all("; set in flight at about " in line for line in flown)
