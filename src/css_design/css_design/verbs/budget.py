# SPDX-License-Identifier: Apache-2.0
"""Makes the budget of a mission or a recording, and prints it."""

import argparse
import json
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from rich.console import Console

from css_analysis.readable_table import ReadableTable
from css_common.mission import load_mission
from css_common.preflight import preflight, report, reported
from css_design.budget.budget import Budget, Part, Row, budget_of
from css_design.budget.case_counts import CASES, QUICK_CASES
from css_design.budget.measured import Estimate
from css_design.budget.recorded import Recorded, recorded_budget
from css_design.errors import DesignError
from css_monte_carlo.progress import progress_bar

_NOMINAL, _QUICK_NOMINAL = 2, 1
_MOST_CASES = 100_000
_BELOW_ZERO = " below zero: with that source the mean square of the errors is less, by the square of the number"


def run(options: argparse.Namespace) -> int:
    """Prints the budget that the options ask for; the exit code."""
    cases = options.cases if options.cases is not None else QUICK_CASES if options.quick else CASES
    if not 2 <= cases <= _MOST_CASES:
        raise DesignError(f"--cases: {cases} given, expected 2 to {_MOST_CASES}")
    if Path(options.what).is_dir() or options.what.endswith(".mcap"):
        return _of_recording(options)
    overrides = list(options.overrides)
    if options.duration is not None:
        overrides.append(f"mission.duration={options.duration}")
    mission = load_mission(options.what, overrides)
    report(preflight(mission))
    with progress_bar(Console(stderr=True)) as bar:
        flown, propagated = bar.add("Monte Carlo"), bar.add("nominal flights")
        budget = budget_of(
            mission,
            cases,
            _QUICK_NOMINAL if options.quick else _NOMINAL,
            lambda done, total: bar.tell(flown, done, total),
            lambda done, total: bar.tell(propagated, done, total),
        )
    console = Console(highlight=False)
    _print(budget, console)
    if options.json:
        print(json.dumps({**as_object(budget), "warnings": reported()}, allow_nan=False))
    return 0 if budget.acquired == budget.cases else 1


def _of_recording(options: argparse.Namespace) -> int:
    """The budget of a flight that was recorded."""
    if options.overrides or options.duration is not None or options.cases is not None:
        raise DesignError("--cases, --duration, --set: given with a recording, which flew as it did; expected none")
    found = recorded_budget(Path(options.what))
    console = Console(highlight=False)
    console.print(
        f"{found.origin}: {found.mission}, case {found.case}, {found.estimator}: heading error over "
        f"{found.counted_s:.0f} s of sunlight after acquisition, root mean square",
        soft_wrap=True,
    )
    table = ReadableTable()
    table.add_name("source")
    table.add_number("alone\n[deg]")
    table.add_number("left out\n[deg]")
    for row in found.rows:
        table.add_texts([row.source, _number(row.alone), _number(row.left_out)])
    summed = math.sqrt(sum(row.alone**2 for row in found.rows if math.isfinite(row.alone)))
    table.add_texts(["root sum square", _number(summed), ""])
    table.add_texts(["recorded", _number(found.total), ""])
    console.print(table)
    console.print(f" heading, 95 % of the errors below {_interval(found.bound)} deg", soft_wrap=True)
    console.print(
        f" pointing, root mean square {_number(found.pointing_total)} deg, 95 % below "
        f"{_interval(found.pointing_bound)} deg",
        soft_wrap=True,
    )
    for remark in found.remarks:
        console.print(f"remark: {remark}", soft_wrap=True)
    if options.json:
        print(json.dumps(recorded_object(found, summed), allow_nan=False))
    return 1 if found.remarks else 0


def recorded_object(found: Recorded, summed: float) -> dict[str, Any]:
    """What `--json` prints of a recording."""
    return {
        "recording": found.origin,
        "mission": found.mission,
        "case": found.case,
        "estimator": found.estimator,
        "counted_s": found.counted_s,
        "heading": {
            "sources": [
                {"source": row.source, "alone_deg": _known(row.alone), "left_out_deg": _known(row.left_out)}
                for row in found.rows
            ],
            "root_sum_square_alone_deg": summed,
            "total_deg": found.total,
            "bound_95_deg": found.bound.value,
            "bound_95_confidence_deg": _pair(found.bound),
        },
        "pointing": {
            "total_deg": found.pointing_total,
            "bound_95_deg": found.pointing_bound.value,
            "bound_95_confidence_deg": _pair(found.pointing_bound),
        },
        "remarks": found.remarks,
        "warnings": reported(),
    }


