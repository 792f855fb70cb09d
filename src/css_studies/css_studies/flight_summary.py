# SPDX-License-Identifier: Apache-2.0
"""What people read of the runs of a flight: a table, and the mission's pass criteria that they miss."""

from collections.abc import Iterable, Mapping
from typing import TextIO

from rich.console import Console
from rich.table import Table

from css_common.schema import unknown_name
from css_studies.flight_metrics import QUANTITIES, Run

_COLUMNS = {
    "power_positive_s": ("converging\n[s]", "{:.1f}"),
    "heading_error_mean_deg": ("heading error\nmean [deg]", "{:.2f}"),
    "heading_error_p95_deg": ("heading error\n95 % [deg]", "{:.2f}"),
    "pointing_error_mean_deg": ("pointing error\nmean [deg]", "{:.2f}"),
    "rate_final_deg_s": ("final rate\n[deg/s]", "{:.3f}"),
    "steps_without_estimate": ("steps without\nestimate", "{:d}"),
}


def summary_table(runs: Iterable[Run], title: str = "") -> Table:
    """The runs as a table for a `rich` console; what is unknown or was never reached is a dash."""
    table = Table(title=title or None, title_justify="left")
    table.add_column("estimator")
    table.add_column("gyro")
    for heading, _ in _COLUMNS.values():
        table.add_column(heading, justify="right")
    for run in runs:
        values = (run.get(quantity) for quantity in _COLUMNS)
        shown = (
            "-" if value is None else text.format(value)
            for value, (_, text) in zip(values, _COLUMNS.values(), strict=True)
        )
        table.add_row(run["estimator"] + (" (flown)" if run["flown"] else ""), run["gyro"], *shown)
    return table


def print_summary(runs: Iterable[Run], title: str = "", file: TextIO | None = None) -> None:
    """Print the runs: a table with colours and lines on a terminal, plain text elsewhere."""
    console = Console(file=file, highlight=False)
    if not console.is_terminal:
        # a pipe has no width: rows must not be broken
        console = Console(file=file, highlight=False, no_color=True, width=140)
    console.print(summary_table(runs, title))


def criteria_failures(criteria: Mapping[str, Mapping[str, float]], runs: Iterable[Run]) -> list[str]:
    """The pass criteria of a mission that its runs miss, one line each.

    Criteria judge the estimator that flew; where none did (a replay), all of them. A quantity without a value
    (never acquired, no truth) meets no criterion.

    Args:
        criteria: quantity to its limits `min` and `max` (`Mission.criteria`).
        runs: of one flight, from `estimator_runs`.
    """
    runs = list(runs)
    judged = [run for run in runs if run["flown"]] or runs
    failures = []
    for quantity, limits in criteria.items():
        if quantity not in QUANTITIES:
            failures.append(f"criteria.{unknown_name(quantity, QUANTITIES)}")
            continue
        for run in judged:
            value = run[quantity]
            where = f"{run['estimator']}: {quantity}"
            if value is None:
                failures.append(f"{where} has no value, but criteria.{quantity} asks for one")
                continue
            low, high = limits.get("min"), limits.get("max")
            if low is not None and not value >= low:
                failures.append(f"{where} is {value:.6g}, below criteria.{quantity}.min {low:g}")
            if high is not None and not value <= high:
                failures.append(f"{where} is {value:.6g}, above criteria.{quantity}.max {high:g}")
    if criteria and not judged:
        failures.append("the flight has no Sun estimate that criteria could judge")
    return failures
