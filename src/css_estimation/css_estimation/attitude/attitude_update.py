# SPDX-License-Identifier: Apache-2.0
"""What the attitude filter makes of one cycle's measurements: field first, then the Sun in either model.

Where errors last (`slow_errors`) cells that look away from the Sun are taken too, in both models: they measure the
brightness of the Earth. A cell counts as looking away once the attitude is good enough to tell.
"""

import math
from typing import NamedTuple

from css_common.attitude import mrp_add, mrp_to_dcm, rotation_vector_to_mrp
from css_common.kernel import kernel
from css_common.vectors import Mat3, Vec3, add, dot, multiply, norm, scale, subtract
from css_estimation.attitude import slow_errors
from css_estimation.attitude.attitude_options import AttitudeParameters
from css_estimation.attitude.attitude_solution import USED_FIELD, USED_SUN, AttitudeMemory, AttitudeState, with_attitude
from css_estimation.attitude.attitude_start import Start, chosen_sun, no_start, start
from css_estimation.attitude.cell_voltages import cell_measurement
from css_estimation.attitude.direction_measurement import (
    DirectionMeasurement,
    normalised_innovation,
    update_direction,
    widened,
)
from css_estimation.attitude.earth_on_cells import EarthOnCells, no_earth_on_cells, predict_earth_on_cells
from css_estimation.attitude.field_direction import biased_field_measurement, field_measurement
from css_estimation.attitude.flight_references import References
from css_estimation.attitude.lit_sun_vector import lit_sun, sun_vector_measurement
from css_estimation.attitude.slow_errors import BRIGHTNESS, brightness, field_error, magnetometer_bias
from css_estimation.sun import cell_calibration
from css_estimation.sun.cell_calibration import SCALE
from css_estimation.sun.cell_layout import READABLE, brightest
from css_estimation.sun.error_covariance import (
    ATTITUDE,
    BIAS,
    CORRECTION,
    attitude_block,
    begin_update,
    innovate,
    neglected_variance,
    update,
)
from css_estimation.symmetric import trace

# 99.9 % of chi-square with 1, 2 and 3 degrees of freedom.
_GATES = (10.83, 13.82, 16.27)
# A cell's albedo while there is no attitude to predict it with, 1 sigma.
_ALBEDO_SPREAD = 0.15
# Cosine of the Sun below the edge of a cell's view from which it looks away, beside three sigma of the attitude.
_TWILIGHT, _SIGMAS = 0.05, 3.0
# A correction beyond a quarter turn says that the linearisation is worth nothing.
_LARGEST_CORRECTION = 0.5 * math.pi


class Tally(NamedTuple):
    """What a cycle's measurements came to."""

    nis: float  # of what was taken
    taken: int  # degrees of freedom
    refused: bool  # the field, or most of what the Sun gives, was refused
    lit_mask: int  # cells that contributed
    used: int  # USED_*


@kernel
def measure(
    p: AttitudeParameters,
    state: AttitudeState,
    memory: AttitudeMemory,
    voltages,
    field_b: Vec3,
    field_ok: bool,
    sun_too: bool,
    references: References,
    light,
) -> tuple[AttitudeState, Tally]:
    """State after the measurements of one cycle, arguments as of `attitude_ekf.step`.

    Args:
        field_ok: the field is one.
        sun_too: the cells are to be taken.
    """
    tally = Tally(0.0, 0, False, 0, 0)
    if field_ok:
        m = _field(p, memory, mrp_to_dcm(state.sigma_bn), field_b, references.field_n)
        m = widened(m, neglected_variance(memory.covariance), 1.0)
        state, tally = _take_direction(p, state, memory, m, tally, USED_FIELD, 0)
    if references.sunlit and sun_too:
        of_it = (BRIGHTNESS, 1) if p.slow.lasting else (0, 0)
        dcm_bn = mrp_to_dcm(state.sigma_bn)
        _predict_earth(p, memory, dcm_bn, light)
        earth = EarthOnCells(
            p.compensates_albedo, memory.albedo, memory.albedo_slopes, brightness(memory.slow), of_it[0], of_it[1]
        )
        mask, top = _lit_outputs(p, memory, voltages, references.intensity)
        if mask != 0:
            sun_b = multiply(dcm_bn, references.sun_n)
            darkest = _darkest(p, memory)
            turned_away = _turned_away(p, sun_b, darkest)
            if not p.by_voltage:
                cells, mask = p.cells.layout.cells, mask & ~turned_away
                sun = lit_sun(cells, memory.outputs, mask, top)
                variance = _vector_variance(p, earth, mask) / references.intensity**2
                m = sun_vector_measurement(sun, cells, mask, sun_b, references.intensity, earth, variance)
                m = widened(m, neglected_variance(memory.covariance), sun.information[0])
                state, tally = _take_direction(p, state, memory, m, tally, USED_SUN, mask)
                # the vector has turned the attitude, and told of the Earth
                dcm_bn = mrp_to_dcm(state.sigma_bn)
                _predict_earth(p, memory, dcm_bn, light)
                sun_b, bright = multiply(dcm_bn, references.sun_n), brightness(memory.slow)
                earth = EarthOnCells(
                    p.compensates_albedo, memory.albedo, memory.albedo_slopes, bright, of_it[0], of_it[1]
                )
            offered = -1 if p.by_voltage else turned_away
            if offered != 0:
                state, tally = _take_cells(
                    p, state, memory, voltages, mask, offered, sun_b, references.intensity, earth, darkest, tally
                )
    return state, tally


