# SPDX-License-Identifier: Apache-2.0
"""Flying with progress on the terminal, in one process or several."""

import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from css_bringup.compiling_processes import CompilingProcesses
from css_bringup.composed import ComposedFlight
from css_bringup.flight_result import FlightResult
from css_bringup.processes import Supervisor, fly_processes
from css_common import domains, network, places, security
from css_common.component import Component
from css_common.mission import Mission
from css_common.preflight import preflight, report
from css_common.progress_lines import ProgressLines, still_working
from css_common.stop_signal import StopSignal


@contextmanager
def own_domain(name: str, asked: str | None, bag: Path | None, console: Console) -> Iterator[int]:
    """A ROS domain that no other flight or test of the machine is in, for all that flies inside the context.

    Args:
        name: what flies, for others who ask.
        asked: the number after `--domain`, if any.
        bag: where it is recorded, likewise.
        console: where the domain is named.

    Raises:
        NetworkError: the number is none.
        DomainError: another flight has the domain, or there is no free one.
        SecurityError: the environment asks for security, and the middleware has none.
    """
    security.check(os.environ)
    recording = str(bag.absolute()) if bag else ""
    with domains.own(os.environ, name, recording=recording, asked=asked) as held:
        before = {variable: os.environ.pop(variable, None) for variable in (network.DOMAIN, domains.JOINED)}
        os.environ[network.DOMAIN] = str(held.domain)
        console.print(f"ROS domain {held.domain}; ./sunpoint shell, record and play join it", soft_wrap=True)
        try:
            yield held.domain
        finally:
            del os.environ[network.DOMAIN]
            os.environ.update({variable: value for variable, value in before.items() if value is not None})


Ends = Callable[[ComposedFlight], str]
"""Why a flight is to end early, asked now and then; empty: it goes on."""


def _goes_on(flight: ComposedFlight) -> str:
    return ""


def fly(
    mission: Mission,
    bag: Path | None,
    *,
    processes: bool,
    console: Console,
    overwrite: bool = False,
    ends: Ends = _goes_on,
    stand_ins: Mapping[str, type[Component]] | None = None,
) -> FlightResult:
    """Flies a mission to its end, or until Ctrl-C or SIGTERM, after which the recording is complete up to there.

    Args:
        mission: what to fly.
        bag: where to record; None records nothing.
        processes: one process per node instead of one for all.
        console: where progress is shown, when it is a terminal.
        overwrite: replace a recording that is there.
        ends: why it ends early, in one process.
        stand_ins: components in the place of those of some nodes, by name; of a flight in one process.

    Raises:
        MissionError: a check before the flight refuses the mission; warnings go to standard error and the result.
    """
    warnings = preflight(mission)
    report(warnings)
    # noted, not raised: an exception would tear a cycle apart, and a second Ctrl-C the clean-up
    with StopSignal() as stop:
        if processes:
            result = _fly_processes(mission, bag, console, stop, overwrite)
        else:
            result = _fly_composed(mission, bag, console, stop, overwrite, ends, stand_ins or {})
    result.warnings = warnings
    return result


def _fly_processes(
    mission: Mission, bag: Path | None, console: Console, stop: StopSignal, overwrite: bool
) -> FlightResult:
    # without a recording, flights of one mission at the same time differ by their domain
    flight = bag.name if bag else f"{mission.name}_domain_{os.environ.get(network.DOMAIN, '0')}"
    logs = places.logs() / "flights" / flight
    status = f"flying {mission.name}, one process per node; logs in {logs}"
    named = 0
    compiling = CompilingProcesses()

    def tell(supervisor: Supervisor) -> None:
        nonlocal named
        for note in supervisor.notes[named:]:
            print(note, file=sys.stderr, flush=True)
        named = len(supervisor.notes)
        compiling.tell({name: child.log for name, child in supervisor.children.items()})

    with console.status(escape(status)) if _live(console) else still_working(f"flying {mission.name}"):
        return fly_processes(mission, bag, logs, tell, lambda: stop.came, overwrite=overwrite)


def _fly_composed(
    mission: Mission,
    bag: Path | None,
    console: Console,
    stop: StopSignal,
    overwrite: bool,
    ends: Ends,
    stand_ins: Mapping[str, type[Component]],
) -> FlightResult:
    with ComposedFlight(mission, bag, overwrite=overwrite, stand_ins=stand_ins) as flight:
        reason = ""

        def over() -> bool:
            nonlocal reason
            reason = reason or ends(flight)
            return stop.came or bool(reason)

        result = with_progress(mission, flight, console, over)
    if reason:
        result.failure, result.interrupted = result.failure or reason, False
    return result


def with_progress(
    mission: Mission, flight: ComposedFlight, console: Console, stopped: Callable[[], bool]
) -> FlightResult:
    """Flies to the end or until stopped, with progress on the terminal, or in lines where there is none."""
    total = mission.values.mission.duration
    if not _live(console):
        lines = ProgressLines(f"flying {mission.name}", "s simulated")
        return flight.fly(lambda seconds: lines.tell(seconds, total), stopped)
    bar = Progress(
        TextColumn(f"flying {escape(mission.name)}"),
        BarColumn(),
        TextColumn("{task.completed:.0f} of {task.total:.0f} s simulated"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=console,
        transient=True,
    )
    with bar:
        task = bar.add_task("", total=total)
        return flight.fly(lambda seconds: bar.update(task, completed=seconds), stopped)


def _live(console: Console) -> bool:
    return console.is_terminal
