# SPDX-License-Identifier: Apache-2.0
"""What the outputs of the cells say about the state of the Sun filter.

The model of cell i with the normal n_i,

    V_i = dark_i + gain_i (1 + g_i) scale (1 + SCALE + COMMON) R(light_i),
    light_i = flux max(0, n_i.s) seen_i + a_i (1 + EARTH) + c a_i u_i,

R being the response, a_i the light of the mean Earth at the estimated attitude, u_i what clouds add to it in units of
c a_i, gain_i and n_i those of `calibration` where cells are calibrated in flight. Where the Earth is not predicted a_i
is half of its largest, and its error is white noise.

Which cells see the Sun follows from the estimate. Its error decides for which of them that is sure: of the others, next
to the edge of a view, those enter that are too bright for an Earth. A reading that the model explains worse than
`nis_gate` allows is refused.

Updates are scalar, in sequence, in symmetric form: of the covariance S >= R > 0 is taken what the reading took away.
"""

import math
from typing import NamedTuple

from css_common.attitude import rotation_vector_to_dcm
from css_common.kernel import kernel
from css_common.vectors import Vec3, add, cross, dot, matmul, multiply, multiply_transposed, norm, scale
from css_environment.albedo import albedo_output
from css_environment.albedo_slope import albedo_slopes
from css_estimation.sun_filter.calibration import (
    PER_CELL,
    calibrated,
    correct_calibration,
    corrected_states,
    first_state,
)
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
    triple,
)
from css_estimation.sun_filter.options import SunFilterParameters
from css_estimation.sun_filter.response import respond

READABLE = 1e3
"""Beyond it a number is no output of a cell."""

# Width of what is left out on both sides of an edge of view, in cosines: at least, by the heading's error, at most.
_MARGIN_LEAST, _MARGIN_BY_SIGMA, _MARGIN_MOST = 0.03, 2.0, 0.15
# A step in the output smaller than this is none.
_SMALLEST_STEP = 0.05
# Below so many standard deviations of noise a cell that does not see the Sun is dark and says nothing. What is expected
# decides that: the reading would keep the high ones of a dim cell alone. One so much higher cannot be noise.
_DARK, _SURELY_LIT = 3.0, 4.0
# Without a converged heading nothing is refused [rad].
_CONVERGED = 0.3
# Corrections longer than this [rad] are cut.
_LONGEST = 0.5
_LEAST_EARTH = -0.9
_SURE = 4.0
_HARDLY = 1e-3
_EDGE = 4.0


class CellReading(NamedTuple):
    """What the filter made of a cycle's outputs."""

    nis: float
    nis_dof: int
    used: int  # mask
    refused: int  # mask
    contrary: int  # cells that are lit or dark where the estimate has it the other way round
    likelihood: float  # logarithm, but for a constant
    sigma: float  # [rad] error of the heading before, mean of two axes


NOTHING_READ = CellReading(0.0, 0, 0, 0, 0, 0.0, 9.0)


@kernel
def heading_sigma(covariance, sun_n: Vec3) -> float:
    """Error of the heading [rad], 1 sigma, mean of the two axes across it."""
    total = covariance[THETA, THETA] + covariance[THETA + 1, THETA + 1] + covariance[THETA + 2, THETA + 2]
    return math.sqrt(max(0.0, 0.5 * (total - quadratic(covariance, THETA, sun_n))))


@kernel
def view_of(p: SunFilterParameters, i: int, sun_b: Vec3, margin: float) -> tuple[float, bool, bool]:
    """Cosine of the Sun on cell i, whether it sees the Sun, and whether that is in doubt within a margin of cosines."""
    cell = p.cells[i]
    cosine = cell.nx * sun_b[0] + cell.ny * sun_b[1] + cell.nz * sun_b[2]
    seen = cosine >= p.cos_half_view
    doubtful = p.cos_half_view > _SMALLEST_STEP and abs(cosine - p.cos_half_view) < margin
    if cell.side != 0.0:
        above = dot(p.screen.axis_b, sun_b) * (1.0 if cell.side > 0.0 else -1.0)
        seen = seen and above > 0.0
        if cosine > _SMALLEST_STEP and abs(above) < margin:
            doubtful = cosine > p.cos_half_view - margin
        elif above < 0.0:
            doubtful = False
    return cosine, seen, doubtful