@kernel
def _field(
    p: AttitudeParameters, memory: AttitudeMemory, dcm_bn: Mat3, field_b: Vec3, field_n: Vec3
) -> DirectionMeasurement:
    if p.slow.lasting:
        believed_n, bias_b = add(field_n, field_error(memory.slow)), magnetometer_bias(memory.slow)
        return biased_field_measurement(field_b, dcm_bn, believed_n, bias_b, p.field_variance)
    return field_measurement(field_b, multiply(dcm_bn, field_n), p.field_variance)


@kernel
def _darkest(p: AttitudeParameters, memory: AttitudeMemory) -> float:
    """Cosine of the Sun below which a cell surely looks away from it; -1 or less: none does."""
    if not (p.slow.lasting and p.compensates_albedo):
        return -2.0
    return p.cells.layout.cos_half_view - _TWILIGHT - _SIGMAS * math.sqrt(trace(attitude_block(memory.covariance)))


@kernel
def _turned_away(p: AttitudeParameters, sun_b: Vec3, darkest: float) -> int:
    """Mask of the cells that look away from the Sun."""
    cells, mask = p.cells.layout.cells, 0
    for i in range(cells.shape[0]):
        if cells[i].nx * sun_b[0] + cells[i].ny * sun_b[1] + cells[i].nz * sun_b[2] < darkest:
            mask |= 1 << i
    return mask


@kernel
def _vector_variance(p: AttitudeParameters, earth: EarthOnCells, mask: int) -> float:
    """Variance of a lit cell's output, the mean over those in `mask`."""
    total, count = 0.0, 0
    for i in range(earth.light.shape[0]):
        if mask >> i & 1 == 1:
            error = p.cells.albedo_share * earth.brightness * earth.light[i]
            total += error * error
            count += 1
    return p.cells.variance + (total / count if count > 0 else 0.0)


@kernel
def find_start(
    p: AttitudeParameters, memory: AttitudeMemory, voltages, field_b: Vec3, field_ok: bool, references: References
) -> tuple[Start, int]:
    """An attitude from Sun and field together, and the cells that it rests on."""
    if not (field_ok and references.sunlit):
        return no_start(), 0
    no_earth_on_cells(memory.albedo, memory.albedo_slopes)
    mask, top = _lit_outputs(p, memory, voltages, references.intensity)
    if mask == 0:
        return no_start(), 0
    cells = p.cells.layout.cells
    sun = lit_sun(cells, memory.outputs, mask, top)
    believed_n, unbiased_b = believed_fields(memory, field_b, references)
    strength = norm(believed_n)
    field_n, measured_b = scale(1.0 / strength, believed_n), scale(1.0 / norm(unbiased_b), unbiased_b)
    variance = p.cells.variance + p.cells.calibration.scale_variance
    if p.compensates_albedo:
        variance += _ALBEDO_SPREAD * _ALBEDO_SPREAD
    cosine = dot(references.sun_n, field_n)
    sun_b, sigma, known = chosen_sun(cells, memory.outputs, mask, sun, cosine, measured_b, math.sqrt(variance), p.gate)
    if not known:
        return no_start(), 0
    field_variance = p.field_variance
    if p.slow.lasting:
        field_variance += p.slow.bias_variance + p.slow.field_variance
    field_sigma = math.sqrt(field_variance) / strength
    return start(sun_b, sigma, references.sun_n, measured_b, field_sigma, field_n), mask


@kernel
def believed_fields(memory: AttitudeMemory, field_b: Vec3, references: References) -> tuple[Vec3, Vec3]:
    """Field in n with the estimated error of the model, and as measured in b without the magnetometer's bias [T]."""
    return add(references.field_n, field_error(memory.slow)), subtract(field_b, magnetometer_bias(memory.slow))


@kernel
def _is_converged(p: AttitudeParameters, memory: AttitudeMemory) -> bool:
    return trace(attitude_block(memory.covariance)) < p.gated_below


@kernel
def _predict_earth(p: AttitudeParameters, memory: AttitudeMemory, dcm_bn: Mat3, light) -> None:
    if p.compensates_albedo:
        predict_earth_on_cells(p.cells.layout, dcm_bn, light, memory.albedo_work, memory.albedo, memory.albedo_slopes)
    else:
        no_earth_on_cells(memory.albedo, memory.albedo_slopes)


