# SPDX-License-Identifier: Apache-2.0
"""Splits the heading and pointing error of a mission or a recording by what makes it.

Of a mission: each source by linearised propagation through the estimator, and by a Monte Carlo with the source alone
and with all but it; root mean squares, the bound of 95 % with its confidence, and where the two disagree. Of a
recording: what each source of the mission in it made in that flight.
"""

import signal
from collections.abc import Sequence

from css_analysis.errors import StudyError
from css_common.command import CommandParser, command_parser, guarded, implementation
from css_common.mission_file import MissionError
from css_design.budget.case_counts import CASES, QUICK_CASES
from css_design.errors import DesignError
from css_recording.errors import BagError

_EXAMPLES = ("okeefe_2013", "mysat.yaml --cases 200 --json", "cubesat_3u_sun_filter --quick", "bags/first")
_EXITS = {0: "done", 1: "done, but cases or the nominal flights never acquired the Sun"}


def _parser() -> CommandParser:
    parser = command_parser("css_design", "budget", __doc__, _EXAMPLES, _EXITS)
    add = parser.add_argument
    add("what", metavar="MISSION|BAG", help="name in config/, a mission file, or the folder of a recording")
    add("--cases", type=int, metavar="N", help=f"cases of each configuration (default: {CASES}, quick: {QUICK_CASES})")
    add("--quick", action="store_true", help="a first look: few cases, one nominal flight")
    add("--duration", type=float, metavar="S", help="simulated time of a flight [s] (default: the mission's)")
    add("--set", action="append", default=[], metavar="KEY=VALUE", dest="overrides", help="change one parameter")
    add("--json", action="store_true", help="print the budget as one JSON object on the last line")
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    parser = _parser()
    options = parser.parse_args(arguments)
    # a killed terminal or `kill` end it as Ctrl-C does
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    run = implementation("css_design.verbs.budget")
    wrong = (DesignError, MissionError, StudyError, BagError, OSError)
    return guarded(parser.prog, lambda: run(options), wrong)