@kernel
def rising(cosine: float, variance: float) -> tuple[float, float, float]:
    """Mean of max(0, c) for a normal c, its slope over the mean of c, and the variance that the slope does not explain.

    A linear model of a cell that may or may not see the Sun: statistical linearisation (Gelb 1974, section 6.2).
    """
    sigma = math.sqrt(variance)
    z = cosine / sigma
    if z > _SURE:
        return cosine, 1.0, 0.0
    if z < -_SURE:
        return 0.0, 0.0, 0.0
    share = 0.5 * (1.0 + math.erf(z * math.sqrt(0.5)))
    density = math.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi)
    mean = cosine * share + sigma * density
    square = (cosine * cosine + variance) * share + cosine * sigma * density
    return mean, share, max(0.0, square - mean * mean - share * share * variance)


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
        more_noise: variance of each cell [-] beside that of its noise.
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
    sun_b = multiply(dcm_bn, sun_n)
    sigma = heading_sigma(covariance, sun_n)
    margin = min(_MARGIN_LEAST + _MARGIN_BY_SIGMA * sigma, _MARGIN_MOST) + p.calibration.margin
    calibrates = p.calibration.per_cell > 0
    corrected = corrected_states(cells, states, learns)
    forget(covariance, COMMON, 1, p.errors.common)
    gained, correction = m.work[0], m.work[1]
    for j in range(states):
        correction[j] = 0.0
    scale_now = p.response.scale * (1.0 + x[X_SCALE])
    earth_factor = 1.0 + x[X_EARTH] if earth_known else 0.0
    dark = _DARK * math.sqrt(p.errors.noise)
    nis, likelihood = 0.0, 0.0
    dof, used, refused, contrary = 0, 0, 0, 0
    for i in range(cells):
        v = voltages[i]
        # a NaN compares false
        if not abs(v) < READABLE:
            continue
        cell = p.cells[i]
        v -= cell.dark
        cosine, seen, doubtful = view_of(p, i, sun_b, margin)
        gain, normal_b, by_tilt1, by_tilt2 = cell.gain, (cell.nx, cell.ny, cell.nz), 0.0, 0.0
        if calibrates:
            relative, normal_b, by_tilt1, by_tilt2 = calibrated(cells, i, x, normal_b, sun_b)
            gain, cosine = gain * relative, dot(normal_b, sun_b)
        mean_light = m.earth[i] if earth_known else 0.0
        albedo = earth_factor * mean_light if earth_known else 0.5 * p.earth.unknown
        if doubtful:
            # the reading tells on which side of the edge the Sun is, where no Earth could
            sunlight = flux * max(cosine, p.cos_half_view)
            seen = sunlight > p.earth.largest and v > gain * scale_now * (albedo + 0.5 * sunlight)
            if not seen:
                likelihood -= 0.5 * (1.0 + math.log(p.errors.noise))
                continue
        cloud = p.earth.clouds * mean_light
        cloud_state, own = GAIN + cells + i, first_state(cells) + PER_CELL * i
        received = albedo + (cloud * x[X_GAIN + cells + i] if earth_known else 0.0)
        # normals in n turn with the error, d(n) = theta x n
        across = cross(multiply_transposed(dcm_bn, normal_b), sun_n)
        share, spread = (1.0 if seen else 0.0), 0.0
        sunlit = max(cosine, 0.0)
        if p.cos_half_view < _SMALLEST_STEP and cell.side == 0.0:
            sunlit, share, spread = rising(cosine, _EDGE * quadratic(covariance, THETA, across) + 1e-9)
            seen = share > _HARDLY
        if seen:
            received += flux * sunlit
        output, slope = respond(p.response, received)
        factor = gain * (1.0 + x[X_GAIN + i])
        expected = factor * scale_now * output
        if not seen and expected < dark and v < _SURELY_LIT * dark:
            # no correction, but as good an explanation as that of a filter which has the cell lit
            squared = (v - expected) * (v - expected) / p.errors.noise
            likelihood -= 0.5 * (min(squared, p.convergence.gate) + math.log(p.errors.noise))
            continue
        if not earth_known and not seen and v < p.earth.largest * flux:
            continue
        slope *= factor * scale_now
        # slopes are those of a turn theta seen in b
        by_theta = scale(slope * flux * share, across) if seen else (0.0, 0.0, 0.0)
        if earth_known:
            by_earth_n = multiply_transposed(dcm_bn, triple(m.earth_slopes[i], 0))
            by_theta = add(by_theta, scale(slope * earth_factor, by_earth_n))
        by_scale = factor * p.response.scale * output
        by_earth = slope * mean_light
        by_gain = gain * scale_now * output
        by_cloud = slope * cloud
        by_relative = 0.0
        if calibrates:
            # the Sun alone calibrates: nobody knows so well how bright the Earth is on a cell
            sunlight = flux * slope * share if seen else 0.0
            by_tilt1, by_tilt2 = sunlight * by_tilt1, sunlight * by_tilt2
            by_relative = cell.gain * (1.0 + x[X_GAIN + i]) * scale_now * output if seen else 0.0
            by_scale = by_scale if seen else 0.0
        innovation = v - expected
        innovation -= by_theta[0] * correction[0] + by_theta[1] * correction[1] + by_theta[2] * correction[2]
        innovation -= by_scale * correction[SCALE] + expected * correction[COMMON] + by_gain * correction[GAIN + i]
        if earth_known:
            innovation -= by_earth * correction[EARTH] + by_cloud * correction[cloud_state]
        if calibrates:
            innovation -= by_relative * correction[own] + by_tilt1 * correction[own + 1]
            innovation -= by_tilt2 * correction[own + 2]
        noise = p.errors.noise + more_noise + slope * slope * flux * flux * spread
        for j in range(states):
            total = by_theta[0] * covariance[j, 0] + by_theta[1] * covariance[j, 1] + by_theta[2] * covariance[j, 2]
            total += by_scale * covariance[j, SCALE] + expected * covariance[j, COMMON]
            total += by_gain * covariance[j, GAIN + i]
            if earth_known:
                total += by_earth * covariance[j, EARTH] + by_cloud * covariance[j, cloud_state]
            if calibrates:
                total += by_relative * covariance[j, own] + by_tilt1 * covariance[j, own + 1]
                total += by_tilt2 * covariance[j, own + 2]
            gained[j] = total
        variance = noise + by_theta[0] * gained[0] + by_theta[1] * gained[1] + by_theta[2] * gained[2]
        variance += by_scale * gained[SCALE] + expected * gained[COMMON] + by_gain * gained[GAIN + i]
        if earth_known:
            variance += by_earth * gained[EARTH] + by_cloud * gained[cloud_state]
        if calibrates:
            variance += by_relative * gained[own] + by_tilt1 * gained[own + 1] + by_tilt2 * gained[own + 2]
        squared = innovation * innovation / variance
        likelihood -= 0.5 * (min(squared, p.convergence.gate) + math.log(variance))
        if squared > p.convergence.gate and sigma < _CONVERGED:
            refused |= 1 << i
            if abs(v - expected) > p.earth.largest * flux:
                contrary += 1
            continue
        nis += squared
        dof += 1
        used |= 1 << i
        absorb(gained, innovation, variance, corrected, states, correction, covariance)
    correct(p, x, correction, states)
    return CellReading(nis, dof, used, refused, contrary, likelihood, sigma)


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
