# SPDX-License-Identifier: Apache-2.0
"""Flies many cases of a mission in a compiled loop of the nodes' own algorithms.

Each case draws its initial attitude and rates, sensor errors and whatever else the mission disperses; the
configurations share their draws. A study that was interrupted goes on where it was when the same command is given
again, and ends with the same bytes. `fly MISSION --case K` flies one of the cases on the real graph.
"""

import signal
from collections.abc import Sequence
from pathlib import Path

from css_analysis.errors import StudyError
from css_common.command import MISSION_HELP, CommandParser, command_parser, guarded, implementation
from css_common.mission_file import MissionError
from css_report.page_option import add_page_option

_EXAMPLES = (
    "okeefe_2013 --cases 1000 --estimators wavg ekf --gyro on off",
    "okeefe_2013 --cases 100 --sweep css_array.scale_cell_error=0,0.05,0.1,0.2",
    "okeefe_2013 --cases 10000 --scheduler tcp://cluster:8786",
    "cubesat_vmm --cases 200 --guess 20",
    "okeefe_2013 --cases 64 --disperse dynamics.spacecraft.inertia=normal:0.05 --sampling lhs",
    "okeefe_2013 --cases 64 --disperse css_array.noise=uniform:0:0.02 --sensitivity",
    "okeefe_2013 --cases 64 --disperse css_array.noise=uniform:0:0.02 --worst heading_error_mean_deg",
)
_NOTES = """\
Distributions of --disperse: normal:S, lognormal:S and uniform:R about the mission's value, in shares of it;
normal:MEAN:S, normal:MEAN:S:LOW:HIGH, uniform:LOW:HIGH and choice:A:B:... in the parameter's unit. KEY.3 is one number
of a list, KEY.each every number by itself. A mission keeps them in its section `dispersions`. What a shared parameter
such as spacecraft.inertia draws, flight software knows too; dynamics.spacecraft.inertia is the truth alone.

Results are Parquet files in the study's folder: cases.parquet (one row per configuration and case) and
percentiles.parquet (percentiles over the cases against time), beside study.json, what was asked for."""


def _parser() -> CommandParser:
    parser = command_parser("css_monte_carlo", "monte_carlo", __doc__, _EXAMPLES, notes=_NOTES)
    add = parser.add_argument
    add(
        "mission",
        nargs="?",
        default="okeefe_2013",
        help=MISSION_HELP,
    )
    add("--cases", type=int, default=100, metavar="N", help="cases per configuration (default: %(default)s)")
    add("--first-case", type=int, default=0, metavar="K", help="number of the first case (default: 0)")
    add(
        "--estimators",
        nargs="+",
        metavar="NAME",
        help="Sun estimators, or attitude filters of the graph, each in flights of its own (default: the one that "
        "controls, or all if none does)",
    )
    add(
        "--gyro",
        nargs="+",
        choices=("on", "off"),
        help="fly with the gyro, without, or both (default: as the mission has it)",
    )
    add("--duration", type=float, metavar="S", help="simulated time of a flight [s] (default: the mission's)")
    add("--seed", type=int, metavar="N", help="key of all random streams (default: the mission's)")
    add("--set", action="append", default=[], metavar="KEY=VALUE", dest="overrides", help="change one parameter")
    add(
        "--sweep",
        action="append",
        default=[],
        metavar="KEY=V1,V2,...",
        help="fly every value of a parameter; several sweeps combine",
    )
    add(
        "--disperse",
        action="append",
        default=[],
        metavar="KEY=DISTRIBUTION",
        help="draw a parameter for each case, for instance spacecraft.inertia=normal:0.05",
    )
    add(
        "--sampling",
        choices=("random", "lhs", "sobol"),
        help="draw dispersed parameters independently, by a Latin hypercube or a Sobol sequence (default: the "
        "mission's, else random)",
    )
    add(
        "--sensitivity",
        nargs="?",
        const="",
        metavar="QUANTITY",
        help="print Sobol indices: which dispersed parameter matters for a column of cases.parquet (default: the first "
        "that is printed). --cases are then base points (rounded up to a power of 2), each flown once for every "
        "dispersion and three times more",
    )
    add(
        "--worst",
        nargs="?",
        const="",
        metavar="QUANTITY",
        help="search for the worst flight, by the largest value of a column of cases.parquet (default: the first that "
        "is printed), and print what flies it",
    )
    add(
        "--worst-flights",
        type=int,
        default=400,
        metavar="N",
        help="flights of that search (default: %(default)s)",
    )
    add("--sample", type=float, default=1.0, metavar="S", help="time between percentiles [s] (default: %(default)s)")
    add(
        "--guess",
        type=float,
        default=0.0,
        metavar="DEG",
        help="attitude filters begin with an error of so much about each axis, 1 sigma [deg] (default: as they say)",
    )
    add("--out", type=Path, metavar="DIR", help="folder of the study (default: studies/MISSION_TIME)")
    add("--threads", type=int, metavar="N", help="flights at a time (default: one per processor)")
    add("--scheduler", metavar="ADDRESS", help="dask scheduler to run on; local starts one on this machine")
    add("--json", action="store_true", help="print the result as one JSON object on the last line")
    add_page_option(parser)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    parser = _parser()
    options = parser.parse_args(arguments)
    # a killed terminal or `kill` end it as Ctrl-C does: finished chunks stay
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    interrupted = "interrupted; the same command with the same --out goes on from here"
    run = implementation("css_monte_carlo.verbs.monte_carlo")
    return guarded(parser.prog, lambda: run(options), (MissionError, StudyError), interrupted=interrupted)
