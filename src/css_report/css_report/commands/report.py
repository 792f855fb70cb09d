# SPDX-License-Identifier: Apache-2.0
"""Writes one page of a recording or a study, which opens in any browser without a network.

A flight: figures of merit, everything against time with plots that zoom together, the Sun over the body with the view
of each cell, the orbit with its light, what was refused and why, mission and versions. A study: percentiles, histograms
with confidence intervals, and the worst cases with the command that flies each. Two of either stand side by side.
"""

from collections.abc import Sequence
from pathlib import Path

from css_analysis.errors import StudyError
from css_common.command import CommandParser, command_parser, guarded, implementation
from css_common.mission_file import MissionError
from css_recording.errors import BagError
from css_report.errors import ReportError

_EXAMPLES = ("bags/reference -o reference.html", "bags/FLIGHT --open", "studies/STUDY --against studies/OTHER --json")
_EXITS = {0: "the page is written", 1: "the page is written, and no browser could be started"}


def _parser() -> CommandParser:
    parser = command_parser("css_report", "report", __doc__, _EXAMPLES, _EXITS)
    add = parser.add_argument
    add("subject", type=Path, metavar="BAG|STUDY", help="recording (folder or .mcap file), or folder of a study")
    add("--against", type=Path, metavar="OTHER", help="another of the same kind, beside it")
    add("-o", "--output", type=Path, metavar="FILE", help="page to write (default: BAG.html, STUDY/report.html)")
    add("--open", action="store_true", help="open it in the browser")
    add("--json", action="store_true", help="print {file, bytes, sections} as one JSON object on the last line")
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    parser = _parser()
    options = parser.parse_args(arguments)
    run = implementation("css_report.verbs.report")
    return guarded(parser.prog, lambda: run(options), (ReportError, BagError, MissionError, StudyError))
