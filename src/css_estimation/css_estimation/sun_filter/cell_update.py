# SPDX-License-Identifier: Apache-2.0
"""What the outputs of the cells say about the state of the Sun filter, by the model of each (`cell_model`).

Where the converter ends noise ends, too: the reading is max(low, output + noise), of which mean, slope and spread are
taken (`read_above`). A reading that the model explains worse than `nis_gate` allows is refused. Updates are scalar, in
sequence, in symmetric form: of the covariance S >= R > 0 is taken what the reading took away.
"""

import math
from typing import NamedTuple

from css_common.attitude import rotation_vector_to_dcm
from css_common.kernel import kernel
from css_common.vectors import Vec3, matmul, norm, scale
from css_environment.albedo import albedo_output
from css_environment.albedo_slope import albedo_slopes
from css_estimation.sun_filter.calibration import correct_calibration, corrected_states
from css_estimation.sun_filter.cell_model import COUNTED, LEFT_OUT, along, cell_model, rising
from css_estimation.sun_filter.memory import (
    COMMON,
    EARTH,
    GAIN,
    RATE,
    SCALE,
    THETA,
    X_EARTH,
    X_GAIN,
    X_RATE,
    X_SCALE,
    SunFilterMemory,
    dcm_of,
    forget,
    quadratic,
    set_dcm,
)
from css_estimation.sun_filter.options import SunFilterParameters

READABLE = 1e3
"""Beyond it a number is no output of a cell."""

# Width of what is left out on both sides of an edge of view, in cosines: at least, by the heading's error, at most.
_MARGIN_LEAST, _MARGIN_BY_SIGMA, _MARGIN_MOST = 0.03, 2.0, 0.15
# Without a converged heading nothing is refused [rad].
_CONVERGED = 0.3
# Corrections longer than this [rad] are cut.
_LONGEST = 0.5
_LEAST_EARTH = -0.9


class CellReading(NamedTuple):
    """What the filter made of a cycle's outputs."""

    nis: float
    nis_dof: int
    used: int  # mask
    refused: int  # mask
    contrary: int  # cells that are lit or dark where the estimate has it the other way round
    likelihood: float  # logarithm, but for a constant
    sigma: float  # [rad] error of the heading before, mean of two axes
    against: float  # as `nis`, of the cells that were refused


NOTHING_READ = CellReading(0.0, 0, 0, 0, 0, 0.0, 9.0, 0.0)


@kernel
def bit_count(mask: int) -> int:
    """Bits that are set."""
    count = 0
    while mask:
        mask &= mask - 1
        count += 1
    return count


@kernel
def heading_sigma(covariance, sun_n: Vec3) -> float:
    """Error of the heading [rad], 1 sigma, mean of the two axes across it."""
    total = covariance[THETA, THETA] + covariance[THETA + 1, THETA + 1] + covariance[THETA + 2, THETA + 2]
    return math.sqrt(max(0.0, 0.5 * (total - quadratic(covariance, THETA, sun_n))))


