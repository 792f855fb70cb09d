# SPDX-License-Identifier: Apache-2.0
"""The Sun that most cells agree on, over the whole sphere, whatever a few others say.

The cost of a direction is the sum of the cells' contradictions to it, each bounded: a cell that lies costs as much
everywhere, and the direction of the others wins (truncated least squares, as RANSAC counts outliers).
"""

import math

from css_common.kernel import kernel
from css_common.vectors import Mat3, Vec3, dot, multiply
from css_estimation.health.cell_expectation import contradiction, expected
from css_estimation.health.cell_memory import DIRECTIONS, CellHealthMemory
from css_estimation.health.cell_options import CellHealthParameters
from css_estimation.sun.direction_grid import direction
from css_estimation.symmetric import Symmetric, isotropic

_HALF_WAY = 0.08  # [rad] from one direction to the next


@kernel
def cost(p: CellHealthParameters, outputs, sun_b: Vec3, covariance: Symmetric, light: float) -> float:
    """Sum of contradictions to a direction; NaN outputs do not count."""
    total = 0.0
    for i in range(outputs.shape[0]):
        if not math.isnan(outputs[i]):
            total += abs(contradiction(p, expected(p, i, sun_b, covariance, light), outputs[i]))
    return total


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
    return least, best
