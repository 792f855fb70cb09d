# SPDX-License-Identifier: Apache-2.0
"""The Sun that most cells agree on, over the whole sphere, whatever a few others say.

The cost of a direction is the sum of the cells' contradictions to it, each bounded: a cell that lies costs as much
everywhere, and the direction of the others wins (truncated least squares, as RANSAC counts outliers).
"""

import math

from css_common.kernel import kernel
from css_common.vectors import Mat3, Vec3, dot, multiply
from css_estimation.health.cell_expectation import SEEN, contradiction, expected
from css_estimation.health.cell_memory import DIRECTIONS, CellHealthMemory
from css_estimation.health.cell_options import CellHealthParameters
from css_estimation.sun.direction_grid import direction
from css_estimation.sun.sunline_filter import constrain, update_cell
from css_estimation.symmetric import Symmetric, isotropic

_HALF_WAY = 0.08  # [rad] from one direction to the next
_REFINEMENTS = 3
_DEAD = 0.05
_BRIGHT = 0.45  # of the light: a cell above it sees the Sun, whatever is predicted
_EARTH_ERROR = 0.1  # of an output, 1 sigma
_LARGEST_VARIANCE = 1.0  # [rad^2]


@kernel
def cost(p: CellHealthParameters, outputs, sun_b: Vec3, covariance: Symmetric, light: float) -> float:
    """Sum of contradictions to a direction; NaN outputs do not count."""
    total = 0.0
    for i in range(outputs.shape[0]):
        if not math.isnan(outputs[i]):
            total += abs(contradiction(p, expected(p, i, sun_b, covariance, light), outputs[i]))
    return total


@kernel
def refine(
    p: CellHealthParameters, outputs, sun_b: Vec3, covariance: Symmetric, light: float, gate: float
) -> tuple[Vec3, Symmetric]:
    """Direction and covariance after the cells that see the Sun and do not contradict it by more than `gate`."""
    prior_b, prior_covariance = sun_b, covariance
    for i in range(outputs.shape[0]):
        if math.isnan(outputs[i]):
            continue
        e = expected(p, i, prior_b, prior_covariance, light)
        if abs(contradiction(p, e, outputs[i])) > gate:
            continue
        if outputs[i] > _BRIGHT * light or (e.sight == SEEN and outputs[i] > _DEAD):
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
def best_direction(
    p: CellHealthParameters, outputs, light: float, sun_b: Vec3, variance: float, worth: float
) -> tuple[float, Vec3]:
    """Least cost of any direction and the direction, where leaving the one followed costs too.

    Args:
        sun_b, variance: direction that is followed, and its error per axis [rad^2].
        worth: most that leaving it costs.
    """
    covariance = isotropic(_HALF_WAY * _HALF_WAY)
    least, best = math.inf, sun_b
    for g in range(DIRECTIONS):
        d = direction(g, DIRECTIONS)
        angle = math.acos(min(1.0, max(-1.0, dot(d, sun_b))))
        away = max(0.0, angle - _HALF_WAY)
        total = cost(p, outputs, d, covariance, light) + min(away * away / variance, worth)
        if total < least:
            least, best = total, d
    # as sure as the one that is followed, so that what contradicts it counts as much
    best_covariance = covariance
    for _ in range(_REFINEMENTS):
        best, best_covariance = refine(p, outputs, best, covariance, light, 2.0 * p.gate)
    angle = math.acos(min(1.0, max(-1.0, dot(best, sun_b))))
    return cost(p, outputs, best, best_covariance, light) + min(angle * angle / variance, worth), best
