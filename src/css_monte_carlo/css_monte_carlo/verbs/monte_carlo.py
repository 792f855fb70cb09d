# SPDX-License-Identifier: Apache-2.0
"""Flies a study, and prints what came of it."""

import argparse
import itertools
import json
import re
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from css_analysis.quantities import Summary
from css_analysis.readable_table import ReadableTable
from css_analysis.study_criteria import judge, refuse_unknown_criteria
from css_analysis.study_summary import summaries_of
from css_common import places
from css_common.command import FAILED
from css_common.mission import Mission, load_mission
from css_monte_carlo.errors import StudyError
from css_monte_carlo.mission_parts import measured_estimators
from css_monte_carlo.progress import progress_bar
from css_monte_carlo.schedulers import DaskScheduler
from css_monte_carlo.study import Configuration, Study, run_study
from css_monte_carlo.study_summary import study_object
from css_report.after_run import write_page_after
from css_report.places import page_of
from css_report.study_page import study_page


def run(options: argparse.Namespace) -> int:
    """Flies the study that the options describe; the exit code."""
    _refuse_bad_numbers(options)
    overrides = list(options.overrides)
    if options.duration is not None:
        overrides.append(f"mission.duration={options.duration}")
    if options.seed is not None:
        overrides.append(f"mission.seed={options.seed}")
    mission = load_mission(options.mission, overrides)
    configurations = _configurations(mission, options)
    if mission.values.measures.required_share > 0.0:
        refuse_unknown_criteria(mission)
    for remark in mission.remarks:
        print(f"monte-carlo: {remark}", file=sys.stderr)
    folder = options.out or _default_folder(mission.name)
    messages = Console(stderr=True, highlight=False)
    begin = time.perf_counter()
    with progress_bar(messages) as bar:
        part = bar.add(mission.name)
        study = run_study(
            mission,
            configurations,
            options.cases,
            folder,
            first_case=options.first_case,
            sample_s=options.sample,
            guess_deg=options.guess,
            threads=options.threads,
            progress=lambda done, total: bar.tell(part, done, total),
            scheduler=DaskScheduler(options.scheduler) if options.scheduler else None,
        )
    result = study_object(study, time.perf_counter() - begin, time.process_time())
    print_study(study, result, Console(highlight=False))
    judged = judge(study)
    for line in itertools.chain.from_iterable(configuration.lines() for configuration in judged):
        print(line)
    if judged:
        result["criteria"] = [configuration.as_object() for configuration in judged]
    page = None
    if options.report:
        page = write_page_after("monte-carlo", lambda: study_page(study), page_of(study.folder))
    result["page"] = None if page is None else str(page)
    if options.json:
        print(json.dumps(result, allow_nan=False))
    unwritten = options.report and page is None
    return FAILED if unwritten or not all(configuration.passed for configuration in judged) else 0


def _refuse_bad_numbers(options: argparse.Namespace) -> None:
    limits = (
        ("--cases", options.cases, 1, "at least 1"),
        ("--first-case", options.first_case, 0, "at least 0"),
        ("--threads", options.threads, 1, "at least 1"),
    )
    for name, value, least, expected in limits:
        if value is not None and value < least:
            raise StudyError(f"{name}: {value} given, expected {expected}")
    if options.first_case + options.cases > 2**32:
        raise StudyError(f"--cases: {options.cases} from case {options.first_case} on, expected cases below 2**32")
    if not 0.0 < options.sample < 1e9:
        raise StudyError(f"--sample: {options.sample:g} given, expected seconds above 0")
    if not 0.0 <= options.guess <= 180.0:
        raise StudyError(f"--guess: {options.guess:g} given, expected 0 to 180 [deg]")


def _configurations(mission: Mission, options: argparse.Namespace) -> list[Configuration]:
    """Every estimator with every use of the gyro at every point of the sweeps."""
    axes = []
    for sweep in options.sweep:
        key, _, values = sweep.partition("=")
        points = [value.strip() for value in values.split(",") if value.strip()]
        if not points:
            raise StudyError(f"--sweep {sweep}: expected KEY=V1,V2,...")
        axes.append([f"{key.strip()}={value}" for value in points])
    measured = measured_estimators(mission)
    estimators = options.estimators or measured
    return [
        Configuration(estimator, gyro == "on", point)
        for point in itertools.product(*axes)
        for estimator in dict.fromkeys(estimators)
        for gyro in dict.fromkeys(options.gyro)
    ]


def _default_folder(mission: str) -> Path:
    return places.results("studies") / f"{mission}_{time.strftime('%Y%m%d_%H%M%S')}"


def print_study(study: Study, result: dict, console: Console) -> None:
    """A table of the configurations of each kind, the values of a sweep below each other, and where the files are."""
    rows = result["configurations"]
    for columns in dict.fromkeys(summaries_of(study, row["estimator"]) for row in rows):
        console.print(_study_table([row for row in rows if summaries_of(study, row["estimator"]) == columns], columns))
    if study.flown:
        console.print(
            f"{result['cases']} cases of {result['steps']} steps in {result['wall_s']:.1f} s wall, "
            f"{result['cpu_s']:.1f} s CPU: {result['cpu_ns_per_case_step']:.0f} ns a case and step"
        )
    else:
        console.print("this study was complete; nothing was flown")
    console.print(f"study: {study.folder}", soft_wrap=True)


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
        figures = ["-" if row[c.name] is None else c.form.format(row[c.name]) for c in columns]
        table.add_texts([row["estimator"], row["gyro"], *_swept(row).values(), *figures])
    return table


def _swept(row: dict) -> dict[str, str]:
    """Values of a configuration by the keys that are swept."""
    pairs = (override.partition("=") for override in row["overrides"])
    return {key: value for key, _, value in pairs}
