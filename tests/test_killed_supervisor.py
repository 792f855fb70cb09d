# SPDX-License-Identifier: Apache-2.0
"""A supervisor that is killed takes everything with it, and the recording is closed all the same."""

import os
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from flights import messages_by_topic

from css_bringup.processes import executable_path
from css_common.places import scratch

LIMIT_S = 200.0  # a loaded machine takes its time to start six processes


def _until(condition: Callable[[], bool], what: str) -> None:
    deadline = time.monotonic() + LIMIT_S
    while not condition():
        assert time.monotonic() < deadline, what
        time.sleep(0.05)


def _children(pid: int) -> dict[int, str]:
    """Processes that a process has started, with the last word of their program."""
    found = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            text, words = stat.read_text(), (stat.parent / "cmdline").read_bytes().split(b"\0")
        except OSError:
            continue
        if int(text.rpartition(")")[2].split()[1]) == pid:
            found[int(stat.parent.name)] = next(
                (Path(os.fsdecode(word)).name for word in words if b"/lib/css" in word or b"/lib/sunpoint" in word), ""
            )
    return found


def _alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.fixture
def flight(tmp_path):
    """A supervisor with its flight under way."""
    bag = tmp_path / "bag"
    mission = Path(__file__).parents[1] / "config" / "okeefe_2013.yaml"
    command = [executable_path("css_bringup", "fly"), mission, "--duration", "50000", "--processes", "--out", bag]
    environment = os.environ | {"SUNPOINT_HOME": str(tmp_path)}
    (tmp_path / ".cache").symlink_to(scratch("kernels").parent)  # compiled kernels stay where they are
    supervisor = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL)
    try:
        _until(lambda: any(file.stat().st_size > 50_000 for file in bag.glob("*.mcap")), "the flight is under way")
        yield supervisor
    finally:
        supervisor.kill()
        supervisor.wait()


@pytest.mark.parametrize("frozen", [(), ("ekf", "recorder")], ids=["all at work", "some stopped"])
def test_nothing_is_left_of_a_flight_whose_supervisor_is_killed(flight, tmp_path, frozen):
    children = _children(flight.pid)
    assert sorted(filter(None, children.values())) == [
        "css_array", "dynamics", "ekf", "gyro", "mrp_control", "recorder",
    ]  # fmt: skip
    (run,) = (tmp_path / "log" / "flights" / "bag").glob("run_*")
    for pid, name in children.items():
        if name in frozen:
            os.kill(pid, signal.SIGSTOP)
    flight.kill()
    flight.wait()
    _until(lambda: not any(map(_alive, children)), "all processes have ended")
    assert not run.exists()
    recorded = messages_by_topic(tmp_path / "bag")
    assert len(recorded["/truth"]) > 10
