# SPDX-License-Identifier: Apache-2.0
"""Reflectivities of the Earth under clouds that drift with the wind and become others in time.

What is drawn of a cell, in standard deviations about its mean, is a field g that moves east over the ground and is
renewed; mean and standard deviation stay with the ground. Independent fields g_k follow each other at intervals T,

    g = cos(pi/2 u) g_k + sin(pi/2 u) g_k+1,        u from 0 to 1 within an interval,

which keeps the variance at every instant and lets clouds forget what they were: over all phases of the interval, which
is drawn per case, the correlation after s T is (1 - s/2) cos(pi/2 s) + sin(pi/2 s) / pi, 1/pi after T. A field that has
moved by part of a column is taken from its two columns in the same way, divided by what their likeness adds.

Nothing is carried from instant to instant, so that clouds do not depend on when they were looked at before.
"""

import math
from typing import NamedTuple

import numpy as np

from css_common.kernel import kernel
from css_common.random_streams import RandomKey, Stream, normal4, uniform4
from css_environment.constants import EARTH_RADIUS
from css_environment.reflectivity import HIGHEST, LOWEST, Reflectivity, draws_of_cells, smoothing

CLOUD_STEP_NS = 10_000_000_000
"""Clouds stand still for so long after the epoch, then again: at 20 m/s they move by 200 m in that time."""

COMMON, PER_CELL, CORRELATED = 0, 1, 2
"""Draws of a field: one for the whole Earth, one for each cell, or alike over an angle."""


class Clouds(NamedTuple):
    """What the clouds of all cases have in common."""

    moving: bool
    mean: np.ndarray  # (rows, columns) [-]
    std: np.ndarray  # (rows, columns) [-]
    alike: np.ndarray  # (rows,) correlation of neighbours in a row of a field
    factor: float  # multiplies reflectivities
    limit: float  # they are cut to this


class CloudMotion(NamedTuple):
    """How the clouds of one case move."""

    drift: float  # [columns/s] eastward
    renewal: float  # [1/s] intervals of new fields; 0: never
    phase: float  # [-] part of an interval that is over at the epoch


def draw_motion(key: RandomKey, columns: int, speed: float, speed_spread: float, interval: float) -> CloudMotion:
    """The motion of one case.

    Args:
        columns: of the grid.
        speed: eastward at the equator [m/s].
        speed_spread: 1 sigma of the cases about it [m/s].
        interval: T [s]; 0: clouds stay.
    """
    n, u = normal4(key, Stream.CLOUDS, 0, 0), uniform4(key, Stream.CLOUDS, 0, 1)
    drift = (speed + speed_spread * n[0]) / EARTH_RADIUS * columns / (2.0 * math.pi)
    return CloudMotion(drift, 1.0 / interval, u[0]) if interval > 0.0 else CloudMotion(drift, 0.0, 0.0)


def fields_needed(interval: float, duration_s: float) -> int:
    """Fields that a flight sees."""
    return 1 if interval <= 0.0 else math.floor(duration_s / interval + 1.0) + 2


def draw_fields(grid: Reflectivity, key: RandomKey, kind: int, length: float, count: int) -> np.ndarray:
    """(count, rows, columns) fields of one case, the first that of `reflectivity` where it is drawn once.

    Args:
        kind: COMMON, PER_CELL or CORRELATED.
        length: [rad] of correlated ones.
    """
    rows, columns = grid.mean.shape
    fields = np.zeros((count, rows * columns))
    for number, field in enumerate(fields):
        if kind == COMMON:
            field[:] = normal4(key, Stream.ALBEDO, 0, number)[0]
        else:
            draws_of_cells(key, number, field)
        if kind == CORRELATED:
            field[:] = smoothing(rows, columns, length) @ field
    return fields.reshape(count, rows, columns)


def likeness(grid: Reflectivity, kind: int, length: float) -> np.ndarray:
    """(rows,) correlation of neighbours in a row of a field."""
    rows, columns = grid.mean.shape
    if kind != CORRELATED:
        return np.full(rows, 1.0 if kind == COMMON or columns == 1 else 0.0)
    weights = smoothing(rows, columns, length).reshape(rows, columns, -1)
    return np.sum(weights[:, 0] * weights[:, 1 % columns], axis=1)


@kernel
def is_cloud_step(elapsed_ns: int, period_ns: int) -> bool:
    """Whether clouds move at a stamp, the last of which was a period before."""
    return elapsed_ns // CLOUD_STEP_NS != (elapsed_ns - period_ns) // CLOUD_STEP_NS


@kernel
def reflect(p: Clouds, motion: CloudMotion, fields, elapsed_ns: int, values_out) -> None:
    """Reflectivities (rows, columns) of a case at a stamp, after the epoch [ns].

    Args:
        fields: (F, rows, columns) of `draw_fields`; after the last there are no new ones.
    """
    elapsed_s = (elapsed_ns // CLOUD_STEP_NS) * (CLOUD_STEP_NS * 1e-9)
    age = motion.phase + elapsed_s * motion.renewal
    number = min(math.floor(age), fields.shape[0] - 1)
    following = min(number + 1, fields.shape[0] - 1)
    old, new = _weights(age - number) if following > number else (1.0, 0.0)
    shift = elapsed_s * motion.drift
    whole = math.floor(shift)
    near, far = _weights(shift - whole)
    rows, columns = values_out.shape
    for i in range(rows):
        scale = 1.0 / math.sqrt(1.0 + 2.0 * near * far * p.alike[i])
        a, b, c, d = scale * near * old, scale * far * old, scale * near * new, scale * far * new
        for j in range(columns):
            here = (j - whole) % columns
            west = (here - 1) % columns
            g = a * fields[number, i, here] + b * fields[number, i, west]
            g += c * fields[following, i, here] + d * fields[following, i, west]
            value = min(HIGHEST, max(LOWEST, p.mean[i, j] + p.std[i, j] * g))
            values_out[i, j] = min(p.factor * value, p.limit)


@kernel
def _weights(part: float) -> tuple[float, float]:
    """Weights of two draws whose squares add up to one."""
    return math.cos(0.5 * math.pi * part), math.sin(0.5 * math.pi * part)
