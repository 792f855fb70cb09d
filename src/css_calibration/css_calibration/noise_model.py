# SPDX-License-Identifier: Apache-2.0
"""How outputs err, read off the residuals of a fit: by medians, so that outliers do not enter."""

import math
from typing import NamedTuple

import numpy as np

_NORMAL = 1.4826  # standard deviation over median absolute deviation of normal noise
_FEW = 30
_DARK, _LIT = 0.05, 0.3
_CLOUDS = 0.3  # of the light of the Earth on one cell, 1 sigma, as the Sun filter has it (albedo.cloud_sigma)
_LEAST = 1e-4
_STRETCH_S = 140.0  # in which clouds stay what they are: twice albedo.cloud_time


class Noise(NamedTuple):
    """Of one output."""

    white: float  # [-] 1 sigma
    relative: float  # [-] of what is expected, 1 sigma
    alike: float  # share of the relative error's variance that all cells have in common at an instant
    clouds: float  # [-] of the predicted light of the Earth, 1 sigma
    unknown: float = 0.0  # [-] light of an Earth that nobody predicts, 1 sigma
    lasting_s: float = _STRETCH_S  # [s] for which clouds stay

    def variance(self, expected: np.ndarray, earthly: np.ndarray, parameters: np.ndarray) -> np.ndarray:
        """(M, N) of outputs, by what is expected of them and by their slope (M, N) by the Earth's brightness."""
        dark = parameters[None, :, 1]
        return self.white**2 + (self.relative * (expected - dark)) ** 2 + (self.clouds * earthly) ** 2


def spread(values: np.ndarray) -> float:
    """Standard deviation about zero of normal values with some outliers."""
    return _NORMAL * float(np.median(np.abs(values))) if len(values) else 0.0


def noise_of(
    off: np.ndarray, expected: np.ndarray, earthly: np.ndarray, counts: np.ndarray, earth_known: bool
) -> Noise:
    """Noise by residuals (M, N) of outputs that count (M, N)."""
    clouds = _CLOUDS if earth_known else 0.0
    dark = counts & (np.abs(expected) < _DARK) & (np.abs(earthly) < 0.2 * _DARK)
    lit = counts & (expected > _LIT)
    chosen = off[dark] if dark.sum() >= _FEW else off[counts]
    white = max(_LEAST, spread(chosen))
    relative, alike = 0.0, 0.0
    if lit.sum() >= _FEW:
        cloudy = np.median((clouds * earthly[lit] / expected[lit]) ** 2)
        square = spread(off[lit] / expected[lit]) ** 2 - (white / float(np.median(expected[lit]))) ** 2 - cloudy
        relative = math.sqrt(max(0.0, float(square)))
        alike = _alike(np.where(lit, off / np.where(lit, expected, 1.0), 0.0), lit)
    return Noise(white, relative, alike, clouds, 0.0 if earth_known else _unknown(off, expected, counts))


def _alike(relative: np.ndarray, lit: np.ndarray) -> float:
    """Correlation between the relative errors of cells that are lit at the same instant, 0 to 1."""
    limit = 4.0 * spread(relative[lit])
    z = np.clip(relative, -limit, limit)
    several = lit.sum(axis=1) >= 2
    if several.sum() < _FEW:
        return 1.0
    squares = (z[several] ** 2).sum(axis=1)
    products = z[several].sum(axis=1) ** 2 - squares
    pairs = ((lit[several].sum(axis=1) - 1) * squares).sum()
    return float(np.clip(products.sum() / pairs, 0.0, 1.0)) if pairs > 0.0 else 1.0


def _unknown(off: np.ndarray, expected: np.ndarray, counts: np.ndarray) -> float:
    """Light of an Earth that nobody predicts: how far stretches of what cells read away from the Sun differ."""
    away = counts & (np.abs(expected) < _DARK)
    rows = np.arange(len(off))
    blocks = np.array_split(rows, max(2, min(24, len(rows) // 20)))
    means = [off[b, i][away[b, i]].mean() for b in blocks for i in range(off.shape[1]) if away[b, i].sum() >= 5]
    if len(means) < 4:
        return 0.0
    within = spread(off[away]) / math.sqrt(5.0)
    return math.sqrt(max(0.0, float(np.mean(np.square(means))) - within**2))


def slow_factor(
    noise: Noise,
    time: np.ndarray,
    rows: np.ndarray,
    cells: np.ndarray,
    off: np.ndarray,
    expected: np.ndarray,
    earthly: np.ndarray,
) -> float:
    """How far sums of residuals over stretches of one cell are above what their noise explains; at least 1."""
    block = np.floor(time / noise.lasting_s).astype(np.int64)[rows]
    key = block * off.shape[1] + cells
    _, place = np.unique(key, return_inverse=True)
    size = int(place.max(initial=-1)) + 1
    sums, variances, clouded = np.zeros(size), np.zeros(size), np.zeros(size)
    np.add.at(sums, place, off[rows, cells])
    np.add.at(variances, place, noise.white**2 + (noise.relative * expected[rows, cells]) ** 2)
    np.add.at(clouded, place, noise.clouds * np.abs(earthly[rows, cells]))
    ratio = sums**2 / np.maximum(variances + clouded**2, 1e-12)
    return math.sqrt(max(1.0, float(np.mean(ratio)))) if size else 1.0
