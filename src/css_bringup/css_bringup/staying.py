# SPDX-License-Identifier: Apache-2.0
"""Flights one after another in one process and one ROS domain: each begins when `/flight/reset` asks for it."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

from rclpy.context import Context
from rclpy.parameter import Parameter
from rich.console import Console

from css_bringup.composed import ComposedFlight
from css_bringup.flight_director import FlightDirector, Wish
from css_bringup.flight_result import FlightResult
from css_bringup.fly_mission import with_progress
from css_bringup.report import print_incidents
from css_common.component import Component
from css_common.drawn_mission import drawn
from css_common.executor import spin_until
from css_common.mission import Mission, load_mission
from css_common.preflight import preflight, report
from css_common.stop_signal import StopSignal


class Staying(NamedTuple):
    """What flights one after another have in common.

    Attributes:
        bag_of: where a flight is recorded; None: nowhere.
        console: where progress is shown, when it is a terminal.
        conclude: says what came of a flight that was not ended for another one, and gives its exit code.
        begun: is handed each flight before it flies.
        stand_ins_of: components in the place of those of some nodes of a mission, by name.
    """

    bag_of: Callable[[Mission], Path | None]
    console: Console
    conclude: Callable[[Mission, FlightResult], int]
    begun: Callable[[ComposedFlight], object] = lambda flight: None
    stand_ins_of: Callable[[Mission], Mapping[str, type[Component]]] = lambda mission: {}


def mission_of_wish(wish: Wish) -> Mission:
    """The mission that a wish means, checked as before a flight.

    Raises:
        MissionError: it is wrong, or cannot fly.
    """
    mission = drawn(load_mission(wish.mission, wish.overrides)).mission
    preflight(mission)
    return mission


def fly_and_stay(wish: Wish, mission: Mission, staying: Staying, rate: float | None = None) -> int:
    """Flies, and flies again when asked, until Ctrl-C or SIGTERM; the exit code of the last flight.

    Args:
        wish: what flies first.
        mission: the same.
        staying: what it has in common with those that follow.
        rate: simulated seconds per second of the wall clock at first, a later flight has that of the one before it;
            None: as the mission says.

    Raises:
        MissionError: a check before the first flight refuses its mission.
    """
    with StopSignal() as stop:
        asked: tuple[Wish, Mission] | None = (wish, mission)
        code = 0
        while asked is not None:
            code, asked, rate = _fly_once(*asked, staying, stop, rate)
        return code


def _fly_once(
    wish: Wish, mission: Mission, staying: Staying, stop: StopSignal, rate: float | None
) -> tuple[int, tuple[Wish, Mission] | None, float]:
    """One flight and the wait after it; its exit code, what is asked for next (None: nothing more), and its rate."""
    warnings = preflight(mission)
    report(warnings)
    directors: list[FlightDirector] = []

    def checked(further: Wish) -> Mission:
        meant = mission_of_wish(further)
        staying.stand_ins_of(meant)  # a library that does not fit it is refused before this flight is ended
        return meant

    def direct(context: Context) -> FlightDirector:
        directors.append(FlightDirector(context, wish, mission, checked))
        return directors[0]

    components = staying.stand_ins_of(mission)
    with ComposedFlight(mission, staying.bag_of(mission), stand_ins=components, guests=(direct,)) as flight:
        staying.begun(flight)
        (director,) = directors
        pace = flight.plant.pace
        if rate is not None:
            flight.plant.set_parameters([Parameter("rate", value=rate)])
        if wish.paused:
            pace.pause()
        result = with_progress(mission, flight, staying.console, lambda: stop.came or director.asked is not None)
        result.warnings = warnings
        director.ended(result)
        if director.asked is not None:
            result.interrupted = False
            print_incidents(result)
            code = 0
        else:
            code = staying.conclude(mission, result)
            spin_until(flight.executor, lambda: stop.came or director.asked is not None, context=flight.context)
        asked = None if stop.came else director.asked
    if asked is not None:
        staying.console.print(f"flies again: {asked[1].name}, case {asked[1].values.mission.case}", soft_wrap=True)
    return code, asked, pace.rate
