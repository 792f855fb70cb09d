# SPDX-License-Identifier: Apache-2.0
"""Shadows of structure on a cell: a map over the directions of the Sun in which it reads less than the light on it."""

import math
from typing import NamedTuple

import numpy as np

from css_calibration.batch_fit import Fit
from css_calibration.cell_data import CellData
from css_estimation.sun.direction_grid import direction

PATCHES = 300
"""Patches of the sphere: 12 deg from one to the next."""
_LOSS = 0.25  # of the light
_LEAST_IN_PATCH, _LEAST_SHADED = 2, 10
_PURE = 0.8  # share of the lit outputs of a shaded patch that are shaded
_VISITS = 2  # apart in time, with light from other directions between


class Shadow(NamedTuple):
    """On one cell."""

    directions_b: tuple[tuple[float, float, float], ...]  # middles of the shaded patches
    shaded: int  # outputs in them
    first: int
    last: int
    evidence: str


def patches() -> np.ndarray:
    """(P, 3) middles of the patches."""
    return np.array([direction.py_func(g, PATCHES) for g in range(PATCHES)])


def shadows_of(data: CellData, result: Fit, cell: int) -> Shadow | None:
    """Directions in which a cell that is right in others loses light whenever the Sun comes from there."""
    expected, _, _ = data.predicted(result.parameters, result.earth)
    rows = np.flatnonzero(data.usable[:, cell] & data.seen[:, cell] & (expected[:, cell] > 0.25))
    if len(rows) < 2 * _LEAST_SHADED:
        return None
    loss = 1.0 - data.voltages[rows, cell] / expected[rows, cell]
    shaded = loss > _LOSS
    if not _LEAST_SHADED <= shaded.sum() < 0.7 * len(rows):
        return None
    middles = patches()
    patch = np.argmax(data.sun_b[rows] @ middles.T, axis=1)
    total = np.bincount(patch, minlength=PATCHES)
    dark = np.bincount(patch[shaded], minlength=PATCHES)
    is_dark = (total >= _LEAST_IN_PATCH) & (dark >= _PURE * total)
    inside = is_dark[patch]
    # patches at the edge of a shadow are mixed
    if (shaded & inside).sum() < 0.6 * shaded.sum() or inside.sum() < _LEAST_SHADED:
        return None
    if _visits(inside, shaded) < _VISITS or _by_time(shaded) > _by_patch(shaded, patch):
        return None
    first, last = rows[np.flatnonzero(shaded)[[0, -1]]]
    centre = data.sun_b[rows[inside]].mean(axis=0)
    centre = centre / np.linalg.norm(centre)
    width = math.degrees(math.acos(min(1.0, float(np.min(middles[is_dark] @ centre)))))
    evidence = (
        f"{int((shaded & inside).sum())} of {int(inside.sum())} outputs lose light with the Sun within {width:.0f} deg "
        f"of ({centre[0]:.2f}, {centre[1]:.2f}, {centre[2]:.2f}), on average {100.0 * float(loss[inside].mean()):.0f} %"
    )
    return Shadow(
        tuple((float(x), float(y), float(z)) for x, y, z in middles[is_dark].round(3)), int(inside.sum()), int(first),
        int(last), evidence,
    )  # fmt: skip


def _visits(inside: np.ndarray, shaded: np.ndarray) -> int:
    """How often the Sun came into the shaded patches, after outputs that were right."""
    now = inside & shaded
    right = ~inside & ~shaded
    visits, free = 0, True
    for in_shadow, fine in zip(now.tolist(), right.tolist(), strict=True):
        if in_shadow and free:
            visits, free = visits + 1, False
        elif fine:
            free = True
    return visits


def _by_patch(shaded: np.ndarray, patch: np.ndarray) -> float:
    """Share of the outputs that the better guess for each patch has right."""
    dark = np.bincount(patch[shaded], minlength=PATCHES)
    total = np.bincount(patch, minlength=PATCHES)
    return float(np.maximum(dark, total - dark).sum() / total.sum())


def _by_time(shaded: np.ndarray) -> float:
    """The same for one stretch of time, the best one."""
    count = len(shaded)
    gain = np.where(shaded, 1.0, -1.0)
    sums = np.concatenate([[0.0], np.cumsum(gain)])
    lowest = np.minimum.accumulate(sums)
    best = float(np.max(sums - lowest))
    return ((count - shaded.sum()) + best) / count