@kernel
def read_cells(
    p: SunFilterParameters,
    voltages,
    sun_n: Vec3,
    flux: float,
    more_noise: float,
    earth_known: bool,
    learns: bool,
    light,
    states: int,
    x,
    covariance,
    m: SunFilterMemory,
) -> CellReading:
    """Updates an estimate with all cells.

    Args:
        flux: of the Sun [-], 1 at 1 AU.
        more_noise: variance of each cell [-] beside that of its noise; where the Earth is known, in units of its light.
        earth_known: `light` is that of the Earth; else it is unknown.
        learns: the states of calibration are corrected.
        states: how many of the states are in use.
        m: room.
    """
    dcm_bn = dcm_of(x)
    cells = voltages.shape[0]
    if earth_known:
        albedo_output(light, p.cells, p.screen, p.cos_half_view, dcm_bn, m.earth_work, m.earth)
        albedo_slopes(light, p.cells, p.screen, p.cos_half_view, dcm_bn, m.earth_slopes)
    sigma = heading_sigma(covariance, sun_n)
    margin = min(_MARGIN_LEAST + _MARGIN_BY_SIGMA * sigma, _MARGIN_MOST) + p.calibration.margin
    corrected = corrected_states(cells, states, learns)
    forget(covariance, COMMON, 1, p.errors.common)
    gained, correction = m.work[0], m.work[1]
    for j in range(states):
        correction[j] = 0.0
    nis, likelihood, against = 0.0, 0.0, 0.0
    dof, used, refused, contrary = 0, 0, 0, 0
    for i in range(cells):
        # a NaN compares false
        if not abs(voltages[i]) < READABLE:
            continue
        v = voltages[i] - p.cells[i].dark
        c = cell_model(p, i, v, sun_n, flux, margin, earth_known, x, covariance, m)
        if c.use == LEFT_OUT:
            continue
        if c.use == COUNTED:
            # no correction, but as good an explanation as that of a filter which has the cell lit
            squared = 1.0 if c.expected < 0.0 else (v - c.expected) * (v - c.expected) / p.errors.noise
            likelihood -= 0.5 * (min(squared, p.convergence.gate) + math.log(p.errors.noise))
            continue
        mean, share, noise = read_above(p, c.expected, p.cells[i].low - p.cells[i].dark)
        innovation = v - mean - share * along(c, earth_known, correction)
        for j in range(states):
            gained[j] = share * along(c, earth_known, covariance[j])
        more = more_noise * m.earth[i] * m.earth[i] if earth_known else more_noise
        variance = noise + more + share * share * c.spread + share * along(c, earth_known, gained)
        squared = innovation * innovation / variance
        likelihood -= 0.5 * (min(squared, p.convergence.gate) + math.log(variance))
        if squared > p.convergence.gate and sigma < _CONVERGED:
            refused |= 1 << i
            against += squared
            if abs(v - c.expected) > p.earth.largest * flux:
                contrary += 1
            continue
        nis += squared
        dof += 1
        used |= 1 << i
        absorb(gained, innovation, variance, corrected, states, correction, covariance)
    correct(p, x, correction, states)
    return CellReading(nis, dof, used, refused, contrary, likelihood, sigma, against)


@kernel
def read_above(p: SunFilterParameters, expected: float, low: float) -> tuple[float, float, float]:
    """What is read of an output whose noise ends at the least that its converter gives: mean, slope and variance [-].

    Without it the noise of a dark cell, half of which is lost, is a lasting light: 0.4 standard deviations in the mean.
    """
    mean, share, spread = rising(expected - low, p.errors.noise)
    if share == 1.0:
        return expected, 1.0, p.errors.noise
    return low + mean, share, share * share * p.errors.noise + spread


@kernel
def absorb(gained, innovation: float, variance: float, corrected: int, states: int, correction, covariance) -> None:
    """Takes one reading into correction and covariance.

    Args:
        gained: covariance of the states with the reading.
        variance: of the innovation.
        corrected: so many of the states in use are corrected; the others have no gain, they are considered (Schmidt).
    """
    for j in range(corrected):
        share = gained[j] / variance
        correction[j] += share * innovation
        for k in range(states):
            covariance[j, k] -= share * gained[k]
    for j in range(corrected, states):
        share = gained[j] / variance
        for k in range(corrected):
            covariance[j, k] -= share * gained[k]


@kernel
def correct(p: SunFilterParameters, x, correction, states: int) -> None:
    """Adds the corrections of the states in use to an estimate."""
    cells = p.cells.shape[0]
    theta = (correction[0], correction[1], correction[2])
    length = norm(theta)
    if length > _LONGEST:
        theta = scale(_LONGEST / length, theta)
    set_dcm(x, matmul(dcm_of(x), rotation_vector_to_dcm(theta)))
    for i in range(3):
        x[X_RATE + i] += correction[RATE + i]
    x[X_SCALE] += correction[SCALE]
    for i in range(cells):
        x[X_GAIN + i] += correction[GAIN + i]
    if states > GAIN + cells:
        x[X_EARTH] = max(_LEAST_EARTH, x[X_EARTH] + correction[EARTH])
        for i in range(cells):
            x[X_GAIN + cells + i] += correction[GAIN + cells + i]
        correct_calibration(p.calibration, cells, x, correction)
