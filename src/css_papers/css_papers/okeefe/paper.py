# SPDX-License-Identifier: Apache-2.0
"""Figures and numbers of O'Keefe & Schaub 2013, from flights of the mission `okeefe_2013`."""

from collections.abc import Sequence

from css_common.mission import Mission, load_mission
from css_monte_carlo.study import Configuration, Study, run_study
from css_papers.okeefe import calibration_page
from css_papers.okeefe.configurations import AS_PRINTED, IMPROVED, MISSION
from css_papers.okeefe.flight_figures import Variant
from css_papers.okeefe.flight_part import flight_part, settings
from css_papers.okeefe.numbers import MEASURED, notable
from css_papers.okeefe.one_change import control_configurations, control_table, difference_notes
from css_papers.okeefe.sensor_part import sensor_part
from css_papers.okeefe.sweeps import sweep_configurations
from css_papers.page import Link, Listing, Page, Section, Table, write_page
from css_papers.papers import Request
from css_papers.rows import Row, notes_of, table_of

TITLE = "O'Keefe & Schaub, Sun heading estimation using underdetermined set of coarse sun sensors, AAS 13-891 (2013)"

_SIDE_SHARE = 10  # flights of a configuration of the paper for one of a side study


def reproduce(request: Request) -> list[Row]:
    """Writes figures and pages; without controls and the second page when it must be quick."""
    mission = load_mission(MISSION)
    sensors = sensor_part(mission, request.folder)
    configurations = [entry.configuration for entry in (*AS_PRINTED, *IMPROVED)]
    flown = _fly(mission, configurations, request.cases, "flights", request)
    printed = Variant("as the paper", True, AS_PRINTED, flown.cases, flown.percentiles)
    improved = Variant("improved", False, IMPROVED, flown.cases, flown.percentiles)
    beside = max(1, request.cases // _SIDE_SHARE)
    notes = {}
    more = []
    if not request.quick:
        controls = _fly(mission, control_configurations(), beside, "controls", request)
        notes = difference_notes(controls.cases)
        explanation = f"The flights as printed with one thing changed, {beside} cases each."
        more.append(Section("What the results hang on", [explanation, control_table(controls.cases)]))
        swept = _fly(mission, sweep_configurations(), beside, "sweeps", request)
        second = calibration_page.calibration_page(swept.cases, beside, request.folder)
        write_page(second, request.folder, calibration_page.NAME)
        more.append(Section("Future work of the paper", [Link(calibration_page.NAME, calibration_page.TITLE)]))
    flights = flight_part(mission, printed, improved, notes, request.folder)
    rows = [*sensors.rows, *flights.rows]
    missed = sum(not row.ok for row in rows)
    worse = notable(rows)
    summary = f"{len(rows)} numbers, {missed or 'none'} of them not what they must be."
    table = Section("Paper and here", [summary, Table(*table_of(rows)), Listing([*worse, *MEASURED, *notes_of(rows)])])
    lead = (
        f"Flights of the mission {mission.name}, {request.cases} cases of one orbit for each configuration; "
        "configurations share their draws. The average is the weighted average (WAVG) of the paper, the filter its "
        "extended Kalman filter (EKF)."
    )
    setting = Section("Settings", [Listing(settings(mission, improved))])
    write_page(Page(TITLE, lead, [table, setting, *flights.sections, *more, *sensors.sections]), request.folder)
    return rows


def _fly(mission: Mission, configurations: Sequence[Configuration], cases: int, name: str, request: Request) -> Study:
    # the number of cases is part of the name, so that a quick look leaves a long study alone
    folder = request.folder / "studies" / f"{name}_{cases}"
    progress = None if request.progress is None else request.progress(name)
    return run_study(mission, configurations, cases, folder, progress=progress)
