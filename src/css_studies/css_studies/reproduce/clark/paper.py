# SPDX-License-Identifier: Apache-2.0
"""Figures and numbers of Benton, from flights of the missions `clark_1996_flat` and `clark_1996_pyramid`."""

from pathlib import Path

from css_studies.reproduce.clark.cases import averages, configuration, fly_cases_of
from css_studies.reproduce.clark.figures import write_error, write_panel
from css_studies.reproduce.clark.flights import DOUBLED, FLAT, PYRAMID, Flight, fly
from css_studies.reproduce.clark.numbers import acquisition_rows, angle_rows
from css_studies.reproduce.page import Listing, Page, Picture, Section, Table, write_page
from css_studies.reproduce.papers import Request
from css_studies.reproduce.rows import Row, notes_of, table_of

TITLE = "Benton, Pyramid coarse Sun sensing for NASA SSTI Clark safe-hold mode"

MOST_CASES = 100
"""Cases of the mission as it is that are worth their time."""


def reproduce(request: Request) -> list[Row]:
    """Writes figures and the page."""
    flat, pyramid, doubled = fly(FLAT), fly(PYRAMID), fly(PYRAMID, DOUBLED)
    rows = [
        *_nominal_rows(request),
        *angle_rows(flat.mean_error, flat.mean_panel, pyramid.mean_panel, doubled.mean_panel, variant="case 0"),
        *acquisition_rows((pyramid, doubled)),
    ]
    missed = sum(not row.ok for row in rows)
    summary = f"{len(rows)} numbers, {missed or 'none'} of them not what they must be."
    sections = [
        Section("Paper and here", [summary, Table(*table_of(rows)), Listing(notes_of(rows))]),
        Section("Flights", _pictures(flat, pyramid, doubled, request.folder)),
    ]
    lead = "Safe-hold."
    write_page(Page(TITLE, lead, sections), request.folder)
    return rows


def _nominal_rows(request: Request) -> list[Row]:
    cases = min(request.cases, MOST_CASES)
    with_flat = fly_cases_of(FLAT, [()], cases, "nominal", request).cases
    with_pyramid = fly_cases_of(PYRAMID, [(), DOUBLED], cases, "nominal", request).cases
    flat = averages(with_flat, configuration(FLAT))
    nominal = averages(with_pyramid, configuration(PYRAMID))
    doubled = averages(with_pyramid, configuration(PYRAMID, DOUBLED))
    return angle_rows(flat.error, flat.panel, nominal.panel, doubled.panel)


def _pictures(flat: Flight, pyramid: Flight, doubled: Flight, folder: Path) -> list[Picture]:
    files = [
        (write_error(flat, folder / "figure_1.png"), "Figure 1. Sensed to true Sun, flat cells; zero in the shadow."),
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
