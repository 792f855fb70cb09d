# SPDX-License-Identifier: Apache-2.0
"""A process that is killed and one that is stopped, from outside, in the middle of a flight with faults.

Every process in turn, and more often: `benchmarks/chaos.py --faulted`.
"""

import os
import signal
from pathlib import Path

from flights import fly_composed, messages_by_topic

from css_analysis.flight_log import read_flight
from css_bringup.processes import Supervisor, fly_processes
from css_common.mission import mission_from_text

TEXT = """
/**:
  ros__parameters:
    extends: okeefe_2013
    mission: {duration: 60.0, case: 4}
    faults:
      cell: {time: 8.0, target: cell.2, kind: stuck, level: 0.4}
      rate: {time: 5.0, end: 50.0, target: gyro.y, kind: bias, offset: 0.2}
      wheel: {time: 15.0, target: wheel.1, kind: friction, coulomb: 0.0001, viscous: 0.000001}
      lost: {time: 10.0, end: 50.0, target: message.css/voltages, kind: dropped, share: 0.1}
"""


class Harm:
    """Signals to processes, each when the recording has a certain size."""

    def __init__(self, bag: Path, *planned: tuple[int, str, signal.Signals]) -> None:
        self._bag, self._planned = bag, list(planned)

    def __call__(self, supervisor: Supervisor) -> None:
        size = sum(file.stat().st_size for file in self._bag.glob("*.mcap"))
        if self._planned and size > self._planned[0][0]:
            _, name, number = self._planned.pop(0)
            process = supervisor.children[name].process
            assert process is not None
            os.kill(process.pid, number)

    @property
    def done(self) -> bool:
        """All of it happened."""
        return not self._planned


def test_sensors_that_are_killed_and_stopped_say_what_they_would_have_said(tmp_path):
    mission = mission_from_text(TEXT, "faulted.yaml")
    expected = fly_composed(mission, tmp_path / "composed")
    assert expected.failure == ""
    bag = tmp_path / "bag"
    harm = Harm(bag, (60_000, "css_array", signal.SIGKILL), (90_000, "gyro", signal.SIGSTOP))
    result = fly_processes(mission, bag, tmp_path / "logs", harm)
    assert harm.done and result.failure == ""
    assert any(note.startswith("css_array died (SIGKILL) and was restarted") for note in result.notes)
    assert any(note.startswith("gyro froze (stopped by a signal for ") for note in result.notes)
    found, flown = messages_by_topic(bag), messages_by_topic(tmp_path / "composed")
    for topic in ("/truth", "/css/voltages", "/gyro/imu", "/ekf/sun_estimate", "/wheels/torque_command"):
        assert found[topic] == flown[topic], topic
    told = {fault.target for fault in read_flight(bag).faults}
    assert told == {"cell.2", "gyro.y", "wheel.1", "message.css/voltages"}


def test_an_estimator_and_a_control_that_are_killed_and_stopped_cost_no_step(tmp_path):
    mission = mission_from_text(TEXT, "faulted.yaml")
    bag = tmp_path / "bag"
    harm = Harm(bag, (60_000, "ekf", signal.SIGKILL), (90_000, "mrp_control", signal.SIGSTOP))
    result = fly_processes(mission, bag, tmp_path / "logs", harm)
    assert harm.done and result.failure == "" and result.steps == mission.steps
    assert any(note.startswith("ekf died (SIGKILL) and was restarted") for note in result.notes)
    assert any(note.startswith("mrp_control froze (stopped by a signal for ") for note in result.notes)
    assert not any("went on without" in note for note in result.notes)
    assert len(messages_by_topic(bag)["/truth"]) == mission.steps
