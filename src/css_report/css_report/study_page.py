# SPDX-License-Identifier: Apache-2.0
"""The page of a study, or of two beside each other."""

from collections.abc import Iterator
from itertools import groupby
from typing import Any

from css_analysis.flight_metrics import windows_of
from css_analysis.intervals import Interval
from css_analysis.quantity import Summary
from css_analysis.study_criteria import judge
from css_analysis.study_health import health_of_cases
from css_analysis.study_record import StudyRecord
from css_analysis.study_summary import cases_with_value, interval_over, rows_of, summaries_of, value_over
from css_common.mission import mission_from_text
from css_report.blocks import Block, Commands, Listing, Page, Section, Table
from css_report.comparison import beside
from css_report.study_commands import WorstCase, mission_reference, worst_cases
from css_report.study_plots import configuration_label, histogram_plots, percentile_plots
from css_report.tables import NONE, mapping_table

_INTERVALS = (
    "In brackets: 95 % confidence intervals. Of means by bootstrap, of shares by Clopper and Pearson, of percentiles "
    "by order statistics; a largest value has none. Cases without a value of a quantity are left out of it."
)


def study_page(study: StudyRecord, against: StudyRecord | None = None) -> Page:
    """The page of one study, or of two beside each other.

    Raises:
        StudyError: a study is damaged.
        MissionError: its mission is not valid here.
        ReportError: a mission that is in no file cannot be written into the folder of the study.
    """
    sections = _sections(study)
    if against is None:
        return Page(f"{study.manifest['mission']}, {study.manifest['cases']} cases", _lead(study), sections)
    names = (str(study.folder), str(against.folder))
    lead = f"{_lead(study)} Beside it: {_lead(against)}"
    return Page(f"{names[0]} and {names[1]}", lead, beside(names, sections, _sections(against)))


def _lead(study: StudyRecord) -> str:
    m = study.manifest
    first = m["first_case"]
    return (
        f"{study.folder}: {m['mission']}, cases {first} to {first + m['cases'] - 1} of {m['steps']} steps in "
        f"{len(m['configurations'])} configurations, which share their draws."
    )


def _sections(study: StudyRecord) -> list[Section]:
    mission = mission_from_text(study.manifest["mission_text"], str(study.folder))
    parts: dict[str, list[Block]] = {
        "Summary": list(_summary(study)),
        "Percentiles against time": list(percentile_plots(study)),
        "Cases": list(histogram_plots(study, windows_of(mission))),
        "Worst cases": list(_worst(study)),
        "Mission and versions": [
            mapping_table(("what flew it", "version"), {k: str(v) for k, v in study.manifest["versions"].items()}),
            Commands([("The mission as it flew", study.manifest["mission_text"].rstrip("\n"))]),
        ],
    }
    if parts["Cases"]:
        parts["Cases"].insert(0, "Bars: share of the cases. Whiskers: its 95 % interval by Clopper and Pearson.")
    return [Section(title, blocks) for title, blocks in parts.items() if blocks]


def _summary(study: StudyRecord) -> Iterator[Block]:
    configurations = study.manifest["configurations"]
    # attitude filters and Sun estimators are measured by different quantities
    kinds = groupby(configurations, lambda labels: summaries_of(study, labels["estimator"]))
    for columns, group in kinds:
        same = list(group)
        lines = [[_title(c), *(_told(study, labels, c) for labels in same)] for c in columns]
        yield Table(["over the cases", *map(configuration_label, same)], lines)
    yield _INTERVALS
    health = [line for configuration in health_of_cases(study) for line in configuration.lines()]
    if health:
        yield Listing(health)
    judged = judge(study)
    if judged:
        yield Listing([line for configuration in judged for line in configuration.lines()])


def _title(summary: Summary) -> str:
    unit = f" [{summary.unit}]" if summary.unit else ""
    return f"{summary.name}: {summary.over} of {summary.of}{unit}"


def _told(study: StudyRecord, labels: dict[str, Any], summary: Summary) -> str:
    cases = rows_of(study.cases, **labels)
    value = value_over(cases, summary)
    if value is None:
        return NONE
    text = summary.form.format(value)
    text = text if summary.over == "max" else f"{text} ({_ends(interval_over(cases, summary), summary.form)})"
    known = cases_with_value(cases, summary)
    return text if known == cases.num_rows else f"{text}, of {known} of {cases.num_rows} cases"


def _ends(ends: Interval, form: str) -> str:
    low, high = (NONE if end is None else form.format(end) for end in ends)
    return f"{low} to {high}"


def _worst(study: StudyRecord) -> Iterator[Block]:
    found = list(worst_cases(study, mission_reference(study)))
    if not found:
        return
    yield "Each command flies the case on the graph, where it becomes what it was in the study."
    if study.manifest.get("guess_deg"):
        yield "The study gave attitude filters a first guess; a flight on the graph begins as its parameters say."
    for configuration, cases in groupby(found, lambda worst: worst.configuration):
        by_command: dict[str, list[WorstCase]] = {}
        for worst in cases:
            by_command.setdefault(worst.command, []).append(worst)
        yield Commands(
            [(f"{configuration}, case {w[0].case}: {_why(w)}", command) for command, w in by_command.items()]
        )


def _why(same: list[WorstCase]) -> str:
    return "; ".join(
        f"{worst.quantity} {'has no value' if worst.value is None else f'{worst.value:.4g} {worst.unit}'.strip()}"
        for worst in same
    )