@kernel
def _lit_outputs(p: AttitudeParameters, memory: AttitudeMemory, voltages, intensity: float) -> tuple[int, int]:
    """Mask of lit cells and the brightest; none when there is no Sun. Outputs in the memory lose scale and albedo."""
    outputs, bright = memory.outputs, brightness(memory.slow)
    for i in range(voltages.shape[0]):
        v = voltages[i]
        readable = -READABLE < v < READABLE
        outputs[i] = (
            (v / memory.calibration[i, SCALE] - bright * memory.albedo[i]) / intensity if readable else math.nan
        )
    top = brightest(outputs)
    mask = 0
    if top < 0 or outputs[top] <= p.minimum_output:
        return mask, top
    for i in range(outputs.shape[0]):
        if outputs[i] > p.gate:
            mask |= 1 << i
    return mask, top


@kernel
def _take_direction(
    p, state, memory, m: DirectionMeasurement, tally: Tally, source: int, mask: int
) -> tuple[AttitudeState, Tally]:
    if m.dof == 0:
        return state, tally
    nis = normalised_innovation(memory.covariance, m)
    taken = nis <= _GATES[min(max(m.dof, 1), 3) - 1] or (nis < math.inf and not _is_converged(p, memory))
    if not taken:
        return state, Tally(tally.nis, tally.taken, True, tally.lit_mask, tally.used)
    calibrates = p.cells.calibration.estimated
    estimated = memory.covariance.shape[0] if calibrates else p.cells.calibration_at
    update_direction(memory.covariance, memory.work, m, estimated)
    state = _corrected(p, state, memory)
    return state, Tally(tally.nis + nis, tally.taken + m.dof, tally.refused, tally.lit_mask | mask, tally.used | source)


@kernel
def _take_cells(
    p,
    state,
    memory,
    voltages,
    lit_mask: int,
    offered_mask: int,
    sun_b: Vec3,
    intensity: float,
    earth: EarthOnCells,
    darkest: float,
    tally: Tally,
) -> tuple[AttitudeState, Tally]:
    covariance, work = memory.covariance, memory.work
    converged = _is_converged(p, memory)
    neglected = neglected_variance(covariance) * intensity * intensity
    nis, offered, count, mask = 0.0, 0, 0, 0
    begin_update(work)
    for i in range(voltages.shape[0]):
        if offered_mask >> i & 1 == 0 or not -READABLE < voltages[i] < READABLE:
            continue
        is_lit = lit_mask >> i & 1 == 1
        m = cell_measurement(p.cells, memory.calibration, i, voltages[i], is_lit, sun_b, intensity, earth, darkest)
        if not m.used:
            continue
        offered += 1
        innovation, s = innovate(covariance, work, m.partials, m.residual, m.variance + neglected)
        q = innovation * innovation / s
        if not q < math.inf or (converged and q > _GATES[0]):
            continue
        calibrates = p.cells.calibration.estimated and converged and m.calibrates
        update(covariance, work, innovation, s, covariance.shape[0] if calibrates else p.cells.calibration_at)
        nis += q
        count += 1
        mask |= 1 << i
    if count > 0:
        state = _corrected(p, state, memory)
    used = tally.used | USED_SUN if count > 0 else tally.used
    refused = tally.refused or 2 * count < offered
    return state, Tally(tally.nis + nis, tally.taken + count, refused, tally.lit_mask | mask, used)


@kernel
def _corrected(p, state: AttitudeState, memory: AttitudeMemory) -> AttitudeState:
    """State and memory after the corrections that were gathered; the errors that were corrected are none again."""
    work = memory.work
    turn = (work[CORRECTION, ATTITUDE], work[CORRECTION, ATTITUDE + 1], work[CORRECTION, ATTITUDE + 2])
    angle = norm(turn)
    if angle > _LARGEST_CORRECTION:
        turn = scale(_LARGEST_CORRECTION / angle, turn)
    bias_b = add(state.bias_b, (work[CORRECTION, BIAS], work[CORRECTION, BIAS + 1], work[CORRECTION, BIAS + 2]))
    slow_errors.correct(p.slow, memory.slow, work[CORRECTION])
    cell_calibration.correct(p.cells.calibration, p.cells.calibration_at, memory.calibration, work[CORRECTION])
    return with_attitude(state, mrp_add(state.sigma_bn, rotation_vector_to_mrp(turn)), bias_b)


@kernel
def telling_cells(p: AttitudeParameters, memory: AttitudeMemory, voltages, references: References) -> int:
    """Cells by which an attitude can be told from others: all, or of the paper's vector those that make one."""
    if p.by_voltage or p.slow.lasting:
        return (1 << voltages.shape[0]) - 1
    no_earth_on_cells(memory.albedo, memory.albedo_slopes)
    mask, top = _lit_outputs(p, memory, voltages, references.intensity)
    if mask == 0 or lit_sun(p.cells.layout.cells, memory.outputs, mask, top).rank < 3:
        return 0
    return mask