def _print(budget: Budget, console: Console) -> None:
    for part in budget.parts:
        console.print(
            f"{budget.mission}, {budget.estimator}: {part.name} error in sunlight after acquisition, root mean "
            f"square, {budget.acquired} of {budget.cases} cases",
            soft_wrap=True,
        )
        console.print(_table(part))
        explain_signs((number for row in part.rows for number in (row.alone.value, row.left_out.value)), console)
        console.print(
            f" {part.name}, 95 % of the errors below {_interval(part.bound)} deg"
            + (f"; predicted {part.predicted_bound:.2f}" if math.isfinite(part.predicted_bound) else ""),
            soft_wrap=True,
        )
        for row in part.rows:
            if row.remark:
                console.print(f" {row.source}: {row.remark}", soft_wrap=True)
        console.print()
    for remark in budget.remarks:
        console.print(f"remark: {remark}", soft_wrap=True)


def explain_signs(numbers: Iterable[float], console: Console) -> None:
    """A root mean square below zero needs a word."""
    if any(number < 0.0 for number in numbers):
        console.print(_BELOW_ZERO, soft_wrap=True)


def _table(part: Part) -> ReadableTable:
    table = ReadableTable()
    table.add_name("source")
    for heading in ("predicted\n[deg]", "measured\nalone\n[deg]", "95 %", "left out\n[deg]", "predicted/\nalone"):
        table.add_number(heading)
    for row in part.rows:
        table.add_texts(_texts(row))
    table.add_texts(["root sum square", _number(part.predicted_sum), _number(part.alone_sum.value), "", "", ""])
    total = part.total
    ratio = part.predicted_sum / total.value if total.value > 0.0 else math.nan
    table.add_texts(["total, flown", "", _number(total.value), _span(total), "", _number(ratio)])
    return table


def _texts(row: Row) -> list[str]:
    return [
        row.source,
        _number(row.predicted),
        _number(row.alone.value),
        _span(row.alone),
        _number(row.left_out.value),
        _number(row.ratio),
    ]


def _number(value: float) -> str:
    return f"{value:.3f}" if math.isfinite(value) else "-"


def _span(estimate: Estimate) -> str:
    return f"{estimate.low:.3f} .. {estimate.high:.3f}" if math.isfinite(estimate.low) else ""


def _interval(estimate: Estimate) -> str:
    return f"{_number(estimate.value)} ({_span(estimate)} with 95 % confidence)"


def as_object(budget: Budget) -> dict[str, Any]:
    """What `--json` prints."""
    return {
        "mission": budget.mission,
        "estimator": budget.estimator,
        "cases": budget.cases,
        "acquired": budget.acquired,
        **{part.name: _part_object(part) for part in budget.parts},
        "remarks": budget.remarks,
    }


def _part_object(part: Part) -> dict[str, Any]:
    return {
        "sources": [
            {
                "source": row.source,
                "predicted_deg": _known(row.predicted),
                "alone_deg": _known(row.alone.value),
                "alone_95_deg": _pair(row.alone),
                "left_out_deg": _known(row.left_out.value),
                "left_out_95_deg": _pair(row.left_out),
                "ratio": _known(row.ratio),
                "remark": row.remark or None,
            }
            for row in part.rows
        ],
        "root_sum_square_predicted_deg": _known(part.predicted_sum),
        "root_sum_square_alone_deg": _known(part.alone_sum.value),
        "total_deg": _known(part.total.value),
        "total_95_deg": _pair(part.total),
        "bound_95_deg": _known(part.bound.value),
        "bound_95_confidence_deg": _pair(part.bound),
        "bound_95_predicted_deg": _known(part.predicted_bound),
    }


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _pair(estimate: Estimate) -> list[float] | None:
    return [estimate.low, estimate.high] if math.isfinite(estimate.low) else None
