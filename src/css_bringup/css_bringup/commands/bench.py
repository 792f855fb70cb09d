# SPDX-License-Identifier: Apache-2.0
"""Measures the speed of the software on this machine.

graph: the mission's graph in lockstep, composed in one process and as one process per node, recorded and not.
Figures are the real-time factor (simulated over wall time) and processor time a control cycle.

monte-carlo: processor time of a step of a case, here and in Basilisk, which is installed below .cache/ once. About two
minutes on two processors.
"""

import argparse
import os
import sys
import tempfile
from pathlib import Path
from statistics import median
from typing import Any

from css_analysis.readable_table import ReadableTable
from css_bringup import monte_carlo_bench
from css_bringup.flight_result import FlightResult
from css_bringup.fly_mission import fly, own_domain
from css_bringup.json_process import MeasurementError
from css_bringup.options import add_domain_option, complain, console, guarded, whole_number
from css_bringup.report import print_json
from css_common.command import CommandParser, command_parser
from css_common.mission import Mission, load_mission

_CONFIGURATIONS = {
    "composed": (False, False),
    "composed_recorded": (False, True),
    "processes": (True, False),
    "processes_recorded": (True, True),
}

_EXAMPLES = ("graph", "graph --duration 60 --repeats 1 --json", "monte-carlo --cases 100")
_EXITS = {1: "a flight failed, or one side cannot be measured"}


def _parser() -> CommandParser:
    parser = command_parser("css_bringup", "bench", __doc__, _EXAMPLES, _EXITS)
    subjects = parser.add_subparsers(dest="subject", required=True, metavar="{graph,monte-carlo}")
    graph = subjects.add_parser("graph", help="the graph of nodes in lockstep")
    graph.add_argument("--mission", default="okeefe_2013", help="mission to fly (default: %(default)s)")
    graph.add_argument("--duration", type=float, default=300.0, help="simulated time of one flight [s] (default: 300)")
    graph.add_argument(
        "--repeats", type=whole_number, default=3, help="flights of each kind; medians are printed (default: 3)"
    )
    add_domain_option(graph)
    graph.set_defaults(run=_bench_graph)
    monte_carlo = subjects.add_parser("monte-carlo", help="the Monte Carlo beside Basilisk")
    monte_carlo_bench.add_options(monte_carlo)
    monte_carlo.set_defaults(run=monte_carlo_bench.run)
    for subject in (graph, monte_carlo):
        subject.add_argument("--json", action="store_true", help="print the result as one JSON object on the last line")
    return parser


def main(args: list[str] | None = None) -> int:
    """Entry point."""
    parser = _parser()
    arguments = parser.parse_args(args)
    return guarded(parser.prog, lambda: _run(arguments), (MeasurementError,))


def _run(arguments: argparse.Namespace) -> int:
    arguments.run(arguments)
    return 0


def _bench_graph(arguments: argparse.Namespace) -> None:
    # field checks of messages are for tests: they cost a fifth of the loop
    os.environ.pop("ROS_PYTHON_CHECK_FIELDS", None)
    mission = load_mission(arguments.mission, [f"mission.duration={arguments.duration}"])
    with own_domain(mission, arguments.domain, None, console) as domain:
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


if __name__ == "__main__":
    sys.exit(main())
