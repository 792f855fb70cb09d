# SPDX-License-Identifier: Apache-2.0
"""The Sun that most cells agree on, over the whole sphere, whatever a few others say.

The cost of a direction is the sum of the cells' misfits to it, each bounded: a cell that lies costs as much
everywhere, and the direction of the others wins (truncated least squares, as RANSAC counts outliers).
"""

import math

from css_common.kernel import kernel
from css_common.vectors import Mat3, Vec3, dot, multiply
from css_estimation.health.cell_expectation import HIDDEN, SEEN, contradiction, expected, misfit
from css_estimation.health.cell_memory import DIRECTIONS, CellHealthMemory
from css_estimation.health.cell_options import CellHealthParameters
from css_estimation.sun.direction_grid import direction
from css_estimation.sun.sunline_filter import constrain, update_cell
from css_estimation.symmetric import Symmetric, isotropic

_HALF_WAY = 0.08  # [rad] from one direction to the next
_REFINEMENTS = 3
_FAR = 0.94  # cosine of 20 deg
_DEAD = 0.05
_BRIGHT = 0.45  # of the light: a cell above it sees the Sun if it may
_EARTH_ERROR = 0.1  # of an output, 1 sigma
_LARGEST_VARIANCE = 1.0  # [rad^2]


@kernel
def cost(p: CellHealthParameters, outputs, sun_b: Vec3, covariance: Symmetric, light: float) -> float:
    """Sum of misfits to a direction; NaN outputs do not count."""
    total = 0.0
    for i in range(outputs.shape[0]):
        if not math.isnan(outputs[i]):
            total += misfit(p, expected(p, i, sun_b, covariance, light), outputs[i])
    return total


@kernel
def refine(
    p: CellHealthParameters, outputs, sun_b: Vec3, covariance: Symmetric, light: float, gate: float, open_minded: bool
) -> tuple[Vec3, Symmetric]:
    """Direction and covariance after the cells that see the Sun and do not contradict it by more than `gate`.

    Args:
        open_minded: it may be far from the Sun.
    """
    prior_b, prior_covariance = sun_b, covariance
    for i in range(outputs.shape[0]):
        if math.isnan(outputs[i]):
            continue
        e = expected(p, i, prior_b, prior_covariance, light)
        if abs(contradiction(p, e, outputs[i])) > gate:
            continue
        # while the direction is no more than a guess, a bright cell sees the Sun whatever it says
        may_see = e.sight != HIDDEN or open_minded
        if may_see and outputs[i] > (_DEAD if e.sight == SEEN else _BRIGHT * light):
            cell = p.layout.cells[i]
            variance = p.floor + p.share * outputs[i] * outputs[i] + _EARTH_ERROR * _EARTH_ERROR
            normal_b = (cell.nx, cell.ny, cell.nz)
            sun_b, covariance, _ = update_cell(sun_b, covariance, normal_b, outputs[i] / light, variance)
    return constrain(sun_b, prior_b, covariance, _LARGEST_VARIANCE)


@kernel
def gather(p: CellHealthParameters, memory: CellHealthMemory, outputs, frame: Mat3, light: float, kept: float) -> None:
    """Adds a look to the weights of all directions, of which a share of the old is `kept`."""
    covariance = isotropic(_HALF_WAY * _HALF_WAY)
    for g in range(DIRECTIONS):
        sun_b = multiply(frame, direction(g, DIRECTIONS))
        memory.grid[g] = kept * memory.grid[g] - 0.5 * cost(p, outputs, sun_b, covariance, light)


@kernel
def best_rival(
    p: CellHealthParameters, outputs, light: float, sun_b: Vec3, variance: float, worth: float
) -> tuple[float, Vec3]:
    """Least cost of any direction far from the one followed, which costs for that, and the direction.

    Infinite if the cells lead back from it to the one that is followed.

    Args:
        sun_b, variance: direction that is followed, and its error per axis [rad^2].
        worth: most that leaving it costs.
    """
    covariance = isotropic(_HALF_WAY * _HALF_WAY)
    least, best = math.inf, sun_b
    for g in range(DIRECTIONS):
        d = direction(g, DIRECTIONS)
        if dot(d, sun_b) < _FAR:
            total = cost(p, outputs, d, covariance, light)
            if total < least:
                least, best = total, d
    # as sure as the one that is followed, so that what contradicts it counts as much
    for _ in range(_REFINEMENTS):
        best, covariance = refine(p, outputs, best, covariance, light, 2.0 * p.gate, True)
    along = dot(best, sun_b)
    if along > _FAR:
        return math.inf, best
    angle = math.acos(max(-1.0, along))
    return cost(p, outputs, best, covariance, light) + min(angle * angle / variance, worth), best
