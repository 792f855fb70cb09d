# SPDX-License-Identifier: Apache-2.0
"""What the Sun filter attains, flown in its mission and changes of it, beside the estimators of the paper."""

from collections.abc import Iterator

import numpy as np
import pyarrow as pa

from css_common.mission import load_mission
from css_estimation.sun.offered import estimators
from css_monte_carlo.study import run_study
from css_papers.best.calibration import calibration_section
from css_papers.best.headings import ErrorsOverTheSky, all_layouts, directions, headings, over_the_sky
from css_papers.best.scenarios import FILTER, Scenario, scenarios
from css_papers.best.three_axes import three_axes
from css_papers.page import Listing, Page, Section, Table, write_page
from css_papers.papers import Request
from css_papers.rows import Must, Row, notes_of, number, row, table_of
from css_papers.study_columns import column, mean_of

TITLE = "What the Sun filter attains: clouds, dusk, other layouts, no gyro"

_CONSISTENT = Must(0.8, 1.2)
_FOUND = Must(1.0)
_SKY, _SKY_QUICK, _SKY_NOISE = 500, 60, 0.02

_COLUMNS = (
    ("heading error, sunlit [deg]", "heading_error_mean_deg"),
    ("95 % [deg]", "heading_error_p95_deg"),
    ("from the first light on [deg]", "heading_error_sunlit_deg"),
    ("late [deg]", "heading_error_late_deg"),
    ("in eclipse [deg]", "heading_error_eclipse_deg"),
    ("minute after it [deg]", "heading_error_dawn_deg"),
    ("NEES / 2 (1)", "nees_mean"),
    ("NIS / dof (1)", "nis_mean"),
    ("longest converging [s]", "converging_s"),
)


def reproduce(request: Request) -> list[Row]:
    """Flies all scenarios with gyro and without, and writes the page; without the side ones when it must be quick."""
    flown = [scenario for scenario in scenarios() if not (request.quick and scenario.side)]
    rows: list[Row] = []
    lines = []
    spent = []
    for scenario in flown:
        name = "".join(c if c.isalnum() else "_" for c in scenario.label)
        configurations = [scenario.configuration(gyro) for gyro in scenario.gyros]
        progress = None if request.progress is None else request.progress(scenario.label)
        folder = request.folder / "studies" / f"{name}_{request.cases}"
        study = run_study(load_mission(scenario.mission), configurations, request.cases, folder, progress=progress)
        rows += _rows(scenario, study.cases)
        lines += list(_lines(scenario, study.cases))
        if study.flown:
            spent.append(f"{scenario.label}: {1e6 * study.cpu_s / study.flown:.1f} us a case and step, all of the loop")
    more = []
    if not request.quick:
        rows_of_axes, section = three_axes(request)
        rows += rows_of_axes
        more = [section, calibration_section()]
    missed = sum(not line.ok for line in rows)
    summary = f"{len(rows)} numbers, {missed or 'none'} of them not what they must be."
    heading = ["", *(title for title, _ in _COLUMNS)]
    sections = [
        Section("Numbers", [summary, Table(*table_of(rows)), Listing(notes_of(rows))]),
        Section("All scenarios", [Table(heading, lines)]),
        *more,
        Section("Every estimator on every layout, at rest", [*sky_tables(_SKY_QUICK if request.quick else _SKY)]),
        Section("What is measured", [Listing(_DEFINITIONS)]),
    ]
    if spent:
        sections.append(Section("Processor time of this run", [Listing(spent)]))
    lead = (
        f"{request.cases} cases of one orbit for each scenario, with gyro and without, closed loop. Attitude, rate, "
        "noise and the clouds of every 5 deg cell of the Earth are drawn for each case; the Earth is half as bright "
        "again as the filter's mean one. The filter knows its orbit but where it is said."
    )
    write_page(Page(TITLE, lead, sections), request.folder)
    return rows


