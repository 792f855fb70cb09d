# SPDX-License-Identifier: Apache-2.0
"""Every fault on every mission: power, errors, and what was found of it, beside the same cases without the fault."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from css_common.mission import Mission
from css_monte_carlo.study import Configuration, Study, run_study
from css_papers.faults.blind import blind_section, harmless_pairs
from css_papers.faults.cost import cost_ns
from css_papers.faults.kinds import BOARD, CELL, NONE, PAIR, Fault
from css_papers.faults.measured import Outcome, counted_cases, failed_cells, outcome
from css_papers.faults.missions import Subject, absents, subjects
from css_papers.page import Listing, Page, Section, Table, write_page
from css_papers.papers import Request
from css_papers.rows import Must, Row, number, row
from css_papers.study_columns import column

TITLE = "The worst day: what fails, what is found, and what it costs"
CASES, QUICK_CASES = 20, 8

_ALL, _NAMED, _ALMOST_ALL, _NONE = Must(1.0), Must(0.99), Must(0.95), Must(None, 0.0)
_LATER, _RATIO = Must(None, 60.0), Must(None, 1.5)
_HEADING = (
    "fault",
    "cases",
    "in power",
    "later, median [s]",
    "later, most [s]",
    "error / without the cell",
    "shows in",
    "found",
    "median [s]",
    "95 % [s]",
    "named rightly",
    "false",
    "NIS / dof",
)
_DEFINITIONS = (
    "cases: one orbit or more from any attitude, at any date, under clouds of its own, with cells that nobody has "
    "calibrated (gains 2 %, tilts 1 deg); the unit that fails and when it does are drawn for each",
    "in power: at the last step in sunlight the Sun is within 30 deg of the array normal",
    "in power, of pairs of cells: over all cases; the numbers of `--json` have besides those whose pair is not needed "
    "in power: without it as many directions there are seen by two cells",
    "later: sunlit time with the Sun beyond 30 deg of the array normal, less that of the same case without the fault",
    "error / without the cell: mean heading error over the cases, over that of the same cases flown by a mission whose "
    "layout never had the cell that fails",
    "shows: a cell is off by more than 5 sigma of what a healthy reading is uncertain by (noise, losses, calibration, "
    "0.4 of the light of the Earth on it); other units from when they fail",
    "found: of the cases in which a fault shows, those in which all that show are isolated; times from when it shows",
    "named rightly: of those found, the cases in which every cell was last taken for what it is; one class are: dead "
    "and stuck at zero, frozen there or with the wrong sign before a converter without negative readings; stuck, "
    "frozen and at the high end; scaled, shadowed and saturated; noisy and spikes",
    "false: isolations of units that did not fail, in all cases together",
)


class Flown(NamedTuple):
    """All lines of one subject."""

    subject: Subject
    mission: Mission
    outcomes: Mapping[Fault, Outcome]
    cost_ns: float
    spent: str  # what the study took, empty when it was there


def reproduce(request: Request) -> list[Row]:
    """Flies all faults on all missions, and writes the page."""
    chosen = [subject for subject in subjects() if subject.quick or not request.quick]
    flown = [fly(subject, request) for subject in chosen]
    rows = [line for each in flown for line in rows_of(each)]
    judged = [line for line in rows if line.must is not None]
    missed = [line for line in judged if not line.ok]
    summary = f"{len(judged)} numbers have to be in a range, {len(missed) or 'none'} of them are not."
    sections = [
        Section("What is missed", [summary, Listing(_missed(missed))]),
        *(Section(each.subject.label, [_about(each), Table(_HEADING, list(_lines(each)))]) for each in flown),
        blind_section({each.subject.label: each.mission for each in flown if PAIR in each.subject.sorts}),
        Section("What is measured", [Listing(_DEFINITIONS)]),
    ]
    spent = [each.spent for each in flown if each.spent]
    if spent:
        sections.append(Section("Processor time of this run", [Listing(spent)]))
    lead = f"{request.cases} cases of each line. Every line is one fault; all missions fly as they are otherwise."
    write_page(Page(TITLE, lead, sections), request.folder)
    return rows


def fly(subject: Subject, request: Request) -> Flown:
    """Flies all lines of a subject."""
    mission = subject.loaded(request.quick)
    faults = subject.faults(request.quick)
    configurations = {fault: subject.configuration(fault, request.quick) for fault in faults}
    cells_fail = any(fault.sort in (CELL, BOARD) for fault in faults)
    without = list(absents(subject, mission)) if cells_fail else []
    name = "".join(c if c.isalnum() else "_" for c in subject.label)
    folder = request.folder / "studies" / f"{name}_{request.cases}{'_quick' if request.quick else ''}"
    asked = [*configurations.values(), *dict.fromkeys(each.configuration for each in without)]
    progress = None if request.progress is None else request.progress(subject.label)
    study = run_study(mission, asked, request.cases, folder, sample_s=10.0, progress=progress)
    lacking = {
        frozenset(each.cells): column(study.cases, each.configuration, "heading_error_mean_deg") for each in without
    }
    seen = harmless_pairs(mission) if PAIR in subject.sorts else []
    outcomes = {
        fault: _outcome(fault, configuration, configurations[NONE], mission, study.cases, lacking, seen, request.cases)
        for fault, configuration in configurations.items()
    }
    return Flown(subject, mission, outcomes, cost_ns(mission, configurations[NONE]), _spent(subject, study))


def _outcome(
    fault: Fault,
    flown: Configuration,
    healthy: Configuration,
    mission: Mission,
    cases: pa.Table,
    lacking: Mapping[frozenset[int], np.ndarray],
    seen: Sequence[frozenset[int]],
    count: int,
) -> Outcome:
    failed = failed_cells(flown.applied(mission), count)
    return outcome(
        lambda name: column(cases, flown, name),
        lambda name: column(cases, healthy, name),
        counted_cases(fault, failed),
        lacking,
        failed,
        seen,
    )


def _spent(subject: Subject, study: Study) -> str:
    if not study.flown:
        return ""
    return f"{subject.label}: {1e6 * study.cpu_s / study.flown:.1f} us a case and step, all of the loop"


def rows_of(flown: Flown) -> Iterator[Row]:
    """What is asked of each line."""
    variant = flown.subject.label
    for fault, found in flown.outcomes.items():
        label = fault.label
        if fault is NONE:
            yield row(f"{label}: false isolations", "-", None, found.false, _NONE, variant=variant)
            yield row(f"{label}: in power", "-", None, found.power, variant=variant)
            continue
        single = fault.sort not in (PAIR, BOARD)
        power = _ALMOST_ALL if fault.sort == PAIR else _ALL if single else None
        yield row(f"{label}: in power", "-", None, found.power, power, variant=variant)
        if fault.sort == PAIR and found.power_seen is not None:
            where = "in power where the pair is not needed there"
            yield row(f"{label}: {where}", "-", None, found.power_seen, variant=variant)
        later = found.later_max if found.later_max is not None and math.isfinite(found.later_max) else None
        yield row(f"{label}: later, most", "s", None, later, _LATER if single else None, variant=variant)
        if fault.sort == CELL:
            yield row(f"{label}: error / without the cell", "-", None, found.ratio, _RATIO, variant=variant)
        if found.shown:
            must = _ALL if fault.prompt else None
            yield row(f"{label}: found within 10 s", "-", None, found.promptly, must, variant=variant)
        if found.named is not None:
            must = _NAMED if fault.sort == CELL else None
            yield row(f"{label}: named rightly", "-", None, found.named, must, variant=variant)
        yield row(f"{label}: false isolations", "-", None, found.false, variant=variant)
    yield row("finding faults, a step", "ns", None, flown.cost_ns, variant=variant)


def _missed(lines: Sequence[Row]) -> list[str]:
    """A text for each line of the page that misses something."""
    by_line: dict[tuple[str, str], list[str]] = {}
    for line in lines:
        fault, _, asked = line.quantity.partition(": ")
        unit = "" if line.unit == "-" else f" {line.unit}"
        by_line.setdefault((line.variant, fault), []).append(f"{asked} {number(line.here)}{unit} ({line.must})")
    return [f"{subject}, {fault}: {'; '.join(texts)}" for (subject, fault), texts in by_line.items()]


def _about(flown: Flown) -> str:
    mission = flown.mission
    minutes = mission.steps * mission.period_ns * 1e-9 / 60.0
    return (
        f"{mission.name} with {flown.subject.estimator}, {minutes:.0f} min; finding faults takes "
        f"{flown.cost_ns:.0f} ns of processor time a step."
    )


def _lines(flown: Flown) -> Iterator[list[str]]:
    for fault, found in flown.outcomes.items():
        of_fault = ["", "", "", "", ""] if fault is NONE else _found(found)
        later = ["", ""] if fault is NONE else [_time(found.later_median), _time(found.later_max)]
        yield [
            fault.label,
            str(found.cases),
            _percent(found.power),
            *later,
            "" if found.ratio is None else number(found.ratio),
            *of_fault,
            str(found.false),
            number(found.nis),
        ]


def _found(found: Outcome) -> list[str]:
    times = [number(found.detected_median), number(found.detected_p95)]
    return [str(found.shown), _percent(found.detected), *times, _percent(found.named)]


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100.0 * share:.1f} %"


def _time(time_s: float | None) -> str:
    return "never" if time_s is not None and math.isinf(time_s) else number(time_s)
