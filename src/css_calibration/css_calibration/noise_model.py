# SPDX-License-Identifier: Apache-2.0
"""How outputs err, read off the residuals of a fit: by medians, so that outliers do not enter."""

import math
from typing import NamedTuple

import numpy as np

from css_calibration.noise_whitening import Errors

_NORMAL = 1.4826  # standard deviation over median absolute deviation of normal noise
_FEW = 30
_DARK, _LIT = 0.05, 0.3
_CLOUDS = 0.3  # of the light of the Earth on one cell, 1 sigma, as the Sun filter has it (albedo.cloud_sigma)
_LEAST = 1e-4
_BEYOND = 4.0  # standard deviations to which an error counts at most
_CLOUD_S, _CLOUD_ANGLE = 70.0, math.radians(50.0)  # in which clouds become others: albedo.cloud_time, cloud_angle_deg
_STRETCH_S = 2.0 * _CLOUD_S
_FEWEST_AWAY = 5  # outputs by which a stretch has a mean


class Noise(NamedTuple):
    """Of one output."""

    white: float  # [-] 1 sigma
    relative: float  # [-] of what is expected, 1 sigma
    alike: float  # share of the relative error's variance that all cells have in common at an instant
    clouds: float  # [-] of the predicted light of the Earth, 1 sigma
    unknown: float = 0.0  # [-] light of an Earth that nobody predicts, 1 sigma

    def variance(self, expected: np.ndarray, earthly: np.ndarray, parameters: np.ndarray) -> np.ndarray:
        """(M, N) of outputs, by what is expected of them and by their slope (M, N) by the Earth's brightness."""
        dark = parameters[None, :, 1]
        return self.white**2 + (self.relative * (expected - dark)) ** 2 + (self.clouds * earthly) ** 2

    def errors(
        self,
        instant: np.ndarray,
        cell: np.ndarray,
        lit: np.ndarray,
        earthly: np.ndarray,
        turned: np.ndarray,
        time: np.ndarray,
    ) -> Errors:
        """The same of K outputs, with what one has in common with another.

        Args:
            instant, cell: (K,) of each, instants growing.
            lit: (K,) expected above the dark level.
            earthly: (K,) slope by the Earth's brightness.
            turned: (M,) [rad] by which the body has turned up to each instant.
            time: (M,) [s].
        """  # fmt: skip
        gone = np.diff(time, prepend=time[:1]) / _CLOUD_S + np.diff(turned, prepend=turned[:1]) / _CLOUD_ANGLE
        own = self.white**2 + (1.0 - self.alike) * (self.relative * lit) ** 2
        common = math.sqrt(self.alike) * self.relative * lit
        return Errors(instant, cell, np.exp(-gone), own, common, self.clouds * earthly)


def spread(values: np.ndarray) -> float:
    """Standard deviation about zero of normal values with some outliers."""
    return _NORMAL * float(np.median(np.abs(values))) if len(values) else 0.0


def noise_of(
    off: np.ndarray, light: np.ndarray, earthly: np.ndarray, counts: np.ndarray, sunlit: np.ndarray, earth_known: bool
) -> Noise:
    """Noise by residuals (M, N) of outputs that count (M, N).

    Args:
        off: (M, N) what is expected less what was read.
        light: (M, N) what is expected above the dark level: a cell away from the Sun may have a high one, of an Earth
            that nobody predicts too.
        earthly: (M, N) slope by the Earth's brightness.
        sunlit: (M,) whether the Sun shines, or is thought to.
        earth_known: its light is predicted.
    """
    clouds = _CLOUDS if earth_known else 0.0
    dark = counts & (np.abs(light) < _DARK) & (np.abs(earthly) < 0.2 * _DARK)
    lit = counts & (light > _LIT)
    chosen = off[dark] if dark.sum() >= _FEW else off[counts]
    white = max(_LEAST, spread(chosen))
    relative, alike = 0.0, 0.0
    if lit.sum() >= _FEW:
        cloudy = float(np.mean((clouds * earthly[lit] / light[lit]) ** 2))
        own = white**2 * float(np.mean(light[lit] ** -2))
        total, shared = _moments(np.where(lit, off / np.where(lit, light, 1.0), 0.0), lit)
        square = max(total - own - cloudy, shared, 0.0)
        relative, alike = math.sqrt(square), shared / square if square > 0.0 else 0.0
    return Noise(white, relative, alike, clouds, 0.0 if earth_known else _unknown(off, light, counts, sunlit))


def _moments(relative: np.ndarray, lit: np.ndarray) -> tuple[float, float]:
    """Mean square of relative errors (M, N) of lit outputs, and that of what cells of an instant have in common."""
    limit = _BEYOND * spread(relative[lit])
    z = np.clip(relative, -limit, limit)
    squares = (z**2).sum(axis=1)
    total = float(squares.sum() / lit.sum())
    count = lit.sum(axis=1)
    pairs = float((count * (count - 1)).sum())
    if pairs < _FEW:
        return total, total
    return total, max(0.0, float((z.sum(axis=1) ** 2 - squares).sum() / pairs))


def _unknown(off: np.ndarray, light: np.ndarray, counts: np.ndarray, sunlit: np.ndarray) -> float:
    """Light of an Earth that nobody predicts, 1 sigma: what cells away from the Sun read above their darkest stretch.

    It is never below zero, so that its mean, which a fit takes for a dark level, is as unknown as its changes are.
    """
    away = counts & (np.abs(light) < _DARK)
    rows = np.arange(len(off))
    blocks = np.array_split(rows, max(2, min(24, len(rows) // 20)))
    squares = []
    for i in range(off.shape[1]):
        told = [(b[away[b, i]], sunlit[b].mean() > 0.5) for b in blocks if away[b, i].sum() >= _FEWEST_AWAY]
        read = np.array([-off[those, i].mean() for those, _ in told])
        squares += [(one - read.min()) ** 2 for one, (_, lit) in zip(read, told, strict=True) if lit]
    if len(squares) < 4:
        return 0.0
    within = spread(off[away]) / math.sqrt(_FEWEST_AWAY)
    return math.sqrt(max(0.0, float(np.mean(squares)) - within**2))


def slow_factor(white: np.ndarray, time: np.ndarray, cells: np.ndarray) -> float:
    """How far sums of residuals over stretches of one cell are above what their noise explains; at least 1.

    Args:
        white: (K,) residuals, of unit variance.
        time: (K,) [s]; cells: (K,) of each.
    """
    stretch = np.floor(time / _STRETCH_S).astype(np.int64) * (int(cells.max(initial=0)) + 1) + cells
    _, place, count = np.unique(stretch, return_inverse=True, return_counts=True)
    sums = np.bincount(place, white)
    return math.sqrt(max(1.0, float(np.mean(sums**2 / count)))) if len(count) else 1.0
