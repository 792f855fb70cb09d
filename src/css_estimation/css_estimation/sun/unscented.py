# SPDX-License-Identifier: Apache-2.0
"""Square-root unscented filter of six states (van der Merwe & Wan 2001), in arrays that are written in place.

A filter draws points, moves each by its own model, and gathers them to the prediction; it draws again, writes what the
cells would read at each point, and updates. The root of the covariance is never multiplied out: the points' deviations
are added to it one by one, what readings took away is taken off one by one.

All means are taken as differences from the point in the middle: the weights are large numbers that nearly cancel.
"""

import math
from typing import NamedTuple

import numpy as np

from css_common.declared import given, made
from css_common.kernel import kernel
from css_common.schema import flag, real
from css_estimation.sun.square_root import add_vector, set_diagonal, solve_lower, take_vector

STATES = 6
POINTS = 2 * STATES + 1
_INNOVATION = STATES  # row of `cross`


class Spread(NamedTuple):
    """Where points lie and what they weigh."""

    gamma: float  # distance from the middle, in columns of the root
    weight: float  # of each point but the middle one, in means and covariances
    middle: float  # of the middle one in covariances


def spread_of(alpha: float, beta: float, kappa: float) -> Spread:
    """Scaled points (van der Merwe & Wan 2001, Eq. 15)."""
    scale = alpha * alpha * (STATES + kappa)  # n + lambda
    return Spread(math.sqrt(scale), 0.5 / scale, (scale - STATES) / scale + 1.0 - alpha * alpha + beta)


class PointParameters(NamedTuple):
    """How points are used."""

    spread: Spread = made(
        spread_of,
        real("points.alpha", 0.02, "-", "spread of the points", low=0.001, high=1.0),
        real(
            "points.beta", 2.0, "-", "weight of the middle one in covariances; 2 fits normal errors", high=10.0, low=0.0
        ),
        real("points.kappa", 0.0, "-", "second scale of the spread", low=0.0, high=10.0),
    )
    redraw: bool = given(
        flag("points.redraw", True, "draw points anew before an update, so that it knows the process noise")
    )
    centre: bool = given(flag("points.centre", False, "predict the moved estimate; off: the mean of the moved points"))


class UnscentedMemory(NamedTuple):
    """Of six states and N cells."""

    x: np.ndarray  # (6,) estimate
    root: np.ndarray  # (6, 6) lower triangular: covariance = root root^T
    mean: np.ndarray  # (6,) of the points
    points: np.ndarray  # (13, 6), the middle one first
    outputs: np.ndarray  # (13, N) what the cells in use would read there
    readings: np.ndarray  # (N,) what they read
    output_root: np.ndarray  # (N, N)
    cross: np.ndarray  # (7, N) of states and outputs; below them the innovation
    work: np.ndarray  # (max(N, 6),)


def new_memory(cells: int) -> UnscentedMemory:
    """Zeros."""
    return UnscentedMemory(
        np.zeros(STATES),
        np.zeros((STATES, STATES)),
        np.zeros(STATES),
        np.zeros((POINTS, STATES)),
        np.zeros((POINTS, cells)),
        np.zeros(cells),
        np.zeros((cells, cells)),
        np.zeros((STATES + 1, cells)),
        np.zeros(max(cells, STATES)),
    )


@kernel
def draw_points(p: PointParameters, memory: UnscentedMemory) -> None:
    """Points about the estimate."""
    x, root, points = memory.x, memory.root, memory.points
    for a in range(STATES):
        memory.mean[a] = points[0, a] = x[a]
        for i in range(STATES):
            offset = p.spread.gamma * root[a, i]
            points[1 + i, a] = x[a] + offset
            points[1 + STATES + i, a] = x[a] - offset


@kernel
def _mean(weight: float, values, k: int) -> float:
    """Of column k of one row a point."""
    middle = values[0, k]
    total = 0.0
    for i in range(1, POINTS):
        total += values[i, k] - middle
    return middle + weight * total


@kernel
def _add_deviations(spread: Spread, values, mean, size: int, root, work) -> bool:
    """Adds the covariance of the points' values (13, >= size) about `mean` to a root."""
    deviation = math.sqrt(spread.weight)
    for i in range(1, POINTS):
        for k in range(size):
            work[k] = deviation * (values[i, k] - mean[k])
        add_vector(root, size, work)
    deviation = math.sqrt(abs(spread.middle))
    for k in range(size):
        work[k] = deviation * (values[0, k] - mean[k])
    if spread.middle < 0.0:
        return take_vector(root, size, work)
    add_vector(root, size, work)
    return True


@kernel
def gather_points(p: PointParameters, noise, memory: UnscentedMemory) -> bool:
    """Estimate and root of the moved points, with process noise; False when they have no covariance.

    Args:
        noise: six variances.
    """
    for a in range(STATES):
        memory.mean[a] = _mean(p.spread.weight, memory.points, a)
        memory.x[a] = memory.points[0, a] if p.centre else memory.mean[a]
    set_diagonal(memory.root, noise)
    return _add_deviations(p.spread, memory.points, memory.mean, STATES, memory.root, memory.work)


@kernel
def update(p: PointParameters, memory: UnscentedMemory, count: int, variance: float) -> tuple[bool, float]:
    """Takes the first `count` columns of `outputs` and `readings`, with independent errors of one variance.

    Returns:
        whether there is a covariance left; NIS.
    """
    spread, outputs, cross, work = p.spread, memory.outputs, memory.cross, memory.work
    mean_output = cross[_INNOVATION]
    root = memory.output_root
    root[:, :] = 0.0
    for k in range(count):
        mean_output[k] = _mean(spread.weight, outputs, k)
        root[k, k] = math.sqrt(variance)
    sound = _add_deviations(spread, outputs, mean_output, count, root, work)
    for a in range(STATES):
        for k in range(count):
            total = spread.middle * (memory.points[0, a] - memory.mean[a]) * (outputs[0, k] - mean_output[k])
            for i in range(1, POINTS):
                total += spread.weight * (memory.points[i, a] - memory.mean[a]) * (outputs[i, k] - mean_output[k])
            cross[a, k] = total
        solve_lower(root, count, cross[a])
    innovation = cross[_INNOVATION]
    for k in range(count):
        innovation[k] = memory.readings[k] - innovation[k]
    solve_lower(root, count, innovation)
    nis = 0.0
    for k in range(count):
        nis += innovation[k] * innovation[k]
        for a in range(STATES):
            memory.x[a] += cross[a, k] * innovation[k]
            work[a] = cross[a, k]
        sound = take_vector(memory.root, STATES, work) and sound
    return sound, nis
