# SPDX-License-Identifier: Apache-2.0
"""Where is the Sun? Weights of directions over the whole sphere, for a filter that has no estimate to begin with.

They are weighed by what the cells read: one lit cell leaves a ring, several a spot. With a gyro weights gather while
the body turns, in a frame that turns with it; without, they forget within a second. Mean and spread of them are an
estimate too, the only one while the spread is large; once it is small the filter begins from it.

With a gyro what the outputs say is counted once for an attitude, and again after a turn: the light of the Earth and
how far it is to the next direction last, and of two Suns that explain the outputs alike the one that a direction
happens to lie nearer to would win otherwise, were it only looked at for long.
"""

import math

from css_common.kernel import kernel
from css_common.vectors import Mat3, Vec3, multiply
from css_estimation.sun.direction_grid import direction, mean_direction
from css_estimation.sun_filter.cell_model import light_of, view_of
from css_estimation.sun_filter.cell_update import READABLE
from css_estimation.sun_filter.memory import DIRECTIONS
from css_estimation.sun_filter.options import SunFilterParameters

MEMORY = 1.0
"""Time [s] over which outputs are averaged: one look."""
_MARGIN = 0.07  # in cosines, half of the way from one direction to the next
_TURN = 2.0 * _MARGIN  # [rad] after which a look is another one
_SIGMA = 0.1  # error of an output that model and Earth leave
_MOST = 12.0  # cost of a single cell, so that a broken one does not decide


@kernel
def cost(p: SunFilterParameters, voltages, flux: float, sun_b: Vec3) -> float:
    """How badly the Sun in a direction explains the outputs: half of the sum of their normalised squares."""
    total = 0.0
    mean_albedo = 0.5 * p.earth.unknown
    for i in range(voltages.shape[0]):
        if not abs(voltages[i]) < READABLE:
            continue
        cosine, seen, doubtful = view_of(p, i, sun_b, _MARGIN)
        light = light_of(p, i, voltages[i])
        dark = (light - mean_albedo) / _SIGMA
        lit = (light - mean_albedo - flux * max(cosine, 0.0)) / _SIGMA
        worst = lit * lit if seen else dark * dark
        if doubtful:
            worst = min(lit * lit, dark * dark)
        total += min(0.5 * worst, _MOST)
    return total


@kernel
def look_of(dt: float, since: float, rate: float) -> float:
    """Part of a look that a cycle is where the frame turns with the body: the first second, and then what it turns.

    Args:
        dt: of the cycle [s].
        since: the search began [s].
        rate: of the body [rad/s].
    """
    return dt / MEMORY if since <= MEMORY else min(dt / MEMORY, rate * dt / _TURN)


@kernel
def search(
    p: SunFilterParameters, grid, dcm_bn: Mat3, voltages, flux: float, kept: float, share: float
) -> tuple[Vec3, float]:
    """Adds a cycle's outputs to the weights; gives the mean direction in n, and the variance on the worst axis.

    Args:
        grid: (DIRECTIONS,) logarithms, advanced.
        dcm_bn: frame in which directions are fixed.
        kept: share of the weights that is not forgotten.
        share: of a look that this cycle is.
    """
    for g in range(DIRECTIONS):
        sun_b = multiply(dcm_bn, direction(g, DIRECTIONS))
        grid[g] = kept * grid[g] - share * cost(p, voltages, flux, sun_b)
    return mean_direction(grid)


@kernel
def least_cost(p: SunFilterParameters, voltages, flux: float) -> float:
    """Cost of the direction that explains the outputs best."""
    least = math.inf
    for g in range(DIRECTIONS):
        least = min(least, cost(p, voltages, flux, direction(g, DIRECTIONS)))
    return least
