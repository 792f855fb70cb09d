# SPDX-License-Identifier: Apache-2.0
"""What people read of the runs of a flight: a table, and the mission's pass criteria that they miss."""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from css_analysis.estimator_runs import Run
from css_analysis.quantities import QUANTITIES
from css_analysis.quantity import Quantity
from css_analysis.readable_table import ReadableTable
from css_common.schema import unknown_name

_COLUMNS = [quantity for quantity in QUANTITIES.values() if quantity.heading]


def summary_table(runs: Iterable[Run], title: str = "") -> ReadableTable:
    """The runs as a table for a `rich` console; what is unknown or was never reached is a dash.

    It fits into 80 columns, which is what a console has that is no terminal; in fewer each run is a block of lines.
    """
    runs = list(runs)
    table = ReadableTable(title or None)
    table.add_name("estimator")
    table.add_number("gyro")
    columns = _columns_of(runs)
    for quantity in columns:
        table.add_number(quantity.title)
    for run in runs:
        shown = []
        for quantity in columns:
            value = run[quantity.name]
            shown.append("-" if value is None else quantity.form.format(value))
        table.add_texts([run["estimator"] + (" (flown)" if run["flown"] else ""), run["gyro"], *shown])
    return table


def _columns_of(runs: Sequence[Run]) -> list[Quantity]:
    """The columns of Sun estimators, and where there are attitude filters, theirs and what else has a value."""
    asked_for = [quantity for quantity in _COLUMNS if all(quantity.name in run for run in runs)]
    if any(run["attitude_error_mean_deg"] is not None for run in runs):
        return [quantity for quantity in asked_for if any(run[quantity.name] is not None for run in runs)]
    return [quantity for quantity in asked_for if not quantity.name.startswith("attitude")]


def isolated_lines(runs: Iterable[Run]) -> list[str]:
    """A line for each run that left out cells for failed."""
    return [_isolated_line(run) for run in runs if run.get("isolated_cells")]


def _isolated_line(run: Run) -> str:
    cells, flown = run["isolated_cells"], " (flown)" if run["flown"] else ""
    numbers = f"{'cell' if len(cells) == 1 else 'cells'} {', '.join(map(str, cells))}"
    return f"{run['estimator']}{flown} left out {numbers} for failed, for some time or all"


class Verdict(NamedTuple):
    """What became of one limit of one criterion."""

    estimator: str
    quantity: str
    value: float | None  # None: it has none
    bound: str  # "min" or "max"
    limit: float

    @property
    def passed(self) -> bool:
        """Whether the criterion is met; a quantity without a value meets none."""
        if self.value is None:
            return False
        return self.value >= self.limit if self.bound == "min" else self.value <= self.limit

    def line(self) -> str:
        """PASS or FAIL, and why."""
        word = "PASS" if self.passed else "FAIL"
        value = "no value" if self.value is None else f"{self.value:.6g}"
        relation = "at least" if self.bound == "min" else "at most"
        return f"{word}  {self.quantity} {value}, must be {relation} {self.limit:g}  ({self.estimator})"


def criteria_verdicts(criteria: Mapping[str, Mapping[str, float]], runs: Iterable[Run]) -> list[Verdict]:
    """Every limit of the pass criteria that are known, for every run that they judge (see `criteria_failures`)."""
    runs = list(runs)
    judged = [run for run in runs if run["flown"]] or runs
    return [
        Verdict(run["estimator"], quantity, run.get(quantity), bound, limits[bound])
        for quantity, limits in criteria.items()
        if quantity in QUANTITIES
        for run in judged
        for bound in ("min", "max")
        if limits.get(bound) is not None
    ]


def criteria_failures(criteria: Mapping[str, Mapping[str, float]], runs: Iterable[Run]) -> list[str]:
    """The pass criteria of a mission that its runs miss, one line each.

    Criteria judge the estimator that flew; where none did (a replay), all of them. A quantity without a value
    (never acquired, no truth) meets no criterion.

    Args:
        criteria: quantity to its limits `min` and `max` (`Mission.criteria`).
        runs: of one flight, from `estimator_runs`.
    """
    runs = list(runs)
    unknown = [quantity for quantity in criteria if quantity not in QUANTITIES]
    failures = [f"criteria.{unknown_name(quantity, QUANTITIES)}" for quantity in unknown]
    missed = [verdict for verdict in criteria_verdicts(criteria, runs) if not verdict.passed]
    failures += dict.fromkeys(map(_failure, missed))
    if criteria and not runs:
        failures.append("the flight has no estimate that criteria could judge")
    return failures


def _failure(missed: Verdict) -> str:
    where, criterion = f"{missed.estimator}: {missed.quantity}", f"criteria.{missed.quantity}"
    if missed.value is None:
        why = QUANTITIES[missed.quantity].without_value or "truth or estimates are missing"
        return f"{where} has no value, but {criterion} asks for one: {why}"
    side = "below" if missed.bound == "min" else "above"
    return f"{where} is {missed.value:.6g}, {side} {criterion}.{missed.bound} {missed.limit:g}"
