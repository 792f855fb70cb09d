# SPDX-License-Identifier: Apache-2.0
"""A body that turns evenly in the Sun, and what the health of its cells makes of them."""

import math

import numpy as np

from css_common import health
from css_common.attitude import rotation_vector_to_dcm
from css_common.kernel import typed_call
from css_common.schema import default_values
from css_estimation.health import cell_health, cell_memory, cell_options
from css_estimation.sun.sun_heading import RATE_GYRO, RATE_NONE, UNKNOWN_SKY
from css_sensors.cells import CELLS

PERIOD = 0.1
RING = [[math.cos(a) * 0.7071, math.sin(a) * 0.7071, z] for z in (0.7071, -0.7071) for a in np.arange(4) * math.pi / 2]
SIX = [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]
_GOLDEN = 0.5 * (1.0 + math.sqrt(5.0))
TWELVE = [
    list(np.roll([0.0, a, b], k)) for k in range(3) for a in (1.0, -1.0) for b in (_GOLDEN, -_GOLDEN)
]  # corners of an icosahedron: every direction is seen by several cells
NOISE = 0.005
to_dcm = typed_call(rotation_vector_to_dcm)
_watch = typed_call(cell_health.watch_cells)


class Body:
    """Cells of a body that turns evenly in the Sun, without the Earth, and what their health makes of them."""

    def __init__(self, normals=RING, view_deg=120.0, seed=1, gyro=True, **changes):
        self.normals = np.array(normals, dtype=np.float64)
        self.normals /= np.linalg.norm(self.normals, axis=1)[:, np.newaxis]
        shape = {"cells__normals": self.normals.ravel(), "cells__field_of_view_deg": view_deg}
        values = default_values(CELLS + cell_options.PARAMETERS, **shape, **changes)
        self.p = cell_options.parameters(values)
        self.memory = cell_memory.new_memory(len(self.normals))
        self.state = cell_health.initial_state()
        self.omega = np.radians([1.1, -0.7, 0.4])
        self.sun = np.array([0.35, 0.2, 0.9]) / np.linalg.norm([0.35, 0.2, 0.9])
        self.edge = math.cos(math.radians(0.5 * view_deg))
        self.random = np.random.default_rng(seed)
        self.gyro, self.sky, self.light, self.time = gyro, UNKNOWN_SKY, 1.0, 0.0
        self.earth, self.earth_light = np.array([0.0, 0.0, -1.0]), 0.0
        self.true_normals, self.gains = self.normals, np.ones(len(self.normals))

    def uncalibrated(self):
        """Gains that err by 2 % and normals that err by 1 deg about each axis, 1 sigma, and light of the Earth."""
        shape = self.normals.shape
        tilted = self.normals + np.cross(np.radians(1.0) * self.random.standard_normal(shape), self.normals)
        self.true_normals = tilted / np.linalg.norm(tilted, axis=1)[:, np.newaxis]
        self.gains = 1.0 + 0.02 * self.random.standard_normal(shape[:1])
        self.earth_light = 0.25
        return self

    def outputs(self):
        cosines = self.true_normals @ self.sun
        lit = np.where(cosines >= self.edge, np.maximum(cosines, 0.0), 0.0)
        lit += self.earth_light * np.maximum(self.true_normals @ self.earth, 0.0) ** 2
        lit *= self.gains
        return np.maximum(self.light * lit + NOISE * self.random.standard_normal(len(cosines)), 0.0)

    def fly(self, seconds, spoil=lambda v, t: v):
        """The mask of cells that were ever held for failed, and the time of the first."""
        ever, first = 0, math.nan
        for _ in range(round(seconds / PERIOD)):
            turn = np.array(to_dcm(tuple((PERIOD * self.omega).tolist())))
            self.sun, self.earth = turn @ self.sun, turn @ self.earth
            self.time += PERIOD
            v = np.array(spoil(self.outputs(), self.time), dtype=np.float64)
            source = RATE_GYRO if self.gyro else RATE_NONE
            omega = tuple(self.omega.tolist()) if self.gyro else (0.0, 0.0, 0.0)
            self.state = _watch(self.p, self.state, self.memory, PERIOD, v, omega, source, self.sky)
            if self.state.isolated and not ever:
                first = self.time
            ever |= self.state.isolated
        return ever, first

    def verdict(self, i):
        return next(verdict for verdict in health.verdicts_of(self.memory.verdicts) if verdict.unit == i)


def with_cell(i, value):
    def spoil(v, t):
        v[i] = value(v[i], t)
        return v

    return spoil
