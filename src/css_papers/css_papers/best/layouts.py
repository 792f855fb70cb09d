# SPDX-License-Identifier: Apache-2.0
"""Layouts of cells that spacecraft carry."""

from typing import NamedTuple

import numpy as np

from css_common.mission import load_mission

_FACES = np.vstack([np.eye(3), -np.eye(3)])


class Layout(NamedTuple):
    """Cells of one kind on a body that hides nothing."""

    normals: np.ndarray  # (N, 3) in b
    field_of_view_deg: float = 180.0

    @property
    def settings(self) -> dict[str, str]:
        """Changes of a mission that give it this layout."""
        return {
            "cells.normals": ",".join(f"{c:.17g}" for c in self.normals.ravel()),
            "cells.field_of_view_deg": f"{self.field_of_view_deg:g}",
            "cells.clip_normal": "0,0,0",
        }


def _ring(count: int, off_axis_deg: float) -> np.ndarray:
    """Normals around +z."""
    azimuth, off = 2.0 * np.pi * np.arange(count) / count, np.radians(off_axis_deg)
    return np.column_stack([np.sin(off) * np.cos(azimuth), np.sin(off) * np.sin(azimuth), np.full(count, np.cos(off))])


def layouts() -> dict[str, Layout]:
    """By name: six faces with one cell or two, a pyramid about +z, a belt of four, and Clark's fourteen."""
    clark = load_mission("clark_1996_flat").values.cells
    return {
        "six faces": Layout(_FACES),
        "twelve cells, two a face": Layout(np.repeat(_FACES, 2, axis=0)),
        "single pyramid": Layout(_ring(4, 45.0), 120.0),
        "four coplanar": Layout(_ring(4, 90.0)),
        "Clark's fourteen": Layout(np.asarray(clark.normals).reshape(-1, 3), float(clark.field_of_view_deg)),
    }
