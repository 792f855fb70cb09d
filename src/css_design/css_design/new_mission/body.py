# SPDX-License-Identifier: Apache-2.0
"""A box with deployed panels: its moments of inertia, and the faces that air and sunlight push on."""

import math
from typing import NamedTuple

import numpy as np

from css_design.errors import DesignError
from css_design.new_mission.directions import FACES, Vector, axis_of, direction

PANEL_DENSITY = 3.0
"""Mass of a deployed panel with cells on one side [kg/m^2], of 1.6 mm of printed board; hinges included."""

_MOST_ON_PANELS = 0.5  # of the mass


class Panel(NamedTuple):
    """A flat panel that stands out from a face of the box."""

    hinge: Vector  # outward normal of the face that it stands out from
    normal: Vector  # of its sunny side
    length: float  # [m] outward
    cells: int  # Sun sensor cells on its sunny side


class Plates(NamedTuple):
    """Flat surfaces, a row each, from the centre of mass."""

    areas: np.ndarray  # (N,) [m^2]
    normals: np.ndarray  # (N, 3)
    centres: np.ndarray  # (N, 3) [m]


def panels_of(text: str | None) -> tuple[Panel, ...]:
    """Panels as people write them: `+y:+z:0.3:1 -y:+z:0.3`.

    Raises:
        DesignError: they are no panels.
    """
    return () if text is None else tuple(_panel(word) for word in text.split())


def _panel(word: str) -> Panel:
    parts = word.split(":")
    try:
        hinge, normal = direction(parts[0]), direction(parts[1])
        length, cells = float(parts[2]), int(parts[3]) if len(parts) == 4 else 0
    except (DesignError, ValueError, IndexError):
        parts = []
    if not 3 <= len(parts) <= 4 or hinge not in FACES.values() or normal not in FACES.values():
        raise DesignError(
            f"--panels: {word!r} given, expected hinge face:sunny side:length[:cells], such as +y:+z:0.3:1"
        )
    if axis_of(hinge) == axis_of(normal):
        raise DesignError(f"--panels: {word!r} given, expected a sunny side across the hinge face")
    if not 0.001 <= length <= 100.0 or not 0 <= cells <= 8:
        raise DesignError(f"--panels: {word!r} given, expected a length of 0.001 to 100 m and 0 to 8 cells")
    return Panel(hinge, normal, length, cells)


def _placed(size: np.ndarray, panel: Panel) -> tuple[float, np.ndarray, np.ndarray]:
    """Area [m^2], extent (3,) along x, y, z and centre (3,) from that of the box [m] of a panel."""
    hinge, normal = np.array(panel.hinge), np.array(panel.normal)
    along, across = axis_of(panel.hinge), axis_of(panel.normal)
    extent = size.copy()
    extent[along], extent[across] = panel.length, 0.0
    centre = hinge * 0.5 * (size[along] + panel.length) + normal * 0.5 * size[across]
    return float(np.prod(np.delete(extent, across))), extent, centre


def _box_inertia(mass: float, extent: np.ndarray) -> np.ndarray:
    """Inertia (3, 3) [kg m^2] of an even box, or of a plate that has no extent along one axis."""
    squares = extent**2
    return np.diag(mass / 12.0 * (squares.sum() - squares))


def inertia_of(size: Vector, mass: float, panels: tuple[Panel, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Inertia (3, 3) [kg m^2] about the centre of mass, and the centre (3,) of the box from there [m].

    Mass is spread evenly over the box, and over each panel with `PANEL_DENSITY`.

    Raises:
        DesignError: the panels alone are heavier than half of the spacecraft.
    """
    box = np.array(size)
    placed = [_placed(box, panel) for panel in panels]
    weights = [PANEL_DENSITY * area for area, _, _ in placed]
    left = mass - sum(weights)
    if left < (1.0 - _MOST_ON_PANELS) * mass:
        raise DesignError(
            f"--panels: {sum(weights):.3g} kg at {PANEL_DENSITY:g} kg/m^2, expected at most "
            f"{_MOST_ON_PANELS:.0%} of --mass {mass:g} kg"
        )
    parts = [(left, box, np.zeros(3)), *((w, e, c) for w, (_, e, c) in zip(weights, placed, strict=True))]
    middle = sum((weight * centre for weight, _, centre in parts), np.zeros(3)) / mass
    total = np.zeros((3, 3))
    for weight, extent, centre in parts:
        off = centre - middle
        total += _box_inertia(weight, extent) + weight * (off @ off * np.eye(3) - np.outer(off, off))
    return total, -middle


def plates_of(size: Vector, box_centre: np.ndarray, panels: tuple[Panel, ...]) -> Plates:
    """The six faces of the box and both sides of each panel."""
    box = np.array(size)
    rows = [
        (math.prod(np.delete(box, axis_of(face))), face, box_centre + 0.5 * box[axis_of(face)] * np.array(face))
        for face in FACES.values()
    ]
    for panel in panels:
        area, _, centre = _placed(box, panel)
        x, y, z = panel.normal
        rows += [(area, panel.normal, box_centre + centre), (area, (-x, -y, -z), box_centre + centre)]
    areas, normals, centres = zip(*rows, strict=True)
    return Plates(np.array(areas), np.array(normals) + 0.0, np.array(centres))
