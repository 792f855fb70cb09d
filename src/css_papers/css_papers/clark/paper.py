# SPDX-License-Identifier: Apache-2.0
"""Figures and numbers of Benton, from flights of the missions `clark_1996_flat` and `clark_1996_pyramid`."""

from collections.abc import Mapping
from pathlib import Path

from css_common.mission import load_mission
from css_papers.clark.assumptions import control_table, flat_note, fly_controls
from css_papers.clark.cases import averages, configuration, fly_cases_of
from css_papers.clark.cell import PRINTED_DEG, Cell, cell_rows
from css_papers.clark.figures import write_campaign, write_error, write_panel, write_profiles, write_response
from css_papers.clark.flights import DOUBLED, FLAT, PYRAMID, Flight, fly
from css_papers.clark.numbers import FLAT_ANGLE, acquisition_rows, angle_rows
from css_papers.clark.power_part import power_section
from css_papers.clark.seasons import (
    DATES,
    Campaign,
    campaign_lines,
    campaign_rows,
    day,
    fly_campaign,
    profile,
    profile_rows,
)
from css_papers.clark.staring import fly_stares, stare_rows, stare_table
from css_papers.page import Listing, Page, Part, Picture, Section, Table, write_page
from css_papers.papers import Request
from css_papers.rows import Row, notes_of, table_of

TITLE = "Benton, Pyramid coarse Sun sensing for NASA SSTI Clark safe-hold mode"

MOST_CASES, MOST_CAMPAIGN_CASES = 100, 500
"""Cases of the missions as they are, and over dates and albedo, that are worth their time."""
_SIDE_SHARE = 10
_COUNTED_DEG = (*sorted({*PRINTED_DEG, 5.0, 10.0, 15.0, 20.0, 45.0, 75.0}),)


