# SPDX-License-Identifier: Apache-2.0
"""Whether a supervised process works, and that it ends with its supervisor."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from presence import present

from css_bringup import processes, warden
from css_bringup.child import Child, Pulse
from css_bringup.processes import Supervisor
from css_common.mission import load_mission
from css_common.testing import DEADLINE

SUPERVISED = """
import time
from css_common import supervised
supervised.take_on()
supervised.beat()
print("beaten", flush=True)
time.sleep(3600)
"""


def _until(condition: Callable[[], bool]) -> None:
    while not condition():  # pytest-timeout ends what never comes
        pass


def _state(pid: int) -> str:
    return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]


@pytest.fixture
def pulse():
    """That of this process, and where it would beat."""
    source, beating = os.pipe()
    os.set_blocking(source, False)
    yield Pulse(os.getpid(), source), beating
    os.close(source)
    os.close(beating)


@pytest.fixture
def child(tmp_path):
    """A process that beats once, and then only lives."""
    child = Child("node", [sys.executable, "-c", SUPERVISED], tmp_path / "node.log")
    child.start()
    _until(lambda: "beaten" in child.log.read_text())
    yield child
    child.kill()
    child.stop(0.0)


def test_silence_counts_from_the_first_beat_to_the_next(pulse):
    pulse, beating = pulse
    for _ in range(100):
        pulse.look(1.0)
    assert pulse.frozen(2.0, 5.0) == ""  # it is still starting
    os.write(beating, b"..")
    for _ in range(6):
        pulse.look(1.0)
    assert pulse.frozen(2.0, 5.0) == ""
    pulse.look(1.0)
    assert pulse.frozen(2.0, 5.0) == "no sign of life for 6.0 s"
    os.write(beating, b".")
    pulse.look(1.0)
    assert pulse.frozen(2.0, 5.0) == ""


def test_a_process_beats_through_its_pipe(child):
    child.pulse.look(9.0)
    assert child.pulse.silent_s == 0.0
    child.pulse.look(9.0)
    assert child.pulse.frozen(2.0, 8.0) == "no sign of life for 9.0 s"


def test_a_stopped_process_is_frozen_at_once_and_well_when_it_goes_on(child):
    os.kill(child.process.pid, signal.SIGSTOP)
    _until(lambda: _state(child.process.pid) == "T")
    child.pulse.look(1.5)
    assert child.pulse.frozen(2.0, 100.0) == ""
    child.pulse.look(1.5)
    assert child.pulse.frozen(2.0, 100.0) == "stopped by a signal for 3.0 s"
    os.kill(child.process.pid, signal.SIGCONT)
    _until(lambda: _state(child.process.pid) != "T")
    child.pulse.look(1.5)
    assert child.pulse.frozen(2.0, 100.0) == ""


def test_a_stopped_process_ends_when_it_is_asked_to(child):
    os.kill(child.process.pid, signal.SIGSTOP)
    _until(lambda: _state(child.process.pid) == "T")
    child.stop(60.0)
    assert child.poll() == -signal.SIGINT


PARENT = f"""
import sys
from pathlib import Path
from css_bringup.child import Child
child = Child("node", [sys.executable, "-c", {SUPERVISED!r}], Path(sys.argv[1]))
print(child.start(), flush=True)
input()
"""


def test_the_death_of_the_supervisor_is_an_interrupt(tmp_path):
    log = tmp_path / "node.log"
    parent = subprocess.Popen([sys.executable, "-c", PARENT, log], stdout=subprocess.PIPE, stdin=subprocess.PIPE)
    pid = int(present(parent.stdout).readline())
    _until(lambda: log.exists() and "beaten" in log.read_text())
    handle = os.pidfd_open(pid)
    parent.kill()
    parent.communicate()
    warden._wait([handle], 60.0)
    os.close(handle)
    assert "KeyboardInterrupt" in log.read_text()


def test_a_supervisor_that_was_dead_before_is_noticed(tmp_path):
    source, beating = os.pipe()
    environment = os.environ | {"SUNPOINT_SUPERVISOR": "1", "SUNPOINT_PULSE": str(beating)}
    command = [sys.executable, "-c", SUPERVISED]
    done = subprocess.run(
        command, env=environment, pass_fds=(beating,), capture_output=True, timeout=DEADLINE, check=False
    )
    assert done.returncode == -signal.SIGINT
    os.close(source)
    os.close(beating)


def test_duties_are_not_handed_on(tmp_path):
    program = "from css_common import supervised; supervised.take_on(); import os; print(*os.environ)"
    child = Child("node", [sys.executable, "-c", program], tmp_path / "node.log")
    child.start()
    assert present(child.process).wait() == 0
    child.stop(0.0)
    assert "SUNPOINT_SUPERVISOR" not in child.log.read_text()
    assert "SUNPOINT_PULSE" not in child.log.read_text()


def test_the_warden_wakes_what_is_stopped_kills_what_hangs_and_tidies_up(tmp_path, monkeypatch):
    monkeypatch.setattr(warden, "_LIMIT_S", 0.5)
    hanging = subprocess.Popen(
        [sys.executable, "-c", "import signal; signal.signal(2, signal.SIG_IGN); print(flush=True); signal.pause()"],
        stdout=subprocess.PIPE,
    )
    present(hanging.stdout).readline()
    stopped = subprocess.Popen([sys.executable, "-c", "print(flush=True); input()"], stdin=subprocess.PIPE)
    os.kill(stopped.pid, signal.SIGSTOP)
    _until(lambda: _state(stopped.pid) == "T")
    stopped.send_signal(signal.SIGINT)  # as the kernel does
    gone = subprocess.Popen(["true"])
    gone.wait()
    folder = tmp_path / "run"
    folder.mkdir()
    reading, writing = os.pipe()
    os.write(writing, f"{hanging.pid}\n{gone.pid}\n{stopped.pid}\n".encode())
    os.close(writing)
    monkeypatch.setattr(warden.sys, "stdin", os.fdopen(reading))
    monkeypatch.setattr(warden.signal, "signal", lambda *_: None)
    warden.main(str(folder))
    assert (hanging.wait(), stopped.wait()) == (-signal.SIGKILL, -signal.SIGINT)
    assert not folder.exists()


class Clock:
    """Time as the supervisor sees it."""

    now = 100.0

    def monotonic(self) -> float:
        return self.now


class Watched:
    """Notes after which times the supervisor looked."""

    def __init__(self) -> None:
        self.looks: list[float] = []

    def look(self, elapsed_s: float) -> None:
        self.looks.append(elapsed_s)

    def frozen(self, stopped_limit_s: float, silent_limit_s: float) -> str:
        return (
            "no sign of life"
            if (stopped_limit_s, silent_limit_s, self.looks[-1]) == pytest.approx((2.0, 15.0, 0.3))
            else ""
        )


def test_time_for_which_the_supervisor_was_stopped_does_not_count(tmp_path, monkeypatch):
    clock = Clock()
    monkeypatch.setattr(processes, "time", clock)
    supervisor = Supervisor(load_mission("okeefe_2013"), None, tmp_path)
    watched = Watched()
    monkeypatch.setattr(supervisor.children["ekf"], "pulse", watched)
    for step_s, frozen in ((0.1, {}), (0.2, {"ekf": "no sign of life"}), (3600.0, {}), (0.25, {})):
        clock.now += step_s
        assert supervisor._frozen() == frozen
    assert watched.looks == pytest.approx([0.3, 0.5, 0.25])
