# SPDX-License-Identifier: Apache-2.0
"""Direction to the Sun at each instant by all cells together: a vote that one liar cannot win.

Of directions all over the sphere that counts which the outputs contradict least, each cell counting at most once
(truncated squares). Where another direction far from it is as good, nobody knows.
"""

import math
from typing import NamedTuple

import numpy as np

from css_calibration.recorded import Recorded
from css_common.kernel import kernel, typed_call
from css_common.vectors import Vec3, dot, row
from css_estimation.sun.direction_grid import direction
from css_sensors.cells import half_view_cosine, own_view_cosines, plane_sides

DIRECTIONS = 1500
ABSOLUTE, SHARE = 0.12, 0.2
"""Error of an output that is no contradiction: Earth, calibration, response."""
LEAST_LIT = 0.3
"""No Sun unless a cell reads more."""
FAR_COS = math.cos(math.radians(25.0))
CLEAR = 0.15
"""Contradictions for each instant by which a direction has to be better than any far from it."""


class Views(NamedTuple):
    """What N cells see."""

    normals_b: np.ndarray  # (N, 3)
    half_cosines: np.ndarray  # (N,) of their cones of view
    sides: np.ndarray  # (N,) of the body plane
    clip_normal_b: np.ndarray  # (3,)


def views_of(recorded: Recorded) -> Views:
    """Views of the cells of a recording, as its mission has them."""
    values = recorded.mission.values
    normals_b = np.ascontiguousarray(values.cells.normals, dtype=np.float64)
    own = own_view_cosines(values)
    halves = own if len(own) else np.full(len(normals_b), half_view_cosine(values))
    clip_normal_b = np.ascontiguousarray(values.cells.clip_normal, dtype=np.float64)
    return Views(normals_b, halves, np.ascontiguousarray(plane_sides(values)), clip_normal_b)


def sun_by_cells(recorded: Recorded) -> np.ndarray:
    """(M, 3) unit vectors in b; NaN where the cells do not tell."""
    grid = np.array([direction.py_func(g, DIRECTIONS) for g in range(DIRECTIONS)])
    out = np.full((len(recorded.stamp_ns), 3), np.nan)
    _votes(views_of(recorded), grid, np.ascontiguousarray(recorded.voltages), out, np.zeros(DIRECTIONS))
    return out


@kernel
def _above(views: Views, s: Vec3) -> float:
    n = views.clip_normal_b
    return n[0] * s[0] + n[1] * s[1] + n[2] * s[2]


@kernel
def light_on(views: Views, i: int, s: Vec3) -> float:
    """Light of a Sun at s on cell i [-]."""
    cosine = dot(row(views.normals_b, i), s)
    if cosine <= 0.0 or cosine < views.half_cosines[i]:
        return 0.0
    side = views.sides[i]
    return 0.0 if side != 0.0 and side * _above(views, s) <= 0.0 else cosine


@kernel
def contradictions(views: Views, voltages, k: int, s: Vec3, sunny: bool) -> float:
    """How far outputs (M, N) of instant k contradict a Sun at s, or darkness: truncated squares."""
    cost = 0.0
    for i in range(voltages.shape[1]):
        v = voltages[k, i]
        if math.isnan(v):
            continue
        light = light_on(views, i, s) if sunny else 0.0
        off = (v - light) / (ABSOLUTE + SHARE * light)
        cost += min(1.0, off * off)
    return cost


@kernel
def _votes_of(views: Views, grid, voltages, out, cost) -> None:
    for k in range(voltages.shape[0]):
        brightest = 0.0
        for i in range(voltages.shape[1]):
            if voltages[k, i] > brightest:
                brightest = voltages[k, i]
        if brightest < LEAST_LIT:
            continue
        best = 0
        for g in range(grid.shape[0]):
            cost[g] = contradictions(views, voltages, k, row(grid, g), True)
            if cost[g] < cost[best]:
                best = g
        rival = math.inf
        for g in range(grid.shape[0]):
            if dot(row(grid, g), row(grid, best)) < FAR_COS:
                rival = min(rival, cost[g])
        if rival - cost[best] < CLEAR:
            continue
        x = y = z = 0.0
        for g in range(grid.shape[0]):
            if dot(row(grid, g), row(grid, best)) >= FAR_COS:
                weight = math.exp(4.0 * (cost[best] - cost[g]))
                x, y, z = x + weight * grid[g, 0], y + weight * grid[g, 1], z + weight * grid[g, 2]
        length = math.sqrt(x * x + y * y + z * z)
        out[k, 0], out[k, 1], out[k, 2] = x / length, y / length, z / length


_votes = typed_call(_votes_of)
