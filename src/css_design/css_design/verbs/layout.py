# SPDX-License-Identifier: Apache-2.0
"""Searches layouts, prints the front, writes its missions."""

import argparse
import json
import math
import re
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
from rich.console import Console

from css_analysis.readable_table import ReadableTable
from css_common import places
from css_common.command import FAILED, INTERRUPTED
from css_common.mission import Mission, load_mission
from css_common.preflight import preflight, report
from css_design.errors import DesignError
from css_design.layout.flown import Flown, between, fly_layouts
from css_design.layout.front import Point, error_object, front_of, write_missions, write_own
from css_design.layout.heading_error import HeadingError
from css_design.layout.judge import Aims, LayoutJudge
from css_design.layout.placements import TILTS_DEG, candidates, faces_of
from css_design.layout.readings import Cells
from css_design.layout.search import Found, LayoutSearch
from css_design.layout.structure import read_structure
from css_sensors.cells import MOST_CELLS

MOST_FLIGHTS = 10_000
_SAME = 0.01  # [rad] by which normals of layouts that are taken for one differ
_COLUMNS = ("mean", "worst", "failed\nmean", "failed\nworst", "worst\n5 %")


def run(options: argparse.Namespace) -> int:
    """Searches as the options say; the exit code."""
    counts = _counts(options.cells)
    aims = _aims(options.weights)
    if options.flights is not None and not 2 <= options.flights <= MOST_FLIGHTS:
        raise DesignError(f"--flights: {options.flights} given, expected 2 to {MOST_FLIGHTS}")
    faces = faces_of(options.faces)
    mission = load_mission(options.mission, options.overrides)
    report(preflight(mission))  # before minutes of search, what none of its layouts would fly with
    messages, console = Console(stderr=True, highlight=False), Console(highlight=False)
    structure = None if options.structure is None else read_structure(options.structure)
    if structure is not None:
        x, y, z = structure.extent
        console.print(f"structure: {x:.3g} x {y:.3g} x {z:.3g} m, {len(structure.triangles)} triangles")
    judge = LayoutJudge(mission, aims, options.pointing, options.prior, structure)
    own = judge.own
    views = sorted(set(options.views)) if options.views else sorted(set(own.views_deg.tolist()))
    tilts = sorted({min(tilt, options.tilt) for tilt in (*TILTS_DEG, options.tilt)})
    interrupted = False
    flown: dict[int, list[Flown]] = {}
    with messages.status("reading cells") as status:
        search = LayoutSearch(
            judge, faces, candidates(faces, tilts, views), options.tilt, lambda what: _tell(messages, status, what)
        )
        try:
            search.run(counts, [own])
            if options.flights is not None:
                _fly(mission, judge, search, options.flights, flown, lambda what: _tell(messages, status, what))
        except KeyboardInterrupt:
            interrupted = True
    if not search.best:
        print("layout: interrupted before the first layout", file=sys.stderr)
        return INTERRUPTED
    folder = options.out or places.results("layouts") / mission.name
    written, refused = ({}, []) if options.no_missions else write_missions(mission, search.best, judge.blocked, folder)
    points = front_of(search.best, written)
    own_error = judge.error_of(own, judge.own_blocked)
    if written and structure is not None:
        written_own = write_own(mission, own, judge.own_blocked, folder)
        console.print(f"the mission's own cells with what the structure blocks: {written_own}", soft_wrap=True)
    _print(points, own.number, own_error, judge.cost(own_error), console)
    for of_count in flown.values():
        _print_flown(of_count, console)
    for line in refused:
        print(f"layout: warning: {line}", file=sys.stderr)
    if written:
        console.print(f"missions: {folder}", soft_wrap=True)
    if options.json:
        result = {
            "mission": mission.name,
            "own": {"cells": own.number, **error_object(own_error), "cost_deg": judge.cost(own_error)},
            "front": [point.as_object() for point in points],
            "flown": {count: [_flown_object(one) for one in of_count] for count, of_count in flown.items()},
            "weights": aims._asdict(),
            "pointing": options.pointing,
            "prior_deg": options.prior,
            "cell_sigma": judge.sigma,
            "interrupted": interrupted,
            "warnings": refused,
        }
        print(json.dumps(result, allow_nan=False))
    if interrupted:
        print("layout: interrupted; these are the best so far", file=sys.stderr)
        return INTERRUPTED
    return FAILED if refused else 0


