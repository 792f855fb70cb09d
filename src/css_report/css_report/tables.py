# SPDX-License-Identifier: Apache-2.0
"""Figures of merit, mission and versions as tables of a page."""

from collections.abc import Iterable, Mapping, Sequence

from css_analysis.estimator_runs import Run
from css_analysis.flight_log import FlightLog
from css_analysis.flight_metrics import windows_of
from css_analysis.flight_summary import Verdict
from css_analysis.quantities import flight_quantities
from css_analysis.quantity import Quantity
from css_report.blocks import MISSES, Table

NONE = "-"
"""What stands for a value that there is not."""


def merit_table(log: FlightLog, runs: Sequence[Run]) -> Table:
    """A line for each quantity that has a value, a column for each estimator."""
    known = flight_quantities(windows_of(log.mission))
    shown = [q for q in known.values() if any(run.get(q.name) is not None for run in runs)]
    heading = ["quantity", "unit", *map(run_label, runs)]
    return Table(heading, [[meaning(q), q.unit, *(value_text(q, run.get(q.name)) for run in runs)] for q in shown])


def run_label(run: Run) -> str:
    """Name of an estimator with what is to be known of it."""
    gyro = "gyro" if run["gyro"] == "on" else "no gyro"
    return f"{run['estimator']} ({gyro}{', flown' if run['flown'] else ''})"


def meaning(quantity: Quantity) -> str:
    """Name of a quantity in words, and as criteria and JSON have it."""
    return f"{quantity.name}: {quantity.description}"


def value_text(quantity: Quantity, value: float | None) -> str:
    """A value as a terminal shows it."""
    return NONE if value is None else quantity.form.format(value)


def verdict_table(verdicts: Iterable[Verdict]) -> Table:
    """Every limit of the pass criteria, and what became of it."""
    lines = []
    for verdict in verdicts:
        word = "at least" if verdict.bound == "min" else "at most"
        value = "no value" if verdict.value is None else f"{verdict.value:.6g}"
        passed = "met" if verdict.passed else f"missed {MISSES}"
        lines.append([verdict.quantity, verdict.estimator, value, f"{word} {verdict.limit:g}", passed])
    return Table(["criterion", "estimator", "value", "must be", "result"], lines)


def mapping_table(heading: tuple[str, str], entries: Mapping[str, str]) -> Table:
    """Names and values."""
    return Table(heading, [[name, value] for name, value in entries.items()])
