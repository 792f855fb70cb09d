# SPDX-License-Identifier: Apache-2.0
"""Comparison of both Sun models of DiGregorio & Crassidis, from flights of the mission `cubesat_vmm`."""

from collections.abc import Callable, Mapping
from pathlib import Path

from css_common.mission import Mission, load_mission
from css_papers.digregorio.figures import write_case, write_cases
from css_papers.digregorio.flights import (
    DIODES,
    DIVERGED_DEG,
    FILTERS,
    GUESS_DEG,
    MISSION,
    VECTOR,
    VOLTAGE,
    Flown,
    fly,
    with_noise,
)
from css_papers.digregorio.robustness import UNKNOWN, WORLDS, Judged, judge
from css_papers.page import Listing, Page, Picture, Section, Table, write_page
from css_papers.papers import Request
from css_papers.rows import Must, Row, notes_of, row, table_of

TITLE = "DiGregorio & Crassidis, Improved model for low cost Sun sensor attitude filtering"

_SIDE_SHARE = 10
_NOISES = (0.005, 0.01, 0.02, 0.05, 0.1)
_CONSISTENT = Must(0.85 * 3.0, 1.15 * 3.0)
_ROBUST = Must(0.8 * 3.0, 1.2 * 3.0)
_LASTING, _WHITE = "lasting", "white"
_CASE = 0


