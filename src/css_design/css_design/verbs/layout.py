# SPDX-License-Identifier: Apache-2.0
"""Searches layouts, prints the front, writes its missions."""

import argparse
import json
import math
import re
import sys

from rich.console import Console

from css_analysis.readable_table import ReadableTable
from css_common import places
from css_common.command import FAILED, INTERRUPTED
from css_common.mission import load_mission
from css_design.errors import DesignError
from css_design.layout.front import Point, error_object, front_of, write_missions, write_own
from css_design.layout.heading_error import HeadingError
from css_design.layout.judge import Aims, LayoutJudge
from css_design.layout.placements import TILTS_DEG, candidates, faces_of
from css_design.layout.search import LayoutSearch
from css_design.layout.structure import read_structure
from css_sensors.cells import MOST_CELLS

_COLUMNS = ("mean", "worst", "failed\nmean", "failed\nworst", "worst\n5 %")


def run(options: argparse.Namespace) -> int:
    """Searches as the options say; the exit code."""
    counts = _counts(options.cells)
    aims = _aims(options.weights)
    faces = faces_of(options.faces)
    mission = load_mission(options.mission, options.overrides)
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
    with messages.status("reading cells") as status:
        search = LayoutSearch(
            judge, faces, candidates(faces, tilts, views), options.tilt, lambda what: _tell(messages, status, what)
        )
        try:
            search.run(counts, [own])
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
    for line in refused:
        print(f"layout: warning: {line}", file=sys.stderr)
    if written:
        console.print(f"missions: {folder}", soft_wrap=True)
    if options.json:
        result = {
            "mission": mission.name,
            "own": {"cells": own.number, **error_object(own_error), "cost_deg": judge.cost(own_error)},
            "front": [point.as_object() for point in points],
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
