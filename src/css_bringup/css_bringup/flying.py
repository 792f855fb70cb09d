# SPDX-License-Identifier: Apache-2.0
"""Flying with progress on the terminal, in one process or several."""

import os
from contextlib import nullcontext
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from css_bringup.composed import ComposedFlight
from css_bringup.flight import FlightResult
from css_bringup.processes import fly_processes
from css_common.mission import Mission


def fly(mission: Mission, bag: Path | None, *, processes: bool, console: Console) -> FlightResult:
    """Flies a mission to its end.

    Args:
        mission: what to fly.
        bag: where to record; None records nothing.
        processes: one process per node instead of one for all.
        console: where progress is shown, when it is a terminal.
    """
    if processes:
        home = Path(os.environ.get("SUNPOINT_HOME", "."))
        logs = home / "log" / "flights" / (bag.name if bag else mission.name)
        with console.status(f"flying {mission.name}, one process per node; logs in {logs}") if _live(
            console
        ) else nullcontext():
            return fly_processes(mission, bag, logs)
    with ComposedFlight(mission, bag) as flight:
        if not _live(console):
            return flight.fly()
        bar = Progress(
            TextColumn(f"flying {mission.name}"),
            BarColumn(),
            TextColumn("{task.completed:.0f} of {task.total:.0f} s simulated"),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
            console=console,
            transient=True,
        )
        with bar:
            task = bar.add_task("", total=mission.values.mission.duration)
            return flight.fly(lambda seconds: bar.update(task, completed=seconds))


def _live(console: Console) -> bool:
    return console.is_terminal
