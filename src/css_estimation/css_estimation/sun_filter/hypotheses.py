# SPDX-License-Identifier: Apache-2.0
"""Attitudes that may be the right one: how they begin, which are given up, and the turn about the Sun line among them.

Cells alone say nothing about the turn about the Sun line; the light of the Earth does. Once the heading is known,
`HYPOTHESES` attitudes that differ by that turn are followed, each a filter of its own, and weighed by how well they
explain the outputs, until one is left.
"""

import math

from css_common.attitude import rotation_vector_to_dcm
from css_common.kernel import kernel
from css_common.vectors import Mat3, Vec3, axes_across, matmul, multiply_transposed, scale
from css_estimation.sun_filter.calibration import doubt_calibration
from css_estimation.sun_filter.memory import (
    DEAD,
    EARTH,
    GAIN,
    HYPOTHESES,
    SCALE,
    THETA,
    X_EARTH,
    X_GAIN,
    X_RATE,
    SunFilterMemory,
    dcm_of,
    forget,
    quadratic,
    set_dcm,
)
from css_estimation.sun_filter.motion import begin_rate
from css_estimation.sun_filter.options import SunFilterParameters

# Outputs of one cycle to the next are alike in what the model has wrong: so much of each is news.
_NEWS = 0.05
# Logarithm of the weight, relative to the best, at which a hypothesis is given up.
_GIVEN_UP = -12.0
# Two hypotheses this near [rad] are one.
_ALIKE_COS = 1.0 + 2.0 * math.cos(0.05)
# Mean square of the states of the clouds, 1 for clouds, beyond which they are none.
_NO_CLOUDS = 8.0
# The square of one alone: where the Sun is on a cell that the estimate has beyond its edge, clouds stand for sunlight.
_NO_CLOUD = 4.0**2
# Errors of a new hypothesis [rad2]: about the Sun line, and across it what the unknown Earth may have done.
_ROLL_VARIANCE = 0.2**2
_HEADING_VARIANCE = 0.1**2
_SEARCH_VARIANCE = 0.1**2
# Large errors about the Sun line are corrected step by step, each of which a linear filter takes for final: the
# variance is kept above one that falls within this time [s] ...
SETTLING = 60.0
# ... and both go on to grow, by what clouds do that last, and what a wrong turn made of the Earth's light [rad2/s].
_ROLL_NOISE, _HEADING_NOISE = 1e-5, 1e-7


@kernel
def onto_sun(sun_b: Vec3, sun_n: Vec3) -> Mat3:
    """An attitude that has the Sun where it is, with any turn about it."""
    b1, b2 = axes_across(sun_b)
    n1, n2 = axes_across(sun_n)
    rows = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for b, n in ((sun_b, sun_n), (b1, n1), (b2, n2)):
        rows = (
            _plus(rows[0], b[0], n),
            _plus(rows[1], b[1], n),
            _plus(rows[2], b[2], n),
        )
    return rows


@kernel
def _plus(row: Vec3, k: float, v: Vec3) -> Vec3:
    return row[0] + k * v[0], row[1] + k * v[1], row[2] + k * v[2]


@kernel
def begin(
    p: SunFilterParameters, m: SunFilterMemory, sun_b: Vec3, variance: float, sun_n: Vec3, model: int, wheels_b: Vec3
) -> None:
    """One hypothesis from a direction of the Sun in b, known to a variance [rad2]; its turn is a definition."""
    x, covariance = m.estimates[0], m.covariances[0]
    set_dcm(x, onto_sun(sun_b, sun_n))
    cells = p.cells.shape[0]
    # the states of calibration behind these outlast a search
    for i in range(X_RATE, X_GAIN + 2 * cells):
        x[i] = 0.0
    forget(covariance, 0, GAIN + 2 * cells, 0.0)
    _widen_across(covariance, sun_n, variance + _SEARCH_VARIANCE)
    begin_rate(p.motion, model, (0.0, 0.0, 0.0), p.motion.start_rate, wheels_b, x, covariance)
    covariance[SCALE, SCALE] = p.errors.scale
    forget(covariance, GAIN, cells, p.errors.cell)
    m.weights[0] = 0.0
    for other in range(1, HYPOTHESES):
        m.weights[other] = DEAD


@kernel
def _copy(m: SunFilterMemory, source: int, target: int) -> None:
    for i in range(m.estimates.shape[1]):
        m.estimates[target, i] = m.estimates[source, i]
    for i in range(m.covariances.shape[1]):
        for j in range(m.covariances.shape[2]):
            m.covariances[target, i, j] = m.covariances[source, i, j]


@kernel
def look_for_roll(p: SunFilterParameters, m: SunFilterMemory, sun_n: Vec3) -> None:
    """Makes all hypotheses of the first, turned about the Sun line, with the Earth as an unknown of each."""
    x, covariance = m.estimates[0], m.covariances[0]
    cells = p.cells.shape[0]
    x[X_EARTH] = 0.0
    for i in range(cells):
        x[X_GAIN + cells + i] = 0.0
    forget(covariance, EARTH, 1, p.earth.scale)
    forget(covariance, GAIN + cells, cells, 1.0)
    _widen_across(covariance, sun_n, _HEADING_VARIANCE)
    _widen(covariance, sun_n, _ROLL_VARIANCE)
    for k in range(1, HYPOTHESES):
        turn = rotation_vector_to_dcm(scale(2.0 * math.pi * k / HYPOTHESES, sun_n))
        _copy(m, 0, k)
        set_dcm(m.estimates[k], matmul(dcm_of(x), turn))
        # what is known is known in the body, so that errors in n turn along
        _turn(m.covariances[k], turn)
    for k in range(HYPOTHESES):
        m.weights[k] = 0.0


