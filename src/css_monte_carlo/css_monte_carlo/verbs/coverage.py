# SPDX-License-Identifier: Apache-2.0
"""Maps a layout, and prints what it is worth."""

import argparse
import json
from pathlib import Path
from typing import Any

from rich.console import Console

from css_analysis.readable_table import ReadableTable
from css_common.mission import Mission, load_mission
from css_common.mission_file import MissionError
from css_monte_carlo.coverage import grid_of, layout_of_mission, map_cells
from css_monte_carlo.coverage_statistics import coverage_object
from css_sim.nodes.css_array import CssArray


def run(options: argparse.Namespace) -> int:
    """Maps and prints as the options say; the exit code."""
    mission = load_mission(options.mission, options.overrides)
    result, files = study(mission, options.figures)
    _print_tables(result, Console(highlight=False))
    for file in files:
        print(f"figure: {file}")
    if options.json:
        print(json.dumps(result, allow_nan=False))
    return 0


def study(mission: Mission, figures: Path | None = None) -> tuple[dict[str, Any], list[Path]]:
    """Numbers of a mission's layout, and the figures written.

    Raises:
        MissionError: the mission has no cells.
        OSError: a figure cannot be written.
    """
    if not any(issubclass(node.component, CssArray) for node in mission.nodes):
        raise MissionError(f"{mission.origin}: no cells to map: graph.nodes has no css_sim/css_array")
    grid, layout = grid_of(mission), layout_of_mission(mission)
    normals_b = mission.values.cells.normals
    ideal, warped = map_cells(layout, grid), map_cells(layout, grid, warp=True)
    numbers = coverage_object(grid, ideal, warped)
    result = {"mission": mission.name, "cells": len(normals_b), **numbers}
    files = []
    if figures is not None:
        from css_monte_carlo.coverage_figures import write_coverage_figures  # matplotlib takes a second to load

        files = write_coverage_figures(grid, ideal, warped, normals_b, mission.name, figures)
    return result, files


def _print_tables(result: dict[str, Any], console: Console) -> None:
    seen = ReadableTable(f"{result['mission']}: {result['cells']} cells")
    seen.add_name("cells that see the Sun")
    seen.add_number("share of the\nsphere, %")
    for count, fraction in enumerate(result["seen_by_fraction"]):
        seen.add_texts([f"{count}", f"{100.0 * fraction:.2f}"])
    console.print(seen)
    if not result["holes"]:
        console.print(" holes: none")
    for hole in result["holes"]:
        console.print(f" hole: {_hole(hole)}", soft_wrap=True)
    errors = ReadableTable("weighted average, angles in deg")
    errors.add_name("Sun angles are from the array normal")
    errors.add_number("ideal\ncosine")
    errors.add_number("warped")
    for label, texts in _error_rows(result["wavg_ideal"], result["wavg_warped"]):
        errors.add_texts([label, *texts])
    console.print(errors)


def _hole(hole: dict[str, Any]) -> str:
    size = f"{hole['solid_angle_sr']:.4f} sr, {100.0 * hole['fraction']:.2f} % of the sphere"
    # adding zero takes the sign from a zero that rounding made
    x, y, z = (round(part, 3) + 0.0 for part in hole["centre_b"])
    if x == y == z == 0.0:
        return f"all around the body, {size}"
    return f"about ({x:.3f}, {y:.3f}, {z:.3f}), {size}, a cone of half angle {hole['half_angle_deg']:.1f} deg"


def _error_rows(*results: dict[str, Any]) -> list[tuple[str, list[str]]]:
    def span(limits: tuple[float, float] | None) -> str:
        return "nowhere" if limits is None else f"{limits[0]:.1f} to {limits[1]:.1f}"

    def number(value: float | None, digits: int = 1) -> str:
        return "-" if value is None else f"{value:.{digits}f}"

    rows = [
        ("mean error", [number(r["mean_deg"], 2) for r in results]),
        ("largest error", [number(r["max_deg"]) for r in results]),
        ("share of the sphere above 30, %", [number(100.0 * r["fraction_above_30"], 2) for r in results]),
        (
            "Sun angles with some azimuths above 30",
            [span(r["polar_max_above_30"]) for r in results],
        ),
        ("Sun angles with their mean above 30", [span(r["polar_mean_above_30"]) for r in results]),
        ("Sun angles with all azimuths above 30", [span(r["polar_all_above_30"]) for r in results]),
        ("first Sun angle with an error above 10", [number(r["first_polar_above_10"]) for r in results]),
    ]
    for cone in results[0]["max_within_deg"]:
        largest = [number(r["max_within_deg"][cone], 2) for r in results]
        rows.append((f"largest error within a Sun angle of {cone}", largest))
    return rows
