# SPDX-License-Identifier: Apache-2.0
"""Measures the speed of the software on this machine.

graph: the mission's graph in lockstep, composed in one process and as one process per node, recorded and not.
Figures are the real-time factor (simulated over wall time) and processor time a control cycle.

monte-carlo: processor time of a step of a case, here and in Basilisk, which is installed below .cache/ once. About two
minutes on two processors.
"""

import argparse

from css_bringup.json_process import MeasurementError
from css_bringup.options import add_domain_option, guarded, whole_number
from css_common.command import CommandParser, command_parser, implementation

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
    monte_carlo = subjects.add_parser("monte-carlo", help="the Monte Carlo beside Basilisk")
    _add_monte_carlo_options(monte_carlo)
    for subject in (graph, monte_carlo):
        subject.add_argument("--json", action="store_true", help="print the result as one JSON object on the last line")
    return parser


def _add_monte_carlo_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--duration", type=float, default=5550.0, help="simulated time of a flight [s] (default: 5550, one orbit)"
    )
    parser.add_argument("--repeats", type=whole_number, default=3, help="runs of each kind (default: %(default)s)")
    parser.add_argument("--cases", type=whole_number, default=300, help="cases flown here (default: %(default)s)")
    parser.add_argument(
        "--estimator", choices=("wavg", "ekf"), default="wavg", help="estimator here (default: %(default)s)"
    )
    parser.add_argument(
        "--peer-estimator", choices=("wls", "okeefe"), default="wls",
        help="Basilisk's cssWlsEst or okeefeEKF (default: %(default)s)",
    )  # fmt: skip


def main(args: list[str] | None = None) -> int:
    """Entry point."""
    parser = _parser()
    arguments = parser.parse_args(args)
    run = implementation("css_bringup.verbs.bench")
    return guarded(parser.prog, lambda: run(arguments), (MeasurementError,))
