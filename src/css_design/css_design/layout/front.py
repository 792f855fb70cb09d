# SPDX-License-Identifier: Apache-2.0
"""The front of error against number of cells, each point a mission that flies."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from css_common.mission import Mission, MissionError
from css_common.preflight import preflight
from css_common.sections import name_for_files
from css_design.errors import DesignError
from css_design.layout.heading_error import HeadingError
from css_design.layout.search import Found


class Point(NamedTuple):
    """One number of cells.

    Attributes:
        found: its best layout.
        on_front: no layout of fewer cells is as good.
        mission: file that flies it; empty: none was written.
    """

    found: Found
    on_front: bool
    mission: str

    def as_object(self) -> dict[str, Any]:
        """What `--json` says."""
        return {
            "cells": len(self.found.normals_b),
            **error_object(self.found.error),
            "cost_deg": self.found.cost,
            "on_front": self.on_front,
            "mission": self.mission,
            "normals": [[float(x) for x in normal] for normal in self.found.normals_b],
        }


def error_object(error: HeadingError) -> dict[str, float]:
    """Errors of a layout in deg, by name."""
    return {
        "mean_deg": math.degrees(error.mean),
        "worst_deg": math.degrees(error.worst),
        "failed_mean_deg": math.degrees(error.failed),
        "failed_worst_deg": math.degrees(error.failed_worst),
        "unseen_share": error.unseen,
    }


def front_of(best: Mapping[int, Found], missions: Mapping[int, str]) -> list[Point]:
    """Points by number of cells."""
    points, least = [], math.inf
    for count in sorted(best):
        found = best[count]
        points.append(Point(found, found.cost < least, missions.get(count, "")))
        least = min(least, found.cost)
    return points


def mission_with_cells(mission: Mission, normals_b: np.ndarray) -> Mission:
    """The mission with other cells, named after their number.

    Raises:
        DesignError: it does not fly with them.
    """
    flat = ",".join(repr(float(x)) for x in normals_b.ravel())
    name = name_for_files(f"{mission.name}_{len(normals_b)}_cells")
    try:
        made = mission.with_overrides([f"cells.normals={flat}", f"mission.name={name}"])
        preflight(made)
    except MissionError as error:
        raise DesignError(f"{mission.name} does not fly with {len(normals_b)} cells: {error}") from error
    return made


def write_missions(mission: Mission, best: Mapping[int, Found], folder: Path) -> tuple[dict[int, str], list[str]]:
    """Files of the missions by number of cells, and what could not be written as one, a line each.

    Raises:
        DesignError: the folder cannot be written.
    """
    written: dict[int, str] = {}
    refused: list[str] = []
    for count, found in sorted(best.items()):
        try:
            made = mission_with_cells(mission, found.normals_b)
        except DesignError as error:
            refused.append(str(error))
            continue
        file = folder / f"{made.name}.yaml"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            file.write_text(made.text(), encoding="utf-8")
        except OSError as error:
            raise DesignError(f"{file}: cannot be written: {error.strerror}") from error
        written[count] = str(file)
    return written, refused