def reproduce(request: Request) -> list[Row]:
    """Writes figures and the page; without noise levels and other worlds when it must be quick."""
    mission = load_mission(MISSION)
    flown = {diodes: fly(mission, diodes, request.cases, progress=_progress(request, diodes)) for diodes in DIODES}
    rows = [line for diodes, flights in flown.items() for line in _rows(diodes, flights)]
    pictures = []
    for diodes in ("six", "four"):
        file = write_case(flown[diodes], _CASE, f"Estimated to true attitude, diodes: {diodes}", _file(request, diodes))
        caption = f"Case {_CASE}, diodes: {diodes}. Error, three standard deviations by the filter, diodes that count."
        pictures.append(Picture(file.name, caption))
    cases = write_cases(flown, request.folder / "error_over_cases.png")
    sections = [
        Section("Numbers", [Table(*table_of(rows)), Listing(notes_of(rows))]),
        Section("Filters by set of diodes", [_setting(request.cases), _merits(flown)]),
        Section("One flight", pictures),
        Section("All flights", [Picture(cases.name, f"Median and 95th percentile over {request.cases} cases.")]),
    ]
    if not request.quick:
        beside = max(1, request.cases // _SIDE_SHARE)
        text = (
            f"Mean error [deg] from 300 s on, vector / voltage, {beside} cases each, by the noise of a diode relative "
            "to full Sun: what a finer sensor or more of the coarse ones buy."
        )
        sections.append(Section("Noise and number of diodes", [text, _noise_table(mission, beside, request)]))
        judged = {world: judge(mission, world, beside, _progress(request, world)) for world in WORLDS}
        rows += [line for world, of_world in judged.items() for line in _world_rows(world, of_world)]
        sections[0] = Section("Numbers", [Table(*table_of(rows)), Listing(notes_of(rows))])
        sections.append(Section("Where the world is not as the filter has it", [_worlds_text(beside), _worlds(judged)]))
    lead = (
        "The slides give figures without numbers, and no parameters. Both filters run on the same data; they differ in "
        "the measurement model of the Sun alone: a least-squares vector of the lit diodes, which is undefined when "
        "their normals do not span space, or the voltage of each diode."
    )
    write_page(Page(TITLE, lead, sections), request.folder)
    return rows


def _rows(diodes: str, flown: Flown) -> list[Row]:
    vector, voltage = flown.merits[VECTOR], flown.merits[VOLTAGE]
    rows = [
        row(f"{diodes}: mean error, vector", "deg", None, vector.mean),
        row(f"{diodes}: mean error, voltage", "deg", None, voltage.mean),
        row(f"{diodes}: voltage over vector", "-", None, voltage.mean / vector.mean, Must(None, 1.05)),
        row(f"{diodes}: NEES, voltage", "-", None, voltage.nees, _CONSISTENT),
    ]
    if diodes == "four":
        note = "the vector filter has the field alone; at 51.6 or 98 deg of inclination, where it turns faster, 2.8"
        rows.append(row(f"{diodes}: vector over voltage", "-", None, vector.mean / voltage.mean, Must(3.0), note=note))
        rows.append(row(f"{diodes}: NEES, vector (no Sun)", "-", None, vector.nees))
    else:
        rows.append(row(f"{diodes}: NEES, vector", "-", None, vector.nees, _CONSISTENT))
    note = f"a mean error beyond {DIVERGED_DEG:g} deg over the last minute"
    diverged = vector.diverged + voltage.diverged
    rows.append(row(f"{diodes}: cases that diverge", "-", None, diverged, Must(None, 0.0), note=note))
    return rows


def _setting(cases: int) -> str:
    return (
        f"{cases} cases of half an hour in sunlight from random attitudes, filters begun {GUESS_DEG:g} deg off about "
        "each axis (1 sigma), errors from 300 s on."
    )


def _merits(flown: Mapping[str, Flown]) -> Table:
    heading = ["diodes", "filter", "mean [deg]", "95 % [deg]", "largest [deg]", "NEES (3)", "NIS / dof (1)"]
    lines = []
    for diodes, flights in flown.items():
        for name, label in FILTERS.items():
            m = flights.merits[name]
            figures = (f"{m.mean:.3f}", f"{m.p95:.3f}", f"{m.largest:.2f}", f"{m.nees:.2f}", f"{m.nis:.3f}")
            lines.append([diodes, label, *figures])
    return Table(heading, lines)


def _world_rows(world: str, judged: Mapping[tuple[str, str], Judged]) -> list[Row]:
    rows = []
    for name, label in FILTERS.items():
        here = judged[name, _LASTING]
        # the light of the mission's own Earth must cost nothing; other worlds are for honesty
        must = Must(None, 0.3) if world == "light of the Earth" else None
        rows.append(row(f"{world}: mean error, {label}, lasting errors", "deg", None, here.mean, must))
        must = None if world == UNKNOWN else _ROBUST
        rows.append(row(f"{world}: NEES, {label}, lasting errors", "-", None, here.nees, must))
    return rows


def _worlds_text(cases: int) -> str:
    return (
        f"Mean error [deg] / NEES (3), six diodes, {cases} cases at each of six hours of the day, from the start that "
        "Sun and field give. With lasting errors, as the filter is by default, the brightness of the Earth, the bias "
        "of the magnetometer and the error of the field model are states; the filter with white errors takes off the "
        "light of the mean Earth and knows nothing of the rest."
    )


def _worlds(judged: Mapping[str, Mapping[tuple[str, str], Judged]]) -> Table:
    kinds = [(name, errors) for errors in (_LASTING, _WHITE) for name in FILTERS]
    heading = ["world", *(f"{FILTERS[name]}, {errors} errors" for name, errors in kinds)]
    lines = [[world, *(f"{of[kind].mean:.3f} / {of[kind].nees:.2f}" for kind in kinds)] for world, of in judged.items()]
    return Table(heading, lines)


def _noise_table(mission: Mission, cases: int, request: Request) -> Table:
    lines = []
    for diodes in DIODES:
        line = [diodes]
        for sigma in _NOISES:
            progress = _progress(request, f"{diodes}, noise {sigma:g}")
            merits = fly(mission, diodes, cases, with_noise(sigma), progress).merits
            line.append(f"{merits[VECTOR].mean:.3f} / {merits[VOLTAGE].mean:.3f}")
        lines.append(line)
    return Table(["diodes", *(f"{sigma:g}" for sigma in _NOISES)], lines)


def _progress(request: Request, name: str) -> Callable[[int, int], None] | None:
    return None if request.progress is None else request.progress(name)


def _file(request: Request, diodes: str) -> Path:
    return request.folder / f"case_{_CASE}_{diodes}.png"
