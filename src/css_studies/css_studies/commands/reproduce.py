# SPDX-License-Identifier: Apache-2.0
"""Flies a paper's experiments again: its figures, and its numbers beside ours, as a page."""

import argparse
import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from css_common.mission_file import MissionError
from css_studies.reproduce.papers import Paper, ReproductionError, Request, find_paper, paper_names
from css_studies.reproduce.rows import Row, number, printed, row_object

USAGE = 2
CASES, QUICK_CASES = 1000, 40
_EPILOG = "Exit code: 0 done, also when numbers miss; 2 an argument is wrong, or the folder cannot be written."


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="reproduce", description=__doc__, epilog=_EPILOG)
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
    options = _parser().parse_args(arguments)
    console = Console(highlight=False)
    try:
        paper = find_paper(options.paper)
        request = _request(options, paper)
        rows = paper.reproduce(request)
    except (ReproductionError, MissionError, OSError) as error:
        print(f"reproduce: {error}", file=sys.stderr)
        return USAGE
    _print_table(paper, rows, console)
    console.print(f"page: {request.folder / 'index.html'}", soft_wrap=True)
    if options.json:
        print(json.dumps({"paper": paper.name, "rows": [row_object(row) for row in rows]}, allow_nan=False))
    return 0


def _request(options: argparse.Namespace, paper: Paper) -> Request:
    cases = (QUICK_CASES if options.quick else CASES) if options.cases is None else options.cases
    if cases < 1:
        raise ReproductionError(f"--cases: {cases} given, expected at least 1")
    folder = options.out or Path(os.environ.get("SUNPOINT_HOME", "."), "reports", paper.name)
    folder.mkdir(parents=True, exist_ok=True)
    return Request(folder, cases, options.quick)


def _print_table(paper: Paper, rows: Sequence[Row], console: Console) -> None:
    variants = list(dict.fromkeys(row.variant for row in rows))
    # without a frame around the columns it fits into 80, which is what a console has that is no terminal
    table = Table(title=paper.title, title_justify="left", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    table.add_column("quantity", no_wrap=True)
    for text in ("paper", *(variant or "here" for variant in variants)):
        table.add_column(Text(text), justify="right", no_wrap=True)
    for quantity, unit in dict.fromkeys((row.quantity, row.unit) for row in rows):
        same = {row.variant: row for row in rows if row.quantity == quantity}
        results = [_result(same.get(variant)) for variant in variants]
        table.add_row(Text(f"{quantity} [{unit}]"), Text(printed(next(iter(same.values())))), *results)
    console.print(table)
    for row in rows:
        if not row.ok:
            quantity = row_object(row)["quantity"]
            console.print(f"misses: {quantity}, {number(row.here)} {row.unit}, must be {row.must}", soft_wrap=True)


def _result(row: Row | None) -> Text:
    if row is None:
        return Text("")
    return Text(number(row.here), style="" if row.ok else "bold red")


if __name__ == "__main__":
    sys.exit(main())
