# SPDX-License-Identifier: Apache-2.0
"""What the state of the Sun filter expects of one cell, and how that changes with the state.

The model of cell i with the normal n_i,

    V_i = dark_i + gain_i (1 + g_i) scale (1 + SCALE + COMMON) R(light_i),
    light_i = flux max(0, n_i.s) seen_i + a_i (1 + EARTH) + c a_i u_i,

R being the response, a_i the light of the mean Earth at the estimated attitude, u_i what clouds add to it in units of
c a_i, gain_i and n_i those of `calibration` where cells are calibrated in flight. Where the Earth is not predicted a_i
is half of its largest, and its error is white noise.

Which cells see the Sun follows from the estimate. Its error decides for which of them that is sure: of the others, next
to the edge of a view, those enter that are too bright for an Earth. A wide view has no edge but a kink, which enters
as `rising` has it.
"""

import math
from typing import NamedTuple

from css_common.kernel import kernel
from css_common.normal_distribution import normal_share
from css_common.vectors import Vec3, add, cross, dot, multiply, multiply_transposed, scale
from css_environment.albedo import is_blocked, view_cosine
from css_estimation.sun_filter.calibration import PER_CELL, calibrated, first_state
from css_estimation.sun_filter.memory import (
    COMMON,
    EARTH,
    GAIN,
    SCALE,
    THETA,
    X_EARTH,
    X_GAIN,
    X_SCALE,
    SunFilterMemory,
    dcm_of,
    quadratic,
    triple,
)
from css_estimation.sun_filter.options import SunFilterParameters
from css_estimation.sun_filter.response import respond

LEFT_OUT, COUNTED, USED = 0, 1, 2
"""What becomes of a reading: nothing, it counts for how well the estimate explains it, it corrects the estimate."""

# A step in the output smaller than this is none.
_SMALLEST_STEP = 0.05
# A cell that gives less of the light tells nothing of it.
_LEAST_GAIN = 0.2
# Below so many standard deviations of noise a cell that does not see the Sun is dark and says nothing. What is expected
# decides that: the reading would keep the high ones of a dim cell alone. One so much higher cannot be noise.
_DARK, _SURELY_LIT = 3.0, 4.0
# Around the kink: so many standard deviations from it a cell is on one side; a share of the Sun below which it is dark;
# factor on the variance of the heading, whose error a linear filter takes for too small where it matters here.
_SURE, _HARDLY, _EDGE = 4.0, 1e-3, 4.0
# Keeps a variance above zero.
_ROUNDING = 1e-9


class CellModel(NamedTuple):
    """One cell in this cycle: the output and its derivatives by the states."""

    use: int  # LEFT_OUT, COUNTED or USED
    expected: float  # output less that in the dark [-]; -1 when it is not known which side of an edge the Sun is on
    spread: float  # variance [-] that derivatives do not explain
    by_theta: Vec3  # [1/rad]
    by_scale: float
    by_earth: float
    by_gain: float
    gain_state: int
    by_cloud: float
    cloud_state: int
    by_relative: float  # gain, and tilts, of the calibration
    by_tilt1: float  # [1/rad]
    by_tilt2: float
    own_state: int  # first of the calibration; -1: there are none


@kernel
def along(c: CellModel, earth_known: bool, row) -> float:
    """Derivatives times a row over the states."""
    total = c.by_theta[0] * row[0] + c.by_theta[1] * row[1] + c.by_theta[2] * row[2]
    total += c.by_scale * row[SCALE] + c.expected * row[COMMON] + c.by_gain * row[c.gain_state]
    if earth_known:
        total += c.by_earth * row[EARTH] + c.by_cloud * row[c.cloud_state]
    if c.own_state >= 0:
        total += (
            c.by_relative * row[c.own_state] + c.by_tilt1 * row[c.own_state + 1] + c.by_tilt2 * row[c.own_state + 2]
        )
    return total


@kernel
def view_of(p: SunFilterParameters, i: int, sun_b: Vec3, margin: float) -> tuple[float, bool, bool]:
    """Cosine of the Sun on cell i, whether it sees the Sun, and whether that is in doubt within a margin of cosines."""
    cell = p.cells[i]
    cosine = cell.nx * sun_b[0] + cell.ny * sun_b[1] + cell.nz * sun_b[2]
    edge = view_cosine(p.screen, i, p.cos_half_view)
    seen = cosine >= edge and not is_blocked(p.screen, i, sun_b)
    doubtful = edge > _SMALLEST_STEP and abs(cosine - edge) < margin
    if cell.side != 0.0:
        above = dot(p.screen.axis_b, sun_b) * (1.0 if cell.side > 0.0 else -1.0)
        seen = seen and above > 0.0
        if cosine > _SMALLEST_STEP and abs(above) < margin:
            doubtful = cosine > edge - margin
        elif above < 0.0:
            doubtful = False
    return cosine, seen, doubtful