def reproduce(request: Request) -> list[Row]:
    """Writes figures and the page; without the changes to spacecraft and albedo when it must be quick."""
    cases = min(request.cases, MOST_CASES)
    notes: dict[str, str] = {}
    more = []
    if not request.quick:
        beside = max(1, cases // _SIDE_SHARE)
        controls = fly_controls(beside, request)
        notes[FLAT_ANGLE] = flat_note(controls)
        text = (
            f"The missions with one thing changed, {beside} cases each; means over sunlight. Gains in N m and N m s. "
            "Light from nadir, constant in sunlight, is the model that the paper began with; it gives no value, 0.3 is "
            "a choice. Beyond 30 deg: sunlit time of the whole flight."
        )
        more.append(Section("What the averages hang on", [text, control_table(controls)]))
    flat, pyramid, doubled = fly(FLAT), fly(PYRAMID), fly(PYRAMID, DOUBLED)
    single = angle_rows(flat.mean_error, flat.mean_panel, pyramid.mean_panel, doubled.mean_panel, "case 0")
    parts = [_campaign_part(fly_campaign(request, MOST_CAMPAIGN_CASES), request.folder), _stare_part(request.quick)]
    parts.append(_cell_part(request.folder))
    rows = [*_nominal_rows(cases, notes, request), *single, *acquisition_rows((pyramid, doubled))]
    rows += [line for part in parts for line in part.rows]
    missed = sum(not line.ok for line in rows)
    summary = f"{len(rows)} numbers, {missed or 'none'} of them not what they must be."
    flights = {"flat": flat, "pyramid": pyramid, "pyramid, doubled albedo": doubled}
    sections = [
        Section("Paper and here", [summary, Table(*table_of(rows)), Listing(notes_of(rows))]),
        Section("Flights", _pictures(flat, pyramid, doubled, request.folder)),
        *more,
        *(section for part in parts for section in part.sections),
        power_section(flights, request.folder),
    ]
    write_page(Page(TITLE, _lead(cases), sections), request.folder)
    return rows


def _lead(cases: int) -> str:
    return (
        f"Flights of the missions {FLAT} and {PYRAMID}, four orbits each. Averages are over sunlight, acquisition "
        f"included: first over {cases} cases of the missions as they are, then of the case in the figures, then over "
        "rates, attitudes, dates and albedo. Inertia, wheels, rods, gains, noise and tip-off rates are choices."
    )


def _nominal_rows(cases: int, notes: Mapping[str, str], request: Request) -> list[Row]:
    with_flat = fly_cases_of(FLAT, [()], cases, "nominal", request).cases
    with_pyramid = fly_cases_of(PYRAMID, [(), DOUBLED], cases, "nominal", request).cases
    flat = averages(with_flat, configuration(FLAT))
    nominal = averages(with_pyramid, configuration(PYRAMID))
    doubled = averages(with_pyramid, configuration(PYRAMID, DOUBLED))
    return angle_rows(flat.error, flat.panel, nominal.panel, doubled.panel, notes=notes)


def _pictures(flat: Flight, pyramid: Flight, doubled: Flight, folder: Path) -> list[Picture]:
    files = [
        (
            write_error(flat, folder / "figure_1.png"),
            "Figure 1. Sensed to true Sun, flat cells; zero in the shadow. Pale: smallest to largest of about half a "
            "minute, where noise makes the cells choose the wrong side.",
        ),
        (
            write_panel(flat, "Flat cells", folder / "figure_5.png"),
            "Figure 5. Panel normal to the true and to the sensed Sun, flat cells. In the shadow the sensed Sun is "
            "[1, 0, 0].",
        ),
        (
            write_panel(pyramid, "Pyramid and flat cells", folder / "figure_7.png"),
            "Figure 7. The same with the pyramid.",
        ),
        (
            write_panel(doubled, "Pyramid and flat cells, doubled albedo", folder / "figure_8.png"),
            "Figure 8. The same with all albedo intensities doubled and cut at 0.80.",
        ),
    ]
    return [Picture(file.name, caption) for file, caption in files]


def _campaign_part(campaign: Campaign, folder: Path) -> Part:
    dates = [date for date in DATES if any(point.date == date for point in campaign.points)]
    profiles = {date: profile(campaign, date) for date in dates}
    heading = ["date", "error, flat [deg]", "panel, flat (worst) [deg]", "error, pyramid [deg]",
               "panel, pyramid (worst) [deg]", "pyramid over flat"]  # fmt: skip
    text = (
        f"{campaign.cases} cases of each point, both ways to sense on the same draws: any attitude, rates up to 2 "
        "deg/s about each axis, the node moved with the mean Sun. Means over the cases."
    )
    spread = write_campaign(campaign, folder / "campaign.png")
    seasons = write_profiles({day(date): found for date, found in profiles.items()}, folder / "seasons.png")
    sections = [
        Section(
            "Rates, attitudes, dates and albedo",
            [text, Table(heading, campaign_lines(campaign)), Picture(spread.name, "Cases below an angle.")],
        ),
        Section(
            "Seasons",
            [
                "Clark flies into the light over the summer's ice: early in the pass in June, late in December, at "
                "both ends at the equinoxes.",
                Picture(seasons.name, "Error of the flat cells over a pass, nominal albedo, smoothed over 4 min."),
            ],
        ),
    ]
    return Part(sections, [*campaign_rows(campaign), *profile_rows(profiles)])


def _stare_part(quick: bool) -> Part:
    stares = fly_stares(most=3 if quick else None)
    text = (
        "Flights that begin at rest with the pyramid on the brightest part of an Earth with doubled albedo, more than "
        "60 deg from the Sun, rolled three ways. The flat cells must deny it."
    )
    return Part([Section("Staring at doubled albedo", [text, stare_table(stares)])], stare_rows(stares))


def _cell_part(folder: Path) -> Part:
    cell = Cell(load_mission(FLAT))
    counted = {angle: cell.uncertainty_deg(angle) for angle in _COUNTED_DEG}
    picture = write_response(cell.response(), counted, folder / "figure_3.png")
    caption = "Figure 3. Output of a cell over the angle from its normal, and the angles that share one count."
    return Part([Section("One cell", [Picture(picture.name, caption)])], cell_rows(cell))
