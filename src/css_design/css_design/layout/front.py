# SPDX-License-Identifier: Apache-2.0
"""The front of error against number of cells, each point a mission that flies."""

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from css_common.mission import Mission, MissionError
from css_common.mission_section import name_for_files
from css_common.preflight import preflight
from css_common.whole_files import write_whole
from css_design.errors import DesignError
from css_design.layout.heading_error import HeadingError
from css_design.layout.readings import Cells
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
            "cells": self.found.cells.number,
            **error_object(self.found.error),
            "cost_deg": self.found.cost,
            "on_front": self.on_front,
            "mission": self.mission,
            "normals": [[float(x) for x in normal] for normal in self.found.cells.normals_b],
            "fields_of_view_deg": [float(view) for view in self.found.cells.views_deg],
        }


def error_object(error: HeadingError) -> dict[str, float]:
    """Errors of a layout in deg, by name."""
    return {
        "mean_deg": math.degrees(error.mean),
        "worst_deg": math.degrees(error.worst),
        "failed_mean_deg": math.degrees(error.failed),
        "failed_worst_deg": math.degrees(error.failed_worst),
        "unseen_share": error.unseen,
        "tail_mean_deg": math.degrees(error.tail),
    }


def front_of(best: Mapping[int, Found], missions: Mapping[int, str]) -> list[Point]:
    """Points by number of cells."""
    points, least = [], math.inf
    for count in sorted(best):
        found = best[count]
        points.append(Point(found, found.cost < least, missions.get(count, "")))
        least = min(least, found.cost)
    return points


def mission_with_cells(mission: Mission, cells: Cells, blocked: np.ndarray) -> Mission:
    """The mission with other cells, named after their number.

    Args:
        blocked: masks of `cells.blocked`, or none.

    Raises:
        DesignError: it does not fly with them.
    """
    alike = bool(np.ptp(cells.views_deg) == 0.0)
    overrides = {
        "cells.normals": _words(cells.normals_b.ravel().tolist()),
        "cells.field_of_view_deg": repr(float(cells.views_deg[0])),
        "cells.fields_of_view_deg": "" if alike else _words(cells.views_deg.tolist()),
        "cells.blocked": _words(blocked.tolist()) if np.any(blocked) else "",
        "mission.name": name_for_files(f"{mission.name}_{cells.number}_cells"),
    }
    try:
        made = mission.with_overrides(f"{key}={text}" for key, text in overrides.items())
        preflight(made)
    except MissionError as error:
        raise DesignError(f"{mission.name} does not fly with {cells.number} cells: {error}") from error
    return made


def _words(numbers: list[float]) -> str:
    return ",".join(map(repr, numbers))


def write_missions(
    mission: Mission, best: Mapping[int, Found], blocked: Callable[[Cells], np.ndarray], folder: Path
) -> tuple[dict[int, str], list[str]]:
    """Files of the missions by number of cells, and what could not be written as one, a line each.

    Args:
        blocked: masks of what the structure blocks from cells.

    Raises:
        DesignError: the folder cannot be written.
    """
    written: dict[int, str] = {}
    refused: list[str] = []
    for count, found in sorted(best.items()):
        try:
            made = mission_with_cells(mission, found.cells, blocked(found.cells))
        except DesignError as error:
            refused.append(str(error))
            continue
        written[count] = _written(made, folder)
    return written, refused


def write_own(mission: Mission, cells: Cells, blocked: np.ndarray, folder: Path) -> str:
    """File of the mission as it is, with what a structure blocks from its cells.

    Raises:
        DesignError: it does not fly, or the folder cannot be written.
    """
    made = mission_with_cells(mission, cells, blocked)
    name = name_for_files(f"{mission.name}_blocked")
    return _written(made.with_overrides([f"mission.name={name}"]), folder)


def _written(mission: Mission, folder: Path) -> str:
    file = folder / f"{mission.name}.yaml"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        write_whole(file, mission.text())
    except OSError as error:
        raise DesignError(f"{file}: cannot be written: {error.strerror}") from error
    return str(file)