@kernel
def light_of(p: SunFilterParameters, i: int, voltage: float) -> float:
    """Light [-] on cell i by an output, 1 that of the Sun at normal incidence."""
    cell = p.cells[i]
    return (voltage - cell.dark) / max(_LEAST_GAIN, cell.gain * p.response.scale)


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
    share, density = normal_share(z)
    mean = cosine * share + sigma * density
    square = (cosine * cosine + variance) * share + cosine * sigma * density
    return mean, share, max(0.0, square - mean * mean - share * share * variance)


@kernel
def _unused(use: int, expected: float) -> CellModel:
    return CellModel(use, expected, 0.0, (0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 0, 0.0, 0, 0.0, 0.0, 0.0, -1)


@kernel
def cell_model(
    p: SunFilterParameters,
    i: int,
    v: float,
    sun_n: Vec3,
    flux: float,
    margin: float,
    earth_known: bool,
    x,
    covariance,
    m: SunFilterMemory,
) -> CellModel:
    """The model of cell i at an estimate.

    Args:
        v: output less that in the dark [-].
        flux: of the Sun [-], 1 at 1 AU.
        margin: of what is in doubt next to an edge of view, in cosines.
        earth_known: the light of the Earth on the cells, and its slopes, are those of `m`; else it is unknown.
    """
    cells = p.cells.shape[0]
    cell, dcm_bn = p.cells[i], dcm_of(x)
    sun_b = multiply(dcm_bn, sun_n)
    cosine, seen, doubtful = view_of(p, i, sun_b, margin)
    edge = view_cosine(p.screen, i, p.cos_half_view)
    gain, normal_b, by_tilt1, by_tilt2 = cell.gain, (cell.nx, cell.ny, cell.nz), 0.0, 0.0
    calibrates = p.calibration.per_cell > 0
    if calibrates:
        relative, normal_b, by_tilt1, by_tilt2 = calibrated(cells, i, x, normal_b, sun_b)
        gain, cosine = gain * relative, dot(normal_b, sun_b)
    scale_now = p.response.scale * (1.0 + x[X_SCALE])
    earth_factor = 1.0 + x[X_EARTH] if earth_known else 0.0
    mean_light = m.earth[i] if earth_known else 0.0
    albedo = earth_factor * mean_light if earth_known else 0.5 * p.earth.unknown
    if doubtful:
        # the reading tells on which side of the edge the Sun is, where no Earth could
        sunlight = flux * max(cosine, edge)
        seen = sunlight > p.earth.largest and v > gain * scale_now * (albedo + 0.5 * sunlight)
        if not seen:
            return _unused(COUNTED, -1.0)
    # normals in n turn with the error, d(n) = theta x n
    across = cross(multiply_transposed(dcm_bn, normal_b), sun_n)
    sunlit, share, spread = max(cosine, 0.0), (1.0 if seen else 0.0), 0.0
    if edge < _SMALLEST_STEP and cell.side == 0.0 and not is_blocked(p.screen, i, sun_b):
        sunlit, share, spread = rising(cosine, _EDGE * quadratic(covariance, THETA, across) + _ROUNDING)
        seen = share > _HARDLY
    cloud = p.earth.clouds * mean_light
    received = albedo + (cloud * x[X_GAIN + cells + i] if earth_known else 0.0) + (flux * sunlit if seen else 0.0)
    output, slope = respond(p.response, received)
    factor = gain * (1.0 + x[X_GAIN + i])
    expected = factor * scale_now * output
    dark = _DARK * math.sqrt(p.errors.noise)
    if not seen and expected < dark and v < _SURELY_LIT * dark:
        return _unused(COUNTED, max(expected, 0.0))
    if not earth_known and not seen and v < p.earth.largest * flux:
        return _unused(LEFT_OUT, expected)
    slope *= factor * scale_now
    # slopes are those of a turn theta seen in b
    by_theta = scale(slope * flux * share, across) if seen else (0.0, 0.0, 0.0)
    if earth_known:
        by_earth_n = multiply_transposed(dcm_bn, triple(m.earth_slopes[i], 0))
        by_theta = add(by_theta, scale(slope * earth_factor, by_earth_n))
    by_scale, by_relative, own = factor * p.response.scale * output, 0.0, -1
    if calibrates:
        # the Sun alone calibrates: nobody knows so well how bright the Earth is on a cell
        own = first_state(cells) + PER_CELL * i
        sunlight = flux * slope * share if seen else 0.0
        by_tilt1, by_tilt2 = sunlight * by_tilt1, sunlight * by_tilt2
        by_relative = cell.gain * (1.0 + x[X_GAIN + i]) * scale_now * output if seen else 0.0
        by_scale = by_scale if seen else 0.0
    return CellModel(
        USED,
        expected,
        slope * slope * flux * flux * spread,
        by_theta,
        by_scale,
        slope * mean_light,
        gain * scale_now * output,
        GAIN + i,
        slope * cloud,
        GAIN + cells + i,
        by_relative,
        by_tilt1,
        by_tilt2,
        own,
    )
