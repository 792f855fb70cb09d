# SPDX-License-Identifier: Apache-2.0
"""Measures the graph."""

import argparse
import os
import tempfile
from pathlib import Path
from statistics import median
from typing import Any

from css_analysis.readable_table import ReadableTable
from css_bringup import monte_carlo_bench
from css_bringup.flight_result import FlightResult
from css_bringup.fly_mission import fly, own_domain
from css_bringup.json_process import MeasurementError
from css_bringup.options import complain, console
from css_bringup.report import print_json
from css_common.mission import Mission, load_mission

_CONFIGURATIONS = {
    "composed": (False, False),
    "composed_recorded": (False, True),
    "processes": (True, False),
    "processes_recorded": (True, True),
}


def run(arguments: argparse.Namespace) -> int:
    """Measures what the options name; the exit code."""
    subject = {"graph": _bench_graph, "monte-carlo": monte_carlo_bench.run}[arguments.subject]
    subject(arguments)
    return 0


def _bench_graph(arguments: argparse.Namespace) -> None:
    # field checks of messages are for tests: they cost a fifth of the loop
    os.environ.pop("ROS_PYTHON_CHECK_FIELDS", None)
    mission = load_mission(arguments.mission, [f"mission.duration={arguments.duration}"])
    with own_domain(mission.name, arguments.domain, None, console) as domain:
        measured = _measure(mission, arguments.repeats)
    figures = {name: _figures(results) for name, results in measured.items()}
    table = ReadableTable()
    table.add_name("graph")
    for heading in ("real-time\nfactor", "CPU us\nper step", "messages\nlost"):
        table.add_number(heading)
    for name, row in figures.items():
        table.add_texts(
            [name, f"{row['realtime_factor']:.0f}", f"{row['cpu_us_per_step']:.0f}", str(row["messages_lost"])]
        )
    console.print(table)
    if arguments.json:
        print_json({**figures, "domain": domain})


def _measure(mission: Mission, repeats: int) -> dict[str, list[FlightResult]]:
    measured: dict[str, list[FlightResult]] = {name: [] for name in _CONFIGURATIONS}
    # kinds interleaved, so that a slow minute of the machine falls on all of them
    for _ in range(repeats):
        for name, (processes, recorded) in _CONFIGURATIONS.items():
            result = _fly_once(mission, processes=processes, recorded=recorded)
            if result.failure or result.interrupted:
                raise MeasurementError(f"{name}: the flight failed: {result.failure or 'interrupted'}")
            for note in result.notes:
                complain(f"{name}: not as it should be:", note)
            measured[name].append(result)
    return measured


def _fly_once(mission: Mission, *, processes: bool, recorded: bool) -> FlightResult:
    with tempfile.TemporaryDirectory(prefix="sunpoint_bench_") as folder:
        bag = Path(folder) / "flight" if recorded else None
        return fly(mission, bag, processes=processes, console=console)


def _figures(results: list[FlightResult]) -> dict[str, Any]:
    return {
        "realtime_factor": round(median(r.realtime_factor for r in results), 1),
        "cpu_us_per_step": round(median(1e6 * r.cpu_s / r.steps for r in results), 1),
        "messages_lost": max(r.messages_lost for r in results),
    }
