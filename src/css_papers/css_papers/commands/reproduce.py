# SPDX-License-Identifier: Apache-2.0
"""Flies a paper's experiments again: its figures, and its numbers beside ours, as a page."""

import argparse
import json
import signal
import sys
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.text import Text

from css_analysis.readable_table import ReadableTable
from css_common import places
from css_common.command import CommandParser, command_parser, guarded
from css_common.mission_file import MissionError
from css_common.preflight import reported
from css_monte_carlo.progress import progress_bar
from css_monte_carlo.study import Progress
from css_monte_carlo.study_folder import StudyError
from css_papers.papers import Paper, ReproductionError, Request, find_paper, paper_names
from css_papers.rows import Row, full_name, number, printed, row_object

CASES, QUICK_CASES = 1000, 40
_EXAMPLES = ("okeefe", "clark --quick", "digregorio --cases 200 --out reports/mine")
_EXITS = {0: "done, also when numbers miss", 2: "an argument or the folder is wrong"}


def _parser() -> CommandParser:
    parser = command_parser("css_papers", "reproduce", __doc__, _EXAMPLES, _EXITS)
    parser.add_argument("paper", metavar="PAPER", help=f"one of: {', '.join(paper_names())}")
    parser.add_argument(
        "--cases", type=int, metavar="N", help=f"flights of each configuration (default: {CASES}, quick: {QUICK_CASES})"
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
    return guarded(parser.prog, lambda: _run(options), wrong, interrupted=interrupted)


def _run(options: argparse.Namespace) -> int:
    paper = find_paper(options.paper)
    cases = (QUICK_CASES if options.quick else CASES) if options.cases is None else options.cases
    if not 1 <= cases <= 2**32:
        raise ReproductionError(f"--cases: {cases} given, expected 1 to {2**32}")
    folder = options.out or places.results("reports") / paper.name
    folder.mkdir(parents=True, exist_ok=True)
    with progress_bar(Console(stderr=True)) as bar:

        def progress(name: str) -> Progress:
            part = bar.add(name)
            return lambda done, total: bar.tell(part, done, total)

        rows = paper.reproduce(Request(folder, cases, options.quick, progress))
    console = Console(highlight=False)
    _print_table(paper, rows, console)
    console.print(f"page: {folder / 'index.html'}", soft_wrap=True)
    if options.json:
        page = {"paper": paper.name, "rows": [row_object(row) for row in rows], "warnings": reported()}
        print(json.dumps(page, allow_nan=False))
    return 0


def _print_table(paper: Paper, rows: Sequence[Row], console: Console) -> None:
    variants = list(dict.fromkeys(row.variant for row in rows))
    table = ReadableTable(paper.title)
    table.add_name("quantity")
    for text in ("paper", *(variant or "here" for variant in variants)):
        table.add_number(text)
    for quantity, unit in dict.fromkeys((row.quantity, row.unit) for row in rows):
        same = {row.variant: row for row in rows if row.quantity == quantity}
        results = [_result(same.get(variant)) for variant in variants]
        table.add_texts([f"{quantity} [{unit}]", printed(next(iter(same.values()))), *results])
    console.print(table)
    for row in rows:
        if not row.ok:
            console.print(
                f"misses: {full_name(row)}, {number(row.here)} {row.unit}, must be {row.must}", soft_wrap=True
            )


def _result(row: Row | None) -> Text:
    if row is None:
        return Text("")
    return Text(number(row.here, row.digits), style="" if row.ok else "bold red")


if __name__ == "__main__":
    sys.exit(main())
