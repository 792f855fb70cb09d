# SPDX-License-Identifier: Apache-2.0
"""Where is the Sun, and which cells lie? Both at once, over the whole sphere, while neither is sure.

Hypotheses are that all cells are healthy, that one of them fails, or two. Under each the directions are weighed by what
the cells that are healthy then read, look after look, in a frame that turns with the body; a cell that is said to fail
costs as much as one that is off by a bound. The best direction of each hypothesis gives its likelihood, and the
difference between the best with a cell failing and the best with it healthy is the evidence against the cell
(generalised likelihood ratio).
"""

import math

from css_common.kernel import kernel
from css_common.vectors import Mat3, Vec3, dot, multiply
from css_estimation.health.cell_expectation import HIDDEN, SEEN, SURE, contradiction, expected, misfit
from css_estimation.health.cell_memory import DIRECTIONS, MOST_IN_PAIRS, CellHealthMemory
from css_estimation.health.cell_options import CellHealthParameters
from css_estimation.sun.direction_grid import direction
from css_estimation.sun.sunline_filter import constrain, update_cell
from css_estimation.symmetric import Symmetric, isotropic

_HALF_WAY = 0.08  # [rad] from one direction to the next
# Squared sigmas that a cell costs at every look which is said to fail, as its reading then tells nothing. One that has
# been left out while the direction was sure costs less.
_FAILED, _SURELY_FAILED = 6.0, 2.0
_DEAD = 0.05
_BRIGHT = 0.45  # of the light: a cell above it sees the Sun if it may
_EARTH_ERROR = 0.1  # of an output, 1 sigma
_LARGEST_VARIANCE = 1.0  # [rad^2]
_NEAR, _FAR = 0.94, 0.87  # cosines of 20 and 30 deg


@kernel
def cost(p: CellHealthParameters, outputs, sun_b: Vec3, covariance: Symmetric, light: float) -> float:
    """Sum of misfits to a direction; NaN outputs do not count."""
    total = 0.0
    for i in range(outputs.shape[0]):
        if not math.isnan(outputs[i]):
            total += misfit(p, expected(p, i, sun_b, covariance, light, SURE), outputs[i])
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
        e = expected(p, i, prior_b, prior_covariance, light, SURE)
        if abs(contradiction(p, e, outputs[i], 1.0)) > gate:
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
def begin_search(memory: CellHealthMemory, sun_b: Vec3, variance: float, worth: float) -> None:
    """All hypotheses alike, and directions by how far they are from the one that was followed.

    Args:
        variance: of that, per axis [rad^2].
        worth: most that a direction costs for being another [squared sigmas].
    """
    for g in range(DIRECTIONS):
        angle = math.acos(max(-1.0, min(1.0, dot(direction(g, DIRECTIONS), sun_b))))
        away = max(0.0, angle - _HALF_WAY)
        start = -0.5 * min(away * away / variance, worth)
        for h in range(memory.grid.shape[0]):
            memory.grid[h, g] = start


@kernel
def _odds(memory: CellHealthMemory, i: int) -> float:
    """What it costs to say that a cell fails."""
    sure = memory.verdicts[i].held == 1 and memory.cells[i].sure == 1
    return -0.5 * (_SURELY_FAILED if sure else _FAILED)


@kernel
def weigh(p: CellHealthParameters, memory: CellHealthMemory, outputs, frame: Mat3, light: float, kept: float) -> None:
    """Adds a look to the weights of all hypotheses and directions, of which a share of the old is `kept`."""
    count = outputs.shape[0]
    covariance = isotropic(_HALF_WAY * _HALF_WAY)
    grid, off = memory.grid, memory.misfits
    for g in range(DIRECTIONS):
        sun_b = multiply(frame, direction(g, DIRECTIONS))
        total = 0.0
        for i in range(count):
            off[i] = 0.0
            if not math.isnan(outputs[i]):
                off[i] = misfit(p, expected(p, i, sun_b, covariance, light, 1.0), outputs[i])
            total += off[i]
        grid[0, g] = kept * grid[0, g] - 0.5 * total
        h = 1
        for i in range(count):
            grid[h, g] = kept * grid[h, g] - 0.5 * (total - off[i]) + _odds(memory, i)
            h += 1
        if count <= MOST_IN_PAIRS:
            for i in range(count):
                for j in range(i):
                    both = _odds(memory, i) + _odds(memory, j)
                    grid[h, g] = kept * grid[h, g] - 0.5 * (total - off[i] - off[j]) + both
                    h += 1


@kernel
def judge_hypotheses(memory: CellHealthMemory) -> tuple[float, int]:
    """Likelihood and direction of the best hypothesis; writes the evidence against each cell to `memory.against`."""
    count = memory.against.shape[0]
    best, best_g = -math.inf, 0
    for i in range(count):
        memory.against[i] = memory.healthy[i] = -math.inf
    h = 0
    for i in range(-1, count):
        top, g = _largest(memory.grid, h)
        if top > best:
            best, best_g = top, g
        _credit(memory, top, i, -1)
        h += 1
    if count <= MOST_IN_PAIRS:
        for i in range(count):
            for j in range(i):
                top, g = _largest(memory.grid, h)
                if top > best:
                    best, best_g = top, g
                _credit(memory, top, i, j)
                h += 1
    for i in range(count):
        memory.against[i] -= memory.healthy[i]
    return best, best_g


@kernel
def gain_without(memory: CellHealthMemory, i: int) -> float:
    """By how much fewer squared sigmas all outputs are off the best direction if cell `i` fails, and no other does."""
    healthy, _ = _largest(memory.grid, 0)
    failed, _ = _largest(memory.grid, 1 + i)
    return 2.0 * (failed - _odds(memory, i) - healthy)


@kernel
def _largest(grid, h: int) -> tuple[float, int]:
    best, at = -math.inf, 0
    for g in range(DIRECTIONS):
        if grid[h, g] > best:
            best, at = grid[h, g], g
    return best, at


@kernel
def _credit(memory: CellHealthMemory, likelihood: float, i: int, j: int) -> None:
    """Notes a hypothesis, in which cells `i` and `j` fail, for all cells."""
    for k in range(memory.against.shape[0]):
        if k in (i, j):
            memory.against[k] = max(memory.against[k], likelihood)
        else:
            memory.healthy[k] = max(memory.healthy[k], likelihood)


@kernel
def likelihood_far(memory: CellHealthMemory, frame: Mat3, sun_b: Vec3) -> float:
    """Of the best hypothesis with the Sun far from a direction."""
    best = -math.inf
    for g in range(DIRECTIONS):
        if dot(multiply(frame, direction(g, DIRECTIONS)), sun_b) < _FAR:
            for h in range(memory.grid.shape[0]):
                best = max(best, memory.grid[h, g])
    return best


@kernel
def likelihood_near(memory: CellHealthMemory, frame: Mat3, sun_b: Vec3) -> float:
    """Of the best hypothesis with the Sun near a direction."""
    best = -math.inf
    for g in range(DIRECTIONS):
        if dot(multiply(frame, direction(g, DIRECTIONS)), sun_b) > _NEAR:
            for h in range(memory.grid.shape[0]):
                best = max(best, memory.grid[h, g])
    return best
