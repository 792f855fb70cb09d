# SPDX-License-Identifier: Apache-2.0
"""Flies a study, and prints what came of it."""

import argparse
import itertools
import json
import sys
import time
from pathlib import Path

from rich.console import Console

from css_analysis.configured_mission import flies_with_gyro
from css_analysis.errors import StudyError
from css_analysis.study_criteria import judge, refuse_unknown_criteria
from css_common import places
from css_common.command import FAILED, INTERRUPTED
from css_common.dispersions import SECTION
from css_common.mission import Mission, load_mission
from css_common.sampling import design_size
from css_common.sensor_inputs import measures_rates
from css_monte_carlo.mission_parts import measured_estimators
from css_monte_carlo.progress import CaseProgress, progress_bar
from css_monte_carlo.schedulers import DaskScheduler
from css_monte_carlo.sensitivity import sensitivities
from css_monte_carlo.study import Configuration, Study, run_study
from css_monte_carlo.study_summary import study_object
from css_monte_carlo.study_tables import print_sensitivity, print_study, print_worst
from css_monte_carlo.worst_case import Worst, find_worst
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
    overrides += [f"{SECTION}{text}" for text in options.disperse]
    mission, cases = _sampled(load_mission(options.mission, overrides), options)
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
            cases,
            folder,
            first_case=options.first_case,
            sample_s=options.sample,
            guess_deg=options.guess,
            threads=options.threads,
            progress=lambda done, total: bar.tell(part, done, total),
            scheduler=DaskScheduler(options.scheduler) if options.scheduler else None,
        )
        result = study_object(study, time.perf_counter() - begin, time.process_time())
        worst = _worst_flights(mission, configurations, study, options, bar)
    print_study(study, result, Console(highlight=False))
    if options.sensitivity is not None:
        indices = sensitivities(study, options.sensitivity)
        print_sensitivity(indices, Console(highlight=False))
        result["sensitivity"] = [one.as_object() for one in indices]
    if worst:
        print_worst(worst, Console(highlight=False))
        result["worst"] = [one.as_object() for one in worst]
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
    if any(one.interrupted for one in worst):
        return INTERRUPTED
    unwritten = options.report and page is None
    return FAILED if unwritten or not all(configuration.passed for configuration in judged) else 0


def _sampled(mission: Mission, options: argparse.Namespace) -> tuple[Mission, int]:
    """The mission with the design that its dispersed parameters are drawn by, and the cases that this takes."""
    wants = [f"--{name}" for name in ("sampling", "sensitivity") if getattr(options, name) is not None]
    if wants and not mission.dispersions:
        raise StudyError(f"{wants[0]}: the mission disperses nothing, expected --disperse or a section dispersions")
    if options.sensitivity is not None:
        if options.sampling is not None or options.first_case:
            raise StudyError("--sensitivity: draws by a design of its own, expected no --sampling and no --first-case")
        base = 1 << (options.cases - 1).bit_length()
        mission = mission.with_overrides(["sampling.method=saltelli", f"sampling.cases={base}"])
        return mission, design_size(mission.dispersions, mission.values.sampling)
    if options.sampling is not None:
        mission = mission.with_overrides([f"sampling.method={options.sampling}"])
    last = options.first_case + options.cases
    method, size = mission.values.sampling.method, design_size(mission.dispersions, mission.values.sampling)
    if method == "lhs" and (size == 0 or options.sampling is not None):
        return mission.with_overrides([f"sampling.cases={last}"]), options.cases
    if mission.dispersions and method in ("lhs", "saltelli") and last > size:
        raise StudyError(f"--cases: case {last - 1} asked for, but sampling.cases of the mission gives {size} cases")
    if mission.dispersions and method == "sobol" and options.cases & (options.cases - 1):
        print(
            f"monte-carlo: {options.cases} cases are no power of 2, which a Sobol sequence fills best", file=sys.stderr
        )
    return mission, options.cases


def _worst_flights(
    mission: Mission, configurations: list[Configuration], study: Study, options: argparse.Namespace, bar: CaseProgress
) -> list[Worst]:
    found: list[Worst] = []
    for configuration in configurations if options.worst is not None else ():
        part = bar.add(f"worst case of {configuration.estimator}")
        found.append(
            find_worst(
                mission,
                configuration,
                study,
                options.worst_flights,
                options.worst,
                threads=options.threads,
                progress=lambda done, total, part=part: bar.tell(part, done, total),  # type: ignore[misc]
            )
        )
        if found[-1].interrupted:
            break
    return found


def _refuse_bad_numbers(options: argparse.Namespace) -> None:
    limits = (
        ("--cases", options.cases, 1, "at least 1"),
        ("--first-case", options.first_case, 0, "at least 0"),
        ("--threads", options.threads, 1, "at least 1"),
        ("--worst-flights", options.worst_flights, 1, "at least 1"),
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
        Configuration(estimator, gyro, point)
        for point in itertools.product(*axes)
        for estimator in dict.fromkeys(estimators)
        for gyro in _gyros(mission, estimator, options.gyro)
    ]


def _gyros(mission: Mission, estimator: str, asked: list[str] | None) -> list[bool]:
    """Whether an estimator flies with its gyro, without, or both."""
    if asked is None:
        return [flies_with_gyro(mission, estimator)]
    if "on" in asked and not measures_rates(mission.nodes):
        raise StudyError(f"--gyro on: {mission.origin} has no gyro in graph.nodes; expected off")
    return [gyro == "on" for gyro in dict.fromkeys(asked)]


def _default_folder(mission: str) -> Path:
    return places.results("studies") / f"{mission}_{time.strftime('%Y%m%d_%H%M%S')}"