def sky_tables(count: int) -> Iterator[str | Table]:
    """What each Sun estimator makes of each layout with the Sun in `count` directions, without noise and with it."""
    sky = directions(count)
    for noise in (0.0, _SKY_NOISE):
        yield (
            f"Mean / 95 % / worst error [deg] and share not valid [%] with the Sun in {count} directions, cells with "
            f"{noise:g} of noise, no Earth; each direction is begun anew and given 10 s. What a layout cannot show, no "
            "estimator knows: with one or two cells in the Sun, or all in a plane, the error is the layout's."
        )
        lines = []
        for name, kind in estimators().items():
            line = [name.replace("_", " ")]
            for layout in all_layouts():
                found = headings(kind, layout, sky, noise)
                line.append("refused" if found is None else _of_the_sky(over_the_sky(found)))
            lines.append(line)
        yield Table(["", *all_layouts()], lines)


def _of_the_sky(errors: ErrorsOverTheSky) -> str:
    angles = " / ".join("-" if value is None else f"{value:.1f}" for value in errors[:3])
    return f"{angles}, {100.0 * errors.not_valid:.0f} %"


_DEFINITIONS = (
    "heading error, sunlit: mean over the cases of the mean over sunlight after acquisition; 95 %: mean of percentiles",
    "from the first light on: the same with the search for the Sun",
    "late: the mean over the last 5 min of sunlight; after a calibration, over all sunlight after its manoeuvre",
    "NEES: mean over the samples of the whole flight with an error bar, before acquisition and in eclipse too, across "
    "the Sun line, over its two degrees of freedom",
    "NIS: normalised innovations squared for each degree of freedom, over the steps that had some",
    "harder truth: any date of a year; an orbit integrated under J2, its elements off by 100 m and 0.02 to 0.05 deg, "
    "that the filter takes for one that drifts evenly; clouds alike over 15 deg that drift by 10 m/s and have become "
    "others in 12 h; readings of cells and gyro one cycle old; wheels that rub, speeds in steps of 1 rpm",
    "NEES below its range: error bars too wide, as in eclipse without gyro for a torque that this truth does not have",
)


def _rows(scenario: Scenario, cases: pa.Table) -> list[Row]:
    """What is asked of the Sun filter; of others nothing is."""
    if scenario.estimator != FILTER:
        return []
    rows = []
    for gyro in scenario.gyros:
        values = {name: column(cases, scenario.configuration(gyro), name) for _, name in _COLUMNS}
        label, variant = scenario.label, "gyro" if gyro else "no gyro"
        must = None if scenario.error_must is None else Must(None, scenario.error_must)
        error = row(f"{label}: heading error", "deg", None, mean_of(values[scenario.error]), must, variant=variant)
        rows.append(error)
        if must is None:
            continue
        eclipse, nees = mean_of(values["heading_error_eclipse_deg"]), mean_of(values["nees_mean"])
        acquired = column(cases, scenario.configuration(gyro), "acquired_s")
        rows += [
            row(f"{label}: in eclipse", "deg", None, eclipse, Must(None, scenario.eclipse_must), variant=variant),
            row(f"{label}: NEES for each of 2", "-", None, nees, _CONSISTENT, variant=variant),
            row(f"{label}: NIS for each", "-", None, mean_of(values["nis_mean"]), _CONSISTENT, variant=variant),
            row(f"{label}: Sun found", "-", None, float(np.mean(np.isfinite(acquired))), _FOUND, variant=variant),
        ]
    return rows


def _lines(scenario: Scenario, cases: pa.Table) -> Iterator[list[str]]:
    for gyro in scenario.gyros:
        configuration = scenario.configuration(gyro)
        values = []
        for _, name in _COLUMNS:
            of_cases = column(cases, configuration, name)
            values.append(float(np.nanmax(of_cases)) if name == "converging_s" and len(of_cases) else mean_of(of_cases))
        yield [f"{scenario.label}, {'gyro' if gyro else 'no gyro'}", *(number(value) for value in values)]
