# SPDX-License-Identifier: Apache-2.0
"""Figures and numbers of Reichard, Cochrane & Fortin, from flights of the mission `esprit_2006`."""

from pathlib import Path

import numpy as np

from css_analysis.spin_consistency import AttitudeCases, attitude_cases
from css_analysis.spin_figures import (
    write_alias_figure,
    write_coning_figure,
    write_rate_figure,
    write_spectrum_figure,
)
from css_analysis.spin_flight import SpinFlight
from css_common.mission import Mission, load_mission
from css_estimation.spin.coning import Coning, justification
from css_papers.esprit.attitude_figure import write_attitude_figure
from css_papers.esprit.flights import (
    DRIFT,
    MISSION,
    AttitudeErrors,
    Legs,
    attitude_errors,
    head_studies,
    legs_of,
)
from css_papers.esprit.numbers import (
    alias_rows,
    angle_rows,
    attitude_rows,
    fixed_axis_row,
    period_rows,
    rate_rows,
    true_max_min,
)
from css_papers.esprit.spinning import fly_spinning
from css_papers.page import Block, Listing, Page, Picture, Section, Table, write_page
from css_papers.papers import Request
from css_papers.rows import Row, notes_of, table_of

TITLE = "Reichard, Cochrane & Fortin, ESPRIT Sun sensor: results and future use (Penn State, 2007)"

MOST_CASES = 500
"""Attitude cases that are worth their time."""


def reproduce(request: Request) -> list[Row]:
    """Writes figures and the page; without the study of heads when it must be quick."""
    mission = load_mission(MISSION)
    flight = fly_spinning(mission)
    legs, errors = legs_of(flight), attitude_errors(flight)
    drifting = legs_of(fly_spinning(mission.with_overrides(DRIFT)))
    cases = attitude_cases(mission, min(request.cases, MOST_CASES))
    rows = [
        *rate_rows(mission, flight.passages),
        *angle_rows(legs, true_max_min(mission, legs.up, flight.passages)),
        *period_rows(legs, drifting),
        *alias_rows(legs, mission),
        fixed_axis_row(mission),
        *attitude_rows(mission, errors, cases),
    ]
    missed = sum(not row.ok for row in rows)
    summary = f"{len(rows)} numbers, {missed or 'none'} of them not what they must be."
    sections = [
        Section("Paper and here", [summary, Table(*table_of(rows)), Listing(notes_of(rows))]),
        *_figure_sections(mission, flight, legs, request.folder),
        _attitude_section(errors, cases, request.folder),
    ]
    if not request.quick:
        sections.append(_head_section(head_studies(mission), request.folder))
    lead = (
        f"A flight of the mission {mission.name}: {mission.values.mission.duration:g} s from lift-off, three slits, a "
        f"timer of {mission.values.slits.counter_hz:g} Hz and a magnetometer, the estimators that fly. Seed "
        f"{mission.values.mission.seed}, case {mission.values.mission.case}. Spin, cone and periods of the paper "
        "are what the rocket is given: what stands here is recovered from its pulses, not predicted."
    )
    write_page(Page(TITLE, lead, sections), request.folder)
    return rows


def _figure_sections(mission: Mission, flight: SpinFlight, legs: Legs, folder: Path) -> list[Section]:
    starts = mission.values.payload.phase_starts.tolist()
    names = ("motor separation", "nosecone", "booms")
    events = [
        *zip(starts[1:], names, strict=False),
        (mission.values.payload.flat_spin_start, "flat spin"),
    ]
    windows = {"up-leg": legs.up, "down-leg": legs.down}
    rate = write_rate_figure(flight.passages, folder / "figure_4.png", events)
    angle = write_coning_figure(flight.passages, windows, folder / "figure_5.png", start=57.0)
    spectrum = write_spectrum_figure(flight.passages, windows, folder / "figure_6.png")
    refusals = [f"{count} x {reason}" for reason, count in flight.reasons.most_common()]
    return [
        Section(
            "Rate and Sun angle",
            [
                Picture(rate.name, "Figure 4. Rotation rate and Sun angle at every passage."),
                f"{len(flight.passages.time)} passages were accepted, {flight.refused} pulses or passages refused:",
                Listing(refusals),
            ],
        ),
        Section(
            "Coning",
            [
                Picture(angle.name, "Figure 5. Coning angle of consecutive maxima and minima, from 57 s."),
                Picture(spectrum.name, "Figure 6. Fourier transform of the Sun angles of both legs, and its mirror."),
                *[block for name, leg in windows.items() for block in _candidates(name, leg)],
            ],
        ),
    ]


def _candidates(name: str, coning: Coning) -> list[Block]:
    heading = ["candidate", "Hz", "s", "inertia ratio", "power", "pulses missed by us"]
    lines = [
        [
            "chosen" if i == coning.chosen else "",
            f"{c.frequency:.4f}",
            f"{1.0 / c.frequency:.4f}",
            f"{c.inertia_ratio:.3f}",
            f"{c.power:.4f}",
            f"{1e6 * residual:.3g}",
        ]
        for i, (c, residual) in enumerate(zip(coning.candidates, coning.residuals, strict=True))
    ]
    return [f"{name}, {1.0 / coning.frequency:.4f} s: {justification(coning)}.", Table(heading, lines)]


def _attitude_section(errors: AttitudeErrors, cases: AttitudeCases, folder: Path) -> Section:
    figure = write_attitude_figure(errors, cases, folder / "attitude.png")
    beyond = float(np.mean(cases.nees > 11.34)) if len(cases.nees) else 0.0
    return Section(
        "Attitude",
        [
            Picture(figure.name, "Error of the attitude at every passage, and its consistency over cases."),
            f"{len(cases.nees)} cases draw roll, coning phase, noise, time and Sun angle. {100.0 * beyond:.1f} % of "
            "them are beyond the 99 % bound of chi-square with 3 degrees of freedom. In the flat spin the coning model "
            "behind the covariance does not hold, and attitudes are worse than they say.",
        ],
    )


def _head_section(studies: dict[str, Coning], folder: Path) -> Section:
    spin = next(iter(studies.values())).spin
    figure = write_alias_figure(studies, spin, folder / "heads.png")
    heading = ["sensor", "Sun angles a turn", "candidates", "full angle, max - min deg", "full angle, fitted deg"]
    lines = [
        [
            name,
            f"{coning.samples / ((coning.end - coning.start) * coning.spin):.2f}",
            str(len(coning.candidates)),
            f"{np.degrees(coning.max_min_angle):.2f}",
            f"{np.degrees(coning.full_angle):.2f}",
        ]
        for name, coning in studies.items()
    ]
    text = (
        "The paper proposes several sensors around the perimeter. Four leave one frequency alone, and their maxima "
        "and minima of the Sun angle come closer to the cone; two leave one other, and find no more extrema than one."
    )
    return Section(
        "Several heads", [text, Table(heading, lines), Picture(figure.name, "What each number leaves open.")]
    )
