# SPDX-License-Identifier: Apache-2.0
"""Checks as the options say, and prints a verdict for each cell."""

import argparse
import json
from typing import Any

from rich.console import Console

from css_analysis.readable_table import ReadableTable
from css_calibration.check import Checked, check
from css_calibration.mission_of import recorded_by
from css_calibration.step_lines import step_lines
from css_calibration.verdicts import UNTOLD, Verdict
from css_common.command import FAILED
from css_common.epochs import format_utc
from css_common.progress_lines import still_working


def run(_prog: str, options: argparse.Namespace) -> int:
    """Checks as the options say; the exit code."""
    with still_working(f"checking {options.bag}"):
        result = check(recorded_by(options), reference=options.reference, tell=step_lines())
    _print(result, Console(highlight=False, markup=False))
    if options.json:
        print(json.dumps(result_object(result, str(options.bag)), allow_nan=False))
    return 0 if result.healthy else FAILED


def result_object(result: Checked, source: str) -> dict[str, Any]:
    """What `--json` prints."""
    return {
        "recording": source,
        "mission": result.recorded.mission.name,
        "reference": result.reference,
        "instants": len(result.recorded.stamp_ns),
        "healthy": result.healthy,
        "cells": [_cell_object(verdict) for verdict in result.verdicts],
        "notes": result.notes,
    }


def _cell_object(verdict: Verdict) -> dict[str, Any]:
    row: dict[str, Any] = {
        "cell": verdict.cell,
        "verdict": verdict.verdict,
        "not_told_apart": list(verdict.others),
        "evidence": verdict.evidence,
        "from": format_utc(verdict.first_ns),
        "to": format_utc(verdict.last_ns),
    }
    if verdict.directions_b:
        row["directions_b"] = [list(direction) for direction in verdict.directions_b]
    return row


def _print(result: Checked, console: Console) -> None:
    recorded = result.recorded
    table = ReadableTable(
        f"{recorded.mission.name}: {recorded.voltages.shape[1]} cells, {len(recorded.stamp_ns)} instants, reference: "
        f"{result.reference}"
    )
    for heading in ("cell", "verdict", "from", "to", "evidence"):
        table.add_name(heading)
    for v in result.verdicts:
        span = (format_utc(v.first_ns), format_utc(v.last_ns)) if v.accuses else ("", "")
        table.add_texts([f"{v.cell}", v.words, *span, v.evidence])
    console.print(table)
    for line in result.notes:
        console.print(f"noted: {line}", soft_wrap=True)
    failing = sorted({v.cell for v in result.verdicts if v.accuses})
    untold = sorted({v.cell for v in result.verdicts if v.verdict == UNTOLD})
    count = recorded.voltages.shape[1]
    rest = "".join(f"; {word}: {cells}" for word, cells in (("not", failing), (UNTOLD, untold)) if cells)
    console.print(f"{count - len(failing) - len(untold)} of {count} cells are healthy{rest}")
