# SPDX-License-Identifier: Apache-2.0
"""Direction to the Sun at each instant by all cells together: a vote that one liar cannot win.

Of directions all over the sphere that counts which the outputs contradict least, each cell counting at most once
(truncated squares). Where another direction far from it is as good, nobody knows.
"""

import math

import numpy as np

from css_calibration.recorded import Recorded
from css_common.kernel import kernel, typed_call
from css_estimation.sun.direction_grid import direction
from css_sensors.cells import half_view_cosine, plane_sides

_DIRECTIONS = 1500
_FAR_COS = math.cos(math.radians(25.0))
_CLEAR = 0.15  # by which the best has to be better than any far from it
_LEAST_LIT = 0.3
_ABSOLUTE, _SHARE = 0.12, 0.2  # error of an output that is no contradiction: Earth, calibration


def sun_by_cells(recorded: Recorded, scales: np.ndarray, darks: np.ndarray, normals_b: np.ndarray) -> np.ndarray:
    """(M, 3) unit vectors in b; NaN where the cells do not tell."""
    values = recorded.mission.values
    grid = np.array([direction.py_func(g, _DIRECTIONS) for g in range(_DIRECTIONS)])
    cosine = grid @ normals_b.T
    sides = plane_sides(values)
    above = grid @ np.asarray(values.cells.clip_normal)
    seen = (cosine >= half_view_cosine(values)) & ((sides == 0.0) | (sides * above[:, None] > 0.0))
    light = np.where(seen, np.maximum(cosine, 0.0), 0.0)
    out = np.full((len(recorded.stamp_ns), 3), np.nan)
    _votes(grid, light, np.ascontiguousarray((recorded.voltages - darks) / scales), out, np.zeros(_DIRECTIONS))
    return out


@kernel
def _votes_of(grid, light, voltages, out, cost) -> None:
    for k in range(voltages.shape[0]):
        brightest = 0.0
        for i in range(voltages.shape[1]):
            if voltages[k, i] > brightest:
                brightest = voltages[k, i]
        if brightest < _LEAST_LIT:
            continue
        best = 0
        for g in range(grid.shape[0]):
            cost[g] = 0.0
            for i in range(voltages.shape[1]):
                if math.isnan(voltages[k, i]):
                    continue
                off = (voltages[k, i] - light[g, i]) / (_ABSOLUTE + _SHARE * light[g, i])
                cost[g] += min(1.0, off * off)
            if cost[g] < cost[best]:
                best = g
        rival = math.inf
        for g in range(grid.shape[0]):
            cosine = grid[g, 0] * grid[best, 0] + grid[g, 1] * grid[best, 1] + grid[g, 2] * grid[best, 2]
            if cosine < _FAR_COS:
                rival = min(rival, cost[g])
        if rival - cost[best] < _CLEAR:
            continue
        x = y = z = 0.0
        for g in range(grid.shape[0]):
            cosine = grid[g, 0] * grid[best, 0] + grid[g, 1] * grid[best, 1] + grid[g, 2] * grid[best, 2]
            if cosine >= _FAR_COS:
                weight = math.exp(4.0 * (cost[best] - cost[g]))
                x, y, z = x + weight * grid[g, 0], y + weight * grid[g, 1], z + weight * grid[g, 2]
        length = math.sqrt(x * x + y * y + z * z)
        out[k, 0], out[k, 1], out[k, 2] = x / length, y / length, z / length


_votes = typed_call(_votes_of)
