# SPDX-License-Identifier: Apache-2.0
"""Flies a paper's experiments again: its figures, and its numbers beside ours, as a page."""

import signal
from collections.abc import Sequence
from pathlib import Path

from css_analysis.errors import StudyError
from css_common.command import CommandParser, command_parser, guarded, implementation
from css_common.mission_file import MissionError
from css_papers.errors import ReproductionError
from css_papers.paper_names import CASES, QUICK_CASES, paper_names

_EXAMPLES = ("okeefe", "clark --quick", "digregorio --cases 200 --out reports/mine")
_EXITS = {0: "done, also when numbers miss", 2: "an argument or the folder is wrong"}


def _parser() -> CommandParser:
    parser = command_parser("css_papers", "reproduce", __doc__, _EXAMPLES, _EXITS)
    parser.add_argument("paper", metavar="PAPER", help=f"one of: {', '.join(paper_names())}")
    parser.add_argument(
        "--cases",
        type=int,
        metavar="N",
        help=f"flights of each configuration (default: {CASES}, quick: {QUICK_CASES}; faults: fewer)",
    )
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder of the page (default: reports/PAPER)")
    parser.add_argument("--quick", action="store_true", help="a first look: few cases, no side studies")
    parser.add_argument("--json", action="store_true", help="print the numbers as one JSON object on the last line")
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    parser = _parser()
    options = parser.parse_args(arguments)
    # a killed terminal or `kill` end it as Ctrl-C does: finished flights stay
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    wrong = (ReproductionError, MissionError, StudyError, OSError)
    interrupted = "interrupted; the same command goes on from here"
    run = implementation("css_papers.verbs.reproduce")
    return guarded(parser.prog, lambda: run(options), wrong, interrupted=interrupted)
