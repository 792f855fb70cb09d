# SPDX-License-Identifier: Apache-2.0
"""A grid of directions in b, 5 deg by 5 deg: rings from +z to -z, azimuths from -180 deg, x to y."""

import math

import numpy as np

from css_common.kernel import kernel
from css_common.vectors import Vec3

RINGS, AROUND = 36, 72
SIZE = RINGS * AROUND
"""Cells of the grid, ring by ring."""

_PER_RADIAN = RINGS / math.pi


@kernel
def grid_cell(direction: Vec3) -> int:
    """Number of the cell of the grid that a unit vector is in."""
    ring = min(int(math.acos(min(max(direction[2], -1.0), 1.0)) * _PER_RADIAN), RINGS - 1)
    around = min(int((math.atan2(direction[1], direction[0]) + math.pi) * _PER_RADIAN), AROUND - 1)
    return ring * AROUND + around


def grid_directions(finer: int = 1) -> np.ndarray:
    """(SIZE, finer^2, 3) unit vectors in each cell of the grid: centres of finer by finer parts of it."""
    polar = (np.arange(RINGS * finer) + 0.5) * (math.pi / (RINGS * finer))
    azimuth = (np.arange(AROUND * finer) + 0.5) * (2.0 * math.pi / (AROUND * finer)) - math.pi
    around = np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros_like(azimuth)], axis=1)
    all_of_it = np.sin(polar)[:, None, None] * around + np.cos(polar)[:, None, None] * np.array([0.0, 0.0, 1.0])
    parts = all_of_it.reshape(RINGS, finer, AROUND, finer, 3).transpose(0, 2, 1, 3, 4)
    return parts.reshape(SIZE, finer * finer, 3)
