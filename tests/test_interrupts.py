# SPDX-License-Identifier: Apache-2.0
"""A flight that is asked to end: it stops at its stamp, nothing is lost or left running, however often one asks."""

import os
import signal

from flights import messages_by_topic, short_mission, stamped_topics
from presence import present

from css_bringup.composed import ComposedFlight
from css_bringup.processes import fly_processes
from css_common.stop_signal import StopSignal


def _interrupt() -> None:
    for _ in range(3):
        os.kill(os.getpid(), signal.SIGINT)


def test_a_composed_flight_stops_where_it_is(tmp_path):
    mission = short_mission(5000.0)

    def interrupt(seconds: float) -> None:
        if seconds > 5.0:
            _interrupt()

    with StopSignal() as stop, ComposedFlight(mission, tmp_path / "bag") as flight:
        result = flight.fly(interrupt, lambda: stop.came)
    assert result.interrupted
    assert not result.failure
    assert 50 < result.steps < mission.steps
    recorded = messages_by_topic(tmp_path / "bag")
    assert {topic: len(recorded[f"/{topic}"]) for topic in stamped_topics(mission)} == dict.fromkeys(
        stamped_topics(mission), result.steps
    )


def test_processes_end_with_their_flight(tmp_path):
    bag = tmp_path / "bag"
    supervisors = []

    def interrupt(supervisor) -> None:
        if any(file.stat().st_size > 50_000 for file in bag.glob("*.mcap")):
            supervisors.append(supervisor)
            _interrupt()

    with StopSignal() as stop:
        result = fly_processes(short_mission(5000.0), bag, tmp_path / "logs", interrupt, lambda: stop.came)
    assert result.interrupted
    assert not result.failure
    (supervisor,) = supervisors
    children = (*supervisor.children.values(), supervisor.recorder)
    assert [child.poll() for child in children] == [0] * 6, [child.log_tail() for child in children if child.poll()]
    # time held at the last stamp until all had answered it
    assert result.steps > 0
    assert result.messages_lost == 0, result.notes
    recorded = messages_by_topic(bag)
    topics = stamped_topics(result.mission)
    assert {topic: len(recorded[f"/{topic}"]) for topic in topics} == dict.fromkeys(topics, result.steps)


def test_signals_mean_afterwards_what_they_meant_before():
    before = signal.getsignal(signal.SIGINT)
    with StopSignal() as stop:
        _interrupt()
    assert stop.came
    assert signal.getsignal(signal.SIGINT) is before


def test_a_flight_that_cannot_be_recorded_any_more_ends(tmp_path):
    mission = short_mission(5000.0)
    with ComposedFlight(mission, tmp_path / "bag") as flight:

        def fill_disk(seconds: float) -> None:
            present(flight.recorder).failure = "No space left on device"

        result = flight.fly(fill_disk)
    assert result.failure == "the flight is not recorded any more: No space left on device"
    assert not result.interrupted
    assert result.steps < mission.steps
