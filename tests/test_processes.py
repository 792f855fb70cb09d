# SPDX-License-Identifier: Apache-2.0
"""One process per node: the same numbers as composed, restarts after a death, an end with a log after the second."""

import os
import signal

import pytest
from flights import fly_composed, messages_by_topic, short_mission, stamped_topics

from css_bringup.processes import fly_processes
from css_recording.recovery import recover


def test_processes_and_composed_agree_sample_by_sample(tmp_path):
    mission = short_mission(20.0)
    assert fly_composed(mission, tmp_path / "composed").messages_lost == 0
    result = fly_processes(mission, tmp_path / "processes", tmp_path / "logs")
    assert result.failure == ""
    assert result.messages_lost == 0
    composed = messages_by_topic(tmp_path / "composed")
    separate = messages_by_topic(tmp_path / "processes")
    for topic in stamped_topics(mission):
        assert separate[f"/{topic}"] == composed[f"/{topic}"], topic


class _Killer:
    """Kills a node once so much of the flight is recorded, and again after each restart, `times` in all."""

    def __init__(self, name: str, times: int, bag, after_bytes: int = 50_000) -> None:
        self.name, self.left, self.bag, self.after_bytes = name, times, bag, after_bytes
        self.killed: set[int] = set()

    def __call__(self, supervisor) -> None:
        child = supervisor.children[self.name]
        flying = (
            any(self.bag.glob("*.mcap")) and sum(f.stat().st_size for f in self.bag.glob("*.mcap")) > self.after_bytes
        )
        if self.left and flying and child.process.pid not in self.killed and child.poll() is None:
            self.killed.add(child.process.pid)
            os.kill(child.process.pid, signal.SIGKILL)
            self.left -= 1


def test_a_restarted_sensor_gives_the_numbers_it_would_have_given(tmp_path):
    mission = short_mission(60.0)
    fly_composed(mission, tmp_path / "composed")
    bag = tmp_path / "bag"
    result = fly_processes(mission, bag, tmp_path / "logs", _Killer("gyro", 1, bag))
    assert "gyro died (SIGKILL) and was restarted" in result.notes
    assert messages_by_topic(bag) == messages_by_topic(tmp_path / "composed"), "and none of them is lost"


def test_nodes_that_die_are_restarted_and_nothing_is_lost_with_them(tmp_path):
    mission = short_mission(60.0)
    bag = tmp_path / "bag"
    # one after the other, each in another part of the flight
    killers = [_Killer(n, 1, bag, 50_000 * k) for k, n in enumerate(("css_array", "ekf", "mrp_control"), 1)]

    def kill(supervisor) -> None:
        for killer in killers:
            killer(supervisor)

    result = fly_processes(mission, bag, tmp_path / "logs", kill)
    assert result.failure == ""
    assert result.steps == 600
    assert all(f"{killer.name} died (SIGKILL) and was restarted" in result.notes for killer in killers)
    assert result.messages_lost == 0
    stamps = [mission.epoch_ns + k * mission.period_ns for k in range(600)]
    recorded = messages_by_topic(bag)
    for topic in stamped_topics(mission):
        assert [stamp for stamp, _ in recorded[f"/{topic}"]] == stamps, topic


class _Stopper:
    """Stops the recorder once the flight is under way, and lets it go on when the plant is found waiting for it."""

    def __init__(self, bag, log) -> None:
        self.bag, self.log, self.stopped, self.resumed = bag, log, False, False

    def __call__(self, supervisor) -> None:
        recorder = supervisor.recorder.process
        if not self.stopped and sum(f.stat().st_size for f in self.bag.glob("*.mcap")) > 50_000:
            self.stopped = True
            os.kill(recorder.pid, signal.SIGSTOP)
        elif self.stopped and not self.resumed and "waiting for recorder/progress" in self.log.read_text():
            self.resumed = True
            os.kill(recorder.pid, signal.SIGCONT)


def test_flight_waits_for_a_recorder_that_is_stopped(tmp_path):
    mission = short_mission(60.0, "lockstep.warn_after=0.2")
    fly_composed(mission, tmp_path / "composed")
    bag = tmp_path / "bag"
    stopper = _Stopper(bag, tmp_path / "logs" / "dynamics.log")
    result = fly_processes(mission, bag, tmp_path / "logs", stopper)
    assert stopper.resumed
    assert result.failure == ""
    assert result.messages_lost == 0
    assert any("simulated time held" in note for note in result.notes)
    assert messages_by_topic(bag) == messages_by_topic(tmp_path / "composed")


def test_the_second_death_ends_the_run_with_the_log(tmp_path):
    bag = tmp_path / "bag"
    result = fly_processes(short_mission(5000.0), bag, tmp_path / "logs", _Killer("ekf", 2, bag))
    assert "ekf died (SIGKILL), for the second time within 60 s" in result.failure
    assert "ekf.log" in result.failure
    # the recording up to there is complete
    assert messages_by_topic(bag)["/truth"]


def test_without_the_plant_the_run_ends(tmp_path):
    bag = tmp_path / "bag"
    result = fly_processes(short_mission(5000.0), bag, tmp_path / "logs", _Killer("dynamics", 1, bag))
    assert "dynamics died (SIGKILL), the spacecraft's state is lost with it" in result.failure
    # the plant left no figures: the recording tells how far it came
    recorded = {topic: len(messages) for topic, messages in messages_by_topic(bag).items()}
    assert result.steps == max(recorded["/truth"], recorded["/wheels/state"]) > 10
    assert result.simulated_s == pytest.approx(0.1 * result.steps)
    assert result.messages_recorded == sum(recorded.values())
    # at most what the cycle lacks in which it died
    assert result.messages_lost < len(recorded)


def test_a_killed_recorder_ends_the_run_and_its_recording_is_recovered(tmp_path):
    bag = tmp_path / "bag"

    class KillRecorder(_Killer):
        def __call__(self, supervisor) -> None:
            supervisor.children.setdefault("recorder", supervisor.recorder)
            super().__call__(supervisor)
            del supervisor.children["recorder"]

    mission = short_mission(5000.0)
    result = fly_processes(mission, bag, tmp_path / "logs", KillRecorder("recorder", 1, bag))
    assert "recorder died (SIGKILL), the flight is not recorded any more" in result.failure
    recover(bag)
    recovered = messages_by_topic(bag)
    counts = {topic: len(recovered[f"/{topic}"]) for topic in stamped_topics(mission)}
    assert min(counts.values()) > 10
    # whole simulated seconds, of all topics alike
    assert max(counts.values()) - min(counts.values()) <= 10
