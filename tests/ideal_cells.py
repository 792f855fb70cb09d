# SPDX-License-Identifier: Apache-2.0
"""Outputs of cells without noise, albedo and degradation, and the grid on which maps of the sphere are made."""

import math

import numpy as np

from css_common.kernel import kernel
from css_estimation.sun.cell_layout import sees

POLAR = (np.arange(720) + 0.5) * math.pi / 720
AZIMUTH = (np.arange(1440) + 0.5) * 2.0 * math.pi / 1440
WEIGHT = np.sin(POLAR) / np.sin(POLAR).sum()  # of a row of the map


def percent_of_sphere(condition):
    return 100.0 * (WEIGHT @ condition.mean(axis=1))


@kernel
def direction(polar, azimuth):
    """Unit vector at these angles [rad]."""
    return (math.sin(polar) * math.cos(azimuth), math.sin(polar) * math.sin(azimuth), math.cos(polar))


@kernel
def ideal_outputs(layout, s, warp, scale, voltages):
    """Outputs for the Sun in direction `s`; returns how many cells see it."""
    seen = 0
    for i in range(voltages.size):
        cell = layout.cells[i]
        v = 0.0
        if sees(layout, i, s):
            seen += 1
            v = cell.nx * s[0] + cell.ny * s[1] + cell.nz * s[2]
            if warp:
                b2 = 1.0 - v * v
                v *= 1.0 + 0.5 * b2 - 0.65 * b2 * b2
        voltages[i] = scale * v
    return seen
