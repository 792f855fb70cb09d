# SPDX-License-Identifier: Apache-2.0
"""What a scene is made of: shapes with a place, a size and a colour. No message and no viewer is known here."""

import math
from typing import NamedTuple

import numpy as np

from css_common.attitude import Quat
from css_common.vectors import Vec3, axes_across

Colour = tuple[float, float, float, float]
"""Red, green, blue and opacity, each 0 to 1."""

CUBE, SPHERE, CYLINDER, ARROW, TRIANGLES, TEXT = "cube", "sphere", "cylinder", "arrow", "triangles", "text"
UPRIGHT: Quat = (0.0, 0.0, 0.0, 1.0)
ORIGIN: Vec3 = (0.0, 0.0, 0.0)

_SECTORS = 16  # of a cone


class Shape(NamedTuple):
    """One thing to draw.

    Attributes:
        group: what it belongs to, by which viewers switch it on and off.
        number: which one of its group.
        kind: CUBE, SPHERE, CYLINDER (along its z axis), ARROW (from the first of `points` to the second), TRIANGLES
            (three `points` each) or TEXT.
        frame: frame_id in which it stands.
        colour: of it.
        size: [m] along its axes; of an arrow shaft and head diameter and length of the head.
        position: [m] of its middle.
        orientation: quaternion (scalar last) that turns vectors from its own axes to those of the frame.
        points: (K, 3) [m] in its own axes.
        text: what is written.
    """

    group: str
    number: int
    kind: str
    frame: str
    colour: Colour
    size: Vec3 = (1.0, 1.0, 1.0)
    position: Vec3 = ORIGIN
    orientation: Quat = UPRIGHT
    points: np.ndarray = np.zeros((0, 3))
    text: str = ""


def along(axis: Vec3) -> Quat:
    """Quaternion (scalar last) that turns z to a unit vector by the shortest way."""
    x, y, z = axis
    if z < -1.0 + 1e-12:
        return (1.0, 0.0, 0.0, 0.0)
    w = math.sqrt(0.5 * (1.0 + z))
    return (-0.5 * y / w, 0.5 * x / w, 0.0, w)


def cone(tip: Vec3, axis: Vec3, half_angle: float, length: float) -> np.ndarray:
    """Triangles (3 K, 3) of the mantle of a cone.

    Args:
        tip: [m] where it begins.
        axis: unit vector along it.
        half_angle: between axis and mantle [rad], up to pi.
        length: of the mantle from tip to rim [m].
    """
    across, up = (np.array(vector) for vector in axes_across(axis))
    turns = np.linspace(0.0, 2.0 * math.pi, _SECTORS + 1)
    out = math.sin(half_angle) * (np.cos(turns)[:, None] * across + np.sin(turns)[:, None] * up)
    rim = np.asarray(tip) + length * (out + math.cos(half_angle) * np.asarray(axis))
    faces = np.empty((_SECTORS, 3, 3))
    faces[:, 0], faces[:, 1], faces[:, 2] = tip, rim[:-1], rim[1:]
    return faces.reshape(-1, 3)
