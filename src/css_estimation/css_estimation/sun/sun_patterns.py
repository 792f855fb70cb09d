# SPDX-License-Identifier: Apache-2.0
"""Where the Sun is, as far as the mere set of cells that see it tells.

Which cells see the Sun, and which do not, confines it to a part of the sphere. The table holds the mean and the
covariance of the directions in each such part, for a Sun that may be anywhere and for ideal cosine cells. It
knows nothing about how the outputs compare.
"""

import math

import numpy as np

from css_common.kernel import kernel
from css_estimation.sun.cell_layout import CellLayout, brightest, sees
from css_estimation.sun.lit_cells import Gate, lit_cells

# Directions on the sphere, 1.4 deg apart.
_DIRECTIONS = 20_000
_HALVINGS = _DIRECTIONS.bit_length()

PATTERN = np.dtype(
    [("mask", np.int64)] + [(name, np.float64) for name in ("x", "y", "z", "xx", "xy", "xz", "yy", "yz", "zz")],
    align=True,
)
"""Mask of the cells that see the Sun; mean of its direction in b, shorter than one; covariance of the direction."""

NO_PATTERNS = np.zeros(0, PATTERN)


def _sphere() -> np.ndarray:
    """Directions (K, 3) that share the sphere evenly: a spiral with the golden angle (Swinbank & Purser 2006)."""
    k = np.arange(_DIRECTIONS) + 0.5
    z = 1.0 - 2.0 * k / _DIRECTIONS
    azimuth = k * math.pi * (3.0 - math.sqrt(5.0))
    across = np.sqrt(1.0 - z * z)
    return np.stack([across * np.cos(azimuth), across * np.sin(azimuth), z], axis=1)


@kernel
def _masks(layout: CellLayout, gate: Gate, sphere, voltages, masks_out) -> None:
    for k in range(sphere.shape[0]):
        s = (sphere[k, 0], sphere[k, 1], sphere[k, 2])
        for i in range(voltages.shape[0]):
            cell = layout.cells[i]
            voltages[i] = cell.nx * s[0] + cell.ny * s[1] + cell.nz * s[2] if sees(layout, i, s) else 0.0
        masks_out[k] = lit_cells(layout, gate, voltages, brightest(voltages))[1]


def sun_patterns(layout: CellLayout, gate: Gate) -> np.ndarray:
    """Table (P,) of PATTERN, by rising mask: all sets of cells that some direction of the Sun puts above the gate."""
    sphere = _sphere()
    masks = np.zeros(len(sphere), dtype=np.int64)
    _masks(layout, gate, sphere, np.zeros(layout.cells.shape[0]), masks)
    found, which, count = np.unique(masks, return_inverse=True, return_counts=True)

    def mean_of(values: np.ndarray) -> np.ndarray:
        return np.bincount(which, weights=values) / count

    table = np.zeros(len(found), PATTERN)
    table["mask"] = found
    axes = dict(zip("xyz", sphere.T, strict=True))
    for name, component in axes.items():
        table[name] = mean_of(component)
    for a, b in ("xx", "xy", "xz", "yy", "yz", "zz"):
        table[a + b] = mean_of(axes[a] * axes[b]) - table[a] * table[b]
        if a == b:
            # each direction stands for a patch of the sphere, whose own variance per axis is area / 4 pi
            table[a + b] += 1.0 / _DIRECTIONS
    return table[found != 0]


@kernel
def find_pattern(patterns, mask: int) -> int:
    """Index of a set of cells in the table; -1: no direction of the Sun gives it."""
    low, high = 0, patterns.shape[0]
    # each round halves what is left of a table, which has no more rows than there are directions
    for _ in range(_HALVINGS):
        if low >= high:
            break
        middle = (low + high) // 2
        if patterns[middle].mask < mask:
            low = middle + 1
        else:
            high = middle
    return low if low < patterns.shape[0] and patterns[low].mask == mask else -1
