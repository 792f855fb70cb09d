# SPDX-License-Identifier: Apache-2.0
"""Flies a paper, and prints its numbers beside ours."""

import argparse
import json
from collections.abc import Sequence

from rich.console import Console
from rich.text import Text

from css_analysis.figure_style import keep_figures
from css_analysis.readable_table import ReadableTable
from css_common import places
from css_common.preflight import reported
from css_monte_carlo.progress import progress_bar
from css_monte_carlo.study import Progress
from css_papers.errors import ReproductionError
from css_papers.paper_names import CASES, QUICK_CASES
from css_papers.papers import Paper, Request, find_paper
from css_papers.rows import Row, full_name, number, printed, row_object


def run(options: argparse.Namespace) -> int:
    """Flies the paper that the options name; the exit code."""
    paper = find_paper(options.paper)
    cases = options.cases
    if cases is None:
        cases = (paper.quick_cases or QUICK_CASES) if options.quick else (paper.cases or CASES)
    if not 1 <= cases <= 2**32:
        raise ReproductionError(f"--cases: {cases} given, expected 1 to {2**32}")
    folder = options.out or places.results("reports") / paper.name
    folder.mkdir(parents=True, exist_ok=True)
    with progress_bar(Console(stderr=True)) as bar:

        def progress(name: str) -> Progress:
            part = bar.add(name)
            return lambda done, total: bar.tell(part, done, total)

        with keep_figures():
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