def _fly(
    mission: Mission,
    judge: LayoutJudge,
    search: LayoutSearch,
    cases: int,
    flown: dict[int, list[Flown]],
    tell: Callable[[str], None],
) -> None:
    """The best of each number of cells by flights takes the place of that of the search."""
    for count in sorted(search.best):
        finalists: list[tuple[str, Cells]] = []
        if count == judge.own.number:
            finalists.append(("the mission's own", judge.own))
        for number, end in enumerate(search.ends.get(count, ())):
            if any(np.allclose(end.cells.normals_b, cells.normals_b, atol=_SAME) for _, cells in finalists):
                continue
            name = f"found {number + 1}"
            finalists.append((name, end.cells))
            if count == judge.own.number:
                ways = between(judge.own, end.cells)
                finalists += [(f"{name}, {part + 1} of {len(ways) + 1} of the way", c) for part, c in enumerate(ways)]
        finalists = [one for one in finalists if search.may_be(one[1])]
        tell(f"{count} cells: {len(finalists)} layouts fly {cases} cases each")
        flown[count] = fly_layouts(mission, finalists, judge.blocked, cases)
        best = flown[count][0]
        error = judge.error_of(best.cells)
        search.best[count] = Found(best.cells, error, judge.cost(error))


def _print_flown(flown: list[Flown], console: Console) -> None:
    table = ReadableTable(
        f"{flown[0].cells.number} cells in {flown[0].cases} flights each: heading error in sunlight once acquired, deg"
    )
    table.add_name("layout")
    for column in ("mean", "95 %", "its interval", "acquired"):
        table.add_number(column)
    for one in flown:
        span = f"{one.bound.low:.2f} .. {one.bound.high:.2f}"
        table.add_texts([one.name, f"{one.mean:.2f}", f"{one.bound.value:.2f}", span, f"{one.acquired}"])
    console.print(table)
    console.print(f"taken for {flown[0].cells.number} cells: {flown[0].name}", soft_wrap=True)


def _flown_object(one: Flown) -> dict[str, Any]:
    known = {"mean_deg": one.mean, "bound_95_deg": one.bound.value}
    return {
        "layout": one.name,
        "normals": one.cells.normals_b.tolist(),
        **{key: value if math.isfinite(value) else None for key, value in known.items()},
        "bound_95_confidence_deg": [one.bound.low, one.bound.high] if math.isfinite(one.bound.low) else None,
        "acquired": one.acquired,
        "cases": one.cases,
    }


def _tell(console: Console, status: object, what: str) -> None:
    if console.is_terminal:
        status.update(what)  # type: ignore[attr-defined]
    else:
        print(f"layout: {what}", file=sys.stderr, flush=True)


def _counts(text: str) -> range:
    found = re.fullmatch(r"(\d+)(?:-(\d+))?", text.strip())
    first, last = (int(found[1]), int(found[2] or found[1])) if found else (0, 0)
    if not 1 <= first <= last <= MOST_CELLS:
        raise DesignError(f"--cells: {text} given, expected a number or a range such as 4-10, 1 to {MOST_CELLS}")
    return range(first, last + 1)


def _aims(text: str) -> Aims:
    try:
        weights = [float(part) for part in text.split(",")]
    except ValueError:
        weights = []
    if len(weights) not in (3, 4) or not all(0.0 <= w < math.inf for w in weights) or not any(weights):
        raise DesignError(f"--weights: {text} given, expected three or four numbers from 0 on, such as 1,0.1,0.5")
    return Aims(*weights)


def _print(points: list[Point], own_cells: int, own: HeadingError, own_cost: float, console: Console) -> None:
    table = ReadableTable("heading error by one estimate, deg; failed: the cell dead whose loss costs most")
    table.add_name("cells")
    for column in _COLUMNS:
        table.add_number(column)
    table.add_number("Sun\nunseen")
    table.add_number("weighted")
    table.add_number("on the\nfront")
    table.add_texts([f"{own_cells} as they are", *_figures(own), f"{own_cost:.2f}", ""])
    for point in points:
        count = point.found.cells.number
        front = "yes" if point.on_front else "no"
        table.add_texts([f"{count}", *_figures(point.found.error), f"{point.found.cost:.2f}", front])
    console.print(table)


def _figures(error: HeadingError) -> list[str]:
    degrees = [math.degrees(e) for e in (error.mean, error.worst, error.failed, error.failed_worst, error.tail)]
    return [*(f"{e:.2f}" for e in degrees), f"{100.0 * error.unseen:.1f}%"]
