# SPDX-License-Identifier: Apache-2.0
"""What people read of the runs of a flight: a table, and the mission's pass criteria that they miss."""

from collections.abc import Iterable, Mapping, Sequence
from typing import TextIO

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from css_common.schema import unknown_name
from css_studies.flight_metrics import QUANTITIES, Run

_COLUMNS = {
    "power_positive_s": ("con-\nverging\n[s]", "{:.1f}"),
    "heading_error_mean_deg": ("heading\nerror\nmean\n[deg]", "{:.2f}"),
    "heading_error_p95_deg": ("heading\nerror\n95 %\n[deg]", "{:.2f}"),
    "attitude_error_mean_deg": ("attitude\nerror\nmean\n[deg]", "{:.3f}"),
    "attitude_error_p95_deg": ("attitude\nerror\n95 %\n[deg]", "{:.3f}"),
    "attitude_nees": ("attitude\nNEES\n(3)", "{:.2f}"),
    "pointing_error_mean_deg": ("pointing\nerror\nmean\n[deg]", "{:.2f}"),
    "rate_final_deg_s": ("final\nrate\n[deg/s]", "{:.3f}"),
    "steps_without_estimate": ("steps\nwithout\nestimate", "{:d}"),
}


def summary_table(runs: Iterable[Run], title: str = "") -> Table:
    """The runs as a table for a `rich` console; what is unknown or was never reached is a dash.

    It fits into 80 columns, which is what a console has that is no terminal.
    """
    runs = list(runs)
    table = Table(title=title or None, title_justify="left", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("estimator", no_wrap=True)
    table.add_column("gyro")
    columns = _columns_of(runs)
    for heading, _ in columns.values():
        # as Text, because markup would take a unit for a style
        table.add_column(Text(heading), justify="right")
    for run in runs:
        shown = []
        for quantity, (_, text) in columns.items():
            value = run[quantity]
            shown.append("-" if value is None else text.format(value))
        table.add_row(Text(run["estimator"] + (" (flown)" if run["flown"] else "")), run["gyro"], *shown)
    return table


def _columns_of(runs: Sequence[Run]) -> dict[str, tuple[str, str]]:
    """The columns of Sun estimators, and where there are attitude filters, theirs and what else has a value."""
    if any(run["attitude_error_mean_deg"] is not None for run in runs):
        return {name: column for name, column in _COLUMNS.items() if any(run[name] is not None for run in runs)}
    return {name: column for name, column in _COLUMNS.items() if not name.startswith("attitude")}


def print_summary(runs: Iterable[Run], title: str = "", file: TextIO | None = None) -> None:
    """Print the runs, in colours on a terminal."""
    Console(file=file, highlight=False).print(summary_table(runs, title))


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
        failures.append("the flight has no estimate that criteria could judge")
    return failures