@kernel
def earth_is_elsewhere(p: SunFilterParameters, x) -> bool:
    """Whether clouds would have to be what no clouds are, for the Earth to be where an estimate has it.

    Their states are in units of their standard deviation. What they make up for is then a wrong turn about the Sun
    line.
    """
    cells = p.cells.shape[0]
    squares, largest = 0.0, 0.0
    for i in range(X_GAIN + cells, X_GAIN + 2 * cells):
        squares += x[i] * x[i]
        largest = max(largest, x[i] * x[i])
    return squares > _NO_CLOUDS * cells or largest > _NO_CLOUD


@kernel
def give_up_elsewhere(p: SunFilterParameters, m: SunFilterMemory) -> bool:
    """Gives up hypotheses whose clouds are none, but not the last ones; whether those of all are none.

    Weights do not tell: clouds that have been taken in explain the outputs, however bright they are.
    """
    followed, elsewhere = 0, 0
    for k in range(HYPOTHESES):
        if m.weights[k] > DEAD:
            followed += 1
            elsewhere += 1 if earth_is_elsewhere(p, m.estimates[k]) else 0
    if elsewhere == 0 or elsewhere == followed:
        return elsewhere > 0
    for k in range(HYPOTHESES):
        if m.weights[k] > DEAD and earth_is_elsewhere(p, m.estimates[k]):
            m.weights[k] = DEAD
    return False


@kernel
def look_again(p: SunFilterParameters, m: SunFilterMemory, best: int, sun_n: Vec3) -> None:
    """Looks for the turn anew, from the attitude of a hypothesis; what it has learnt of the cells is in doubt."""
    if best != 0:
        _copy(m, best, 0)
    doubt_calibration(p.calibration, p.cells.shape[0], m.covariances[0])
    look_for_roll(p, m, sun_n)


@kernel
def _turn(covariance, turn: Mat3) -> None:
    for j in range(covariance.shape[0]):
        a = multiply_transposed(turn, (covariance[THETA, j], covariance[THETA + 1, j], covariance[THETA + 2, j]))
        covariance[THETA, j], covariance[THETA + 1, j], covariance[THETA + 2, j] = a
    for j in range(covariance.shape[0]):
        a = multiply_transposed(turn, (covariance[j, THETA], covariance[j, THETA + 1], covariance[j, THETA + 2]))
        covariance[j, THETA], covariance[j, THETA + 1], covariance[j, THETA + 2] = a


@kernel
def _widen(covariance, axis_n: Vec3, variance: float) -> None:
    for i in range(3):
        for j in range(3):
            covariance[THETA + i, THETA + j] += variance * axis_n[i] * axis_n[j]


@kernel
def _widen_across(covariance, axis_n: Vec3, variance: float) -> None:
    for i in range(3):
        for j in range(3):
            covariance[THETA + i, THETA + j] += variance * ((1.0 if i == j else 0.0) - axis_n[i] * axis_n[j])


@kernel
def loosen(covariance, sun_n: Vec3, since: float, dt: float) -> None:
    """Keeps the variance about the Sun line above what is credible `since` [s] the hypotheses began; clouds' noise."""
    left = math.exp(-2.0 * since / SETTLING)
    about = quadratic(covariance, THETA, sun_n)
    _widen(covariance, sun_n, max(_ROLL_NOISE * dt, _ROLL_VARIANCE * left - about))
    _widen_across(covariance, sun_n, _HEADING_NOISE * dt)


@kernel
def weigh(m: SunFilterMemory, k: int, likelihood: float) -> None:
    """Adds the likelihood of a cycle's outputs to the weight of a hypothesis; one that is no number is given up."""
    weight = m.weights[k] + _NEWS * likelihood
    m.weights[k] = weight if math.isfinite(weight) else DEAD


@kernel
def give_up(m: SunFilterMemory) -> tuple[int, int]:
    """Gives up what is unlikely, or the same as the best; gives the best one and how many are left, perhaps none."""
    best = 0
    for k in range(HYPOTHESES):
        if m.weights[k] > m.weights[best]:
            best = k
    left = 0
    highest = m.weights[best]
    for k in range(HYPOTHESES):
        if m.weights[k] > DEAD and k != best:
            alike = 0.0
            for i in range(9):
                alike += m.estimates[k, i] * m.estimates[best, i]
            if m.weights[k] < highest + _GIVEN_UP or alike > _ALIKE_COS:
                m.weights[k] = DEAD
        if m.weights[k] > DEAD:
            left += 1
            m.weights[k] -= highest
    return best, left


@kernel
def the_only_one(m: SunFilterMemory) -> int:
    """The hypothesis that is followed; -1 when there are several, or none."""
    only, count = -1, 0
    for k in range(HYPOTHESES):
        if m.weights[k] > DEAD:
            only = k
            count += 1
    return only if count == 1 else -1
