# SPDX-License-Identifier: Apache-2.0
"""Processes that live but do not work: found, named, and restarted, or the flight ends with what it has."""

import os
import signal

import pytest
from flights import fly_composed, messages_by_topic, short_mission

from css_bringup.commands import fly
from css_bringup.processes import fly_processes


class _Freezer:
    """Stops a process once the recording has begun to grow."""

    def __init__(self, name: str, bag) -> None:
        self.name, self.bag, self.done = name, bag, False

    def __call__(self, supervisor) -> None:
        if not self.done and any(file.stat().st_size > 50_000 for file in self.bag.glob("*.mcap")):
            self.done = True
            child = supervisor.recorder if self.name == "recorder" else supervisor.children[self.name]
            os.kill(child.process.pid, signal.SIGSTOP)


def test_a_stopped_node_is_restarted_and_the_flight_lacks_nothing(tmp_path):
    mission = short_mission(60.0)
    fly_composed(mission, tmp_path / "composed")
    bag = tmp_path / "bag"
    result = fly_processes(mission, bag, tmp_path / "logs", _Freezer("gyro", bag))
    assert result.failure == ""
    assert result.notes[0].startswith("gyro froze (stopped by a signal for 2.")
    assert result.notes[0].endswith(" s) and was restarted")
    assert messages_by_topic(bag)["/truth"] == messages_by_topic(tmp_path / "composed")["/truth"]


@pytest.mark.parametrize(
    ("name", "consequence"),
    [("dynamics", "the spacecraft's state is lost with it"), ("recorder", "the flight is not recorded any more")],
)
def test_what_cannot_be_replaced_ends_the_flight_with_its_log_and_a_whole_recording(tmp_path, name, consequence):
    bag = tmp_path / "bag"
    result = fly_processes(short_mission(5000.0), bag, tmp_path / "logs", _Freezer(name, bag))
    assert result.failure.startswith(f"{name} froze (stopped by a signal for 2.")
    assert f"{consequence}; its log {tmp_path / 'logs' / name}.log ends:" in result.failure
    # woken to end: the recording is closed
    assert messages_by_topic(bag)["/truth"]
    assert not list((tmp_path / "logs").glob("run_*"))


def test_processes_do_not_fly_onto_a_recording_that_is_there(tmp_path, capfd):
    bag = tmp_path / "bag"
    bag.mkdir()
    (bag / "metadata.yaml").write_text("precious\n")
    assert fly.main(["okeefe_2013", "--processes", "--out", str(bag)]) == 2
    printed = capfd.readouterr().err
    assert "already exists and is not empty" in " ".join(printed.split())
    assert "Traceback" not in printed
    assert (bag / "metadata.yaml").read_text() == "precious\n"
