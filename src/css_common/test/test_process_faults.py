# SPDX-License-Identifier: Apache-2.0
"""Faults of processes: where they are refused, and that the supervisor hears of them beforehand, once."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from css_common import process_faults, supervised
from css_common.case_faults import CaseFault
from css_common.link_kinds import HUNG, KILLED, PROCESS, SLOWED
from css_common.mission import load_mission
from css_common.process_faults import ProcessFaults
from css_common.testing import Bench
from css_msgs.srv import ClearFault, InjectFault

LINES = ["message.css/voltages dropped 0.5", "process.css_array killed from 5"]


def test_only_a_supervised_process_may_fail():
    reason = process_faults.refusal(LINES, alone=False)
    assert reason is not None and "'process.css_array killed from 5'" in reason and "--processes" in reason
    assert process_faults.refusal(LINES, alone=True) is None
    assert process_faults.refusal(LINES[:1], alone=False) is None
    assert process_faults.refusal(LINES) is not None  # nobody supervises a test


@pytest.fixture
def array():
    mission = load_mission("okeefe_2013")
    with Bench() as bench:
        yield bench, bench.host(mission.node("css_array").component, mission, "css_array")


def inject(bench, target, kind, values=()):
    request = InjectFault.Request(target=target, kind=kind, values=list(values))
    return bench.request(InjectFault, "css_array/inject_fault", request)


def test_an_operator_is_told_so_too(array):
    bench, node = array
    answer = inject(bench, "process.css_array", "killed")
    assert not answer.success and "nobody would start this process anew" in answer.message
    assert node.canonical["io.faults"] == []


def test_services_take_faults_of_units_and_of_messages_side_by_side(array):
    bench, node = array
    assert inject(bench, "message.css/voltages", "dropped", [0.3]).fault == "message.css/voltages dropped 0.3"
    assert inject(bench, "cell.1", "dead").fault == "cell.1 dead"
    assert (node.canonical["io.faults"], node.canonical["faults"]) == (
        ["message.css/voltages dropped 0.3"], ["cell.1 dead"]
    )  # fmt: skip
    assert not node.stepper.link.is_quiet
    wrong = inject(bench, "message.gyro/imu", "dropped", [0.3])
    assert not wrong.success and "expected message.css/voltages" in wrong.message
    cleared = bench.request(ClearFault, "css_array/clear_fault", ClearFault.Request(fault="message.css/voltages"))
    assert list(cleared.cleared) == ["message.css/voltages dropped 0.3"]
    assert node.canonical["io.faults"] == [] and node.canonical["faults"] == ["cell.1 dead"]
    assert node.stepper.link.is_quiet


def fault(kind, first, end, *values):
    return CaseFault(PROCESS, 0, kind, values, values, first, end)


def test_each_acts_at_its_cycle_and_is_announced_once(monkeypatch):
    slept: list[float] = []
    said: list[str] = []
    killed: list[int] = []
    monkeypatch.setattr(process_faults.time, "sleep", slept.append)
    monkeypatch.setattr(process_faults.os, "kill", lambda pid, number: killed.append(pid))
    monkeypatch.setattr(process_faults.supervised, "announce", said.append)
    left: list[str] = []
    faults = ProcessFaults(lambda: left.append("farewell"))
    lines = [("hang", fault(HUNG, 3, 4, 7.0)), ("slow", fault(SLOWED, 5, 7, 0.5)), ("kill", fault(KILLED, 8, 9))]
    for step in range(10):
        faults.act(lines, step)
        if step == 3:
            faults.act(lines, step)  # a stamp that is answered again
    assert slept == [7.0, 0.5, 0.5]
    assert said == ["hang", "kill"] and killed == [os.getpid()] and left == ["farewell"]


def test_what_is_announced_reaches_the_supervisor_and_what_is_done_the_next_process():
    source, beating = os.pipe()
    lines = ["process.ekf killed from 3", "process.ekf frozen 2 from 5"]
    program = (
        "from css_common import supervised as s; s.take_on(); s.beat();"
        "[s.announce(line) for line in s.announced_before()]; s.beat(); print(s.is_supervised())"
    )
    duties = supervised.duties(beating, lines)
    path = str(Path(supervised.__file__).parents[1])
    started = subprocess.run(
        [sys.executable, "-c", program], env={**os.environ, **duties, "PYTHONPATH": path}, pass_fds=(beating,),
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    os.close(beating)
    heard = os.read(source, 4096)
    os.close(source)
    assert started.stdout.strip() == "True"
    assert supervised.announced(heard) == lines
    assert heard.startswith(b".") and heard.endswith(b".")
