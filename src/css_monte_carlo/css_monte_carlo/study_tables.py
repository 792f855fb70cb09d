# SPDX-License-Identifier: Apache-2.0
"""What a terminal shows of a study: its configurations, which parameters matter, the worst flight."""

import re
from collections.abc import Iterator, Sequence

from rich.console import Console

from css_analysis.intervals import beyond_largest
from css_analysis.quantity import Summary
from css_analysis.readable_table import ReadableTable
from css_analysis.study_health import health_of_cases
from css_analysis.study_summary import summaries_of
from css_common.drawn_mission import assignments
from css_monte_carlo.sensitivity import Sensitivity
from css_monte_carlo.study import Study
from css_monte_carlo.worst_case import Worst


def print_study(study: Study, result: dict, console: Console) -> None:
    """A table of the configurations of each kind, the values of a sweep below each other, and where the files are."""
    rows = result["configurations"]
    for columns in dict.fromkeys(summaries_of(study, row["estimator"]) for row in rows):
        console.print(_study_table([row for row in rows if summaries_of(study, row["estimator"]) == columns], columns))
    console.print("from, to: 95 % intervals of the numbers above them")
    beyond = beyond_largest(result["cases"])
    if beyond is not None and any(c.over == "max" for row in rows for c in summaries_of(study, row["estimator"])):
        console.print(f"of all cases at most {beyond:.1%} are beyond a max of {result['cases']} (95 % confidence)")
    for row in rows:
        for line in _incomplete(row, summaries_of(study, row["estimator"]), result["cases"]):
            console.print(line, soft_wrap=True)
    for health in health_of_cases(study):
        for line in health.lines():
            console.print(line, soft_wrap=True)
    if study.flown:
        console.print(
            f"{result['cases']} cases of {result['steps']} steps in {result['wall_s']:.1f} s wall, "
            f"{result['cpu_s']:.1f} s CPU: {result['cpu_ns_per_case_step']:.0f} ns a case and step"
        )
    else:
        console.print("this study was complete; nothing was flown")
    console.print(f"study: {study.folder}", soft_wrap=True)


def _incomplete(row: dict, columns: Sequence[Summary], cases: int) -> Iterator[str]:
    """Which figures of a configuration are of some of its cases alone."""
    by_count: dict[int, list[str]] = {}
    for column in columns:
        known = row["cases_with_value"][column.name]
        if 0 < known < cases:
            by_count.setdefault(known, []).append(column.name)
    label = " ".join([row["estimator"], f"gyro {row['gyro']}", *row["overrides"]])
    for known, names in by_count.items():
        yield f"only {known} of {cases} cases of {label} have a value of {', '.join(names)}"


def _study_table(rows: Sequence[dict], columns: Sequence[Summary]) -> ReadableTable:
    table = ReadableTable()
    table.add_name("estimator")
    table.add_number("gyro")
    for key in _swept(rows[0]):
        table.add_number(re.sub(r"(?<=[._])", "\n", key))
    for column in columns:
        table.add_number(column.title)
    # configurations go point by point; what one estimator makes of a sweep is read down a column
    kinds = list(dict.fromkeys((row["estimator"], row["gyro"]) for row in rows))
    for row in sorted(rows, key=lambda row: kinds.index((row["estimator"], row["gyro"]))):
        figures = [_figure(c, row[c.name]) for c in columns]
        table.add_texts([row["estimator"], row["gyro"], *_swept(row).values(), *figures])
        for end, name in enumerate(("from", "to")):
            ends = [_figure(c, row["interval_95"][c.name][end]) for c in columns]
            table.add_texts([f"  {name}", "", *("" for _ in _swept(row)), *ends])
    return table


def _figure(column: Summary, value: float | None) -> str:
    return "-" if value is None else column.form.format(value)


def _swept(row: dict) -> dict[str, str]:
    """Values of a configuration by the keys that are swept."""
    pairs = (override.partition("=") for override in row["overrides"])
    return {key: value for key, _, value in pairs}


def print_sensitivity(found: Sequence[Sensitivity], console: Console) -> None:
    """A table of Sobol indices for each configuration, and what was left out."""
    for one in found:
        gyro = "on" if one.labels["gyro"] else "off"
        named = " ".join(filter(None, (one.labels["estimator"], f"gyro {gyro}", one.labels["overrides"])))
        console.print(f"\nwhat {one.quantity} of {named} depends on, shares of its variance:")
        if not one.indices:
            console.print(f"  no indices: {one.left_out} of {one.points} base points have flights without a value")
            continue
        table = ReadableTable()
        table.add_name("drawn")
        for heading in ("alone", "95 %\nfrom", "to", "with\nothers", "95 %\nfrom", "to"):
            table.add_number(heading)
        for i in one.indices:
            ends = (i.first, i.first - i.first_half, i.first + i.first_half)
            totals = (i.total, i.total - i.total_half, i.total + i.total_half)
            table.add_texts([i.parameter, *(f"{share:.1%}" for share in (*ends, *totals))])
        console.print(table)
        if one.left_out:
            console.print(f"{one.left_out} of {one.points} base points have flights without a value and are left out")


def print_worst(found: Sequence[Worst], console: Console) -> None:
    """The worst flight of each configuration, and the command that flies it."""
    for one in found:
        value, of_study = ("none" if v is None else f"{v:.6g}" for v in (one.value, one.in_study))
        ended = ", interrupted" if one.interrupted else ""
        console.print(
            f"\nworst {one.quantity} found: {value}, {of_study} in the study; {one.flights} flights more{ended}"
        )
        console.print("  " + ", ".join([f"case {one.case}", *assignments(one.drawn)]), soft_wrap=True)
        console.print(f"  {one.command}", soft_wrap=True)
