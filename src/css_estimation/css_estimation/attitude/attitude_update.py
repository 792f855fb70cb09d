# SPDX-License-Identifier: Apache-2.0
"""What the attitude filter makes of one cycle's measurements: field first, then the Sun in either model."""

import math
from typing import NamedTuple

from css_common.attitude import mrp_add, mrp_to_dcm, rotation_vector_to_mrp
from css_common.kernel import kernel
from css_common.vectors import Mat3, Vec3, add, dot, multiply, norm, scale
from css_environment.albedo import Screen, albedo_output
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
from css_estimation.attitude.field_direction import field_measurement
from css_estimation.attitude.flight_references import References
from css_estimation.attitude.lit_sun_vector import lit_sun, sun_vector_measurement
from css_estimation.sun import cell_calibration
from css_estimation.sun.cell_calibration import SCALE
from css_estimation.sun.cell_layout import READABLE, brightest
from css_estimation.sun.error_covariance import (
    ATTITUDE,
    BIAS,
    CALIBRATION,
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
    references: References,
    light,
) -> tuple[AttitudeState, Tally]:
    """State after the measurements of one cycle, arguments as of `attitude_ekf.step`."""
    tally = Tally(0.0, 0, False, 0, 0)
    if field_ok:
        predicted_b = multiply(mrp_to_dcm(state.sigma_bn), references.field_n)
        m = field_measurement(field_b, predicted_b, p.field_variance)
        m = widened(m, neglected_variance(memory.covariance), 1.0)
        state, tally = _take_direction(p, state, memory, m, tally, USED_FIELD, 0)
    if references.sunlit:
        dcm_bn = mrp_to_dcm(state.sigma_bn)
        _predict_albedo(p, memory, dcm_bn, light)
        mask, top = _lit_outputs(p, memory, voltages, references.intensity)
        if mask != 0:
            sun_b = multiply(dcm_bn, references.sun_n)
            if p.by_voltage:
                state, tally = _take_cells(p, state, memory, voltages, mask, sun_b, references.intensity, tally)
            else:
                sun = lit_sun(p.cells.layout.cells, memory.outputs, mask, top)
                m = sun_vector_measurement(sun, sun_b, p.cells.variance / references.intensity**2)
                m = widened(m, neglected_variance(memory.covariance), sun.information[0])
                state, tally = _take_direction(p, state, memory, m, tally, USED_SUN, mask)
    return state, tally


@kernel
def find_start(
    p: AttitudeParameters, memory: AttitudeMemory, voltages, field_b: Vec3, field_ok: bool, references: References
) -> tuple[Start, int]:
    """An attitude from Sun and field together, and the cells that it rests on."""
    if not (field_ok and references.sunlit):
        return no_start(), 0
    for i in range(memory.albedo.shape[0]):
        memory.albedo[i] = 0.0
    mask, top = _lit_outputs(p, memory, voltages, references.intensity)
    if mask == 0:
        return no_start(), 0
    cells = p.cells.layout.cells
    sun = lit_sun(cells, memory.outputs, mask, top)
    strength = norm(references.field_n)
    field_n, measured_b = scale(1.0 / strength, references.field_n), scale(1.0 / norm(field_b), field_b)
    variance = p.cells.variance + p.cells.calibration.scale_variance
    if p.compensates_albedo:
        variance += _ALBEDO_SPREAD * _ALBEDO_SPREAD
    cosine = dot(references.sun_n, field_n)
    sun_b, sigma, known = chosen_sun(cells, memory.outputs, mask, sun, cosine, measured_b, math.sqrt(variance), p.gate)
    if not known:
        return no_start(), 0
    field_sigma = math.sqrt(p.field_variance) / strength
    return start(sun_b, sigma, references.sun_n, measured_b, field_sigma, field_n), mask


@kernel
def _is_converged(p: AttitudeParameters, memory: AttitudeMemory) -> bool:
    return trace(attitude_block(memory.covariance)) < p.gated_below


@kernel
def _predict_albedo(p: AttitudeParameters, memory: AttitudeMemory, dcm_bn: Mat3, light) -> None:
    layout = p.cells.layout
    if p.compensates_albedo:
        screen = Screen(layout.clip_normal_b, 0.0, 0.0)
        albedo_output(light, layout.cells, screen, layout.cos_half_view, dcm_bn, memory.albedo_work, memory.albedo)
    else:
        for i in range(memory.albedo.shape[0]):
            memory.albedo[i] = 0.0


@kernel
def _lit_outputs(p: AttitudeParameters, memory: AttitudeMemory, voltages, intensity: float) -> tuple[int, int]:
    """Mask of lit cells and the brightest; none when there is no Sun. Outputs in the memory lose scale and albedo."""
    outputs = memory.outputs
    for i in range(voltages.shape[0]):
        v = voltages[i]
        readable = -READABLE < v < READABLE
        outputs[i] = (v / memory.calibration[i, SCALE] - memory.albedo[i]) / intensity if readable else math.nan
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
    taken = nis <= _GATES[m.dof - 1] or (nis < math.inf and not _is_converged(p, memory))
    if not taken:
        return state, Tally(tally.nis, tally.taken, True, tally.lit_mask, tally.used)
    calibrates = p.cells.calibration.estimated
    update_direction(memory.covariance, memory.work, m, memory.covariance.shape[0] if calibrates else CALIBRATION)
    state = _corrected(p, state, memory)
    cell_calibration.correct(p.cells.calibration, memory.calibration, memory.work[CORRECTION])
    return state, Tally(tally.nis + nis, tally.taken + m.dof, tally.refused, tally.lit_mask | mask, tally.used | source)


@kernel
def _take_cells(
    p, state, memory, voltages, lit_mask: int, sun_b: Vec3, intensity: float, tally: Tally
) -> tuple[AttitudeState, Tally]:
    c = p.cells.calibration
    covariance, work = memory.covariance, memory.work
    converged = _is_converged(p, memory)
    neglected = neglected_variance(covariance) * intensity * intensity
    nis, offered, count, mask = 0.0, 0, 0, 0
    begin_update(work)
    for i in range(voltages.shape[0]):
        if not -READABLE < voltages[i] < READABLE:
            continue
        is_lit = lit_mask >> i & 1 == 1
        m = cell_measurement(p.cells, memory.calibration, i, voltages[i], is_lit, sun_b, intensity, memory.albedo[i])
        if not m.used:
            continue
        offered += 1
        innovation, s = innovate(covariance, work, m.partials, m.residual, m.variance + neglected)
        q = innovation * innovation / s
        if not q < math.inf or (converged and q > _GATES[0]):
            continue
        calibrates = c.estimated and converged and m.calibrates
        update(covariance, work, innovation, s, covariance.shape[0] if calibrates else CALIBRATION)
        nis += q
        count += 1
        mask |= 1 << i
    if count > 0:
        state = _corrected(p, state, memory)
        cell_calibration.correct(c, memory.calibration, work[CORRECTION])
    used = tally.used | USED_SUN if count > 0 else tally.used
    refused = tally.refused or 2 * count < offered
    return state, Tally(tally.nis + nis, tally.taken + count, refused, tally.lit_mask | mask, used)


@kernel
def _corrected(p, state: AttitudeState, memory: AttitudeMemory) -> AttitudeState:
    """State after the corrections that were gathered; the error of attitude and bias is none again."""
    work = memory.work
    turn = (work[CORRECTION, ATTITUDE], work[CORRECTION, ATTITUDE + 1], work[CORRECTION, ATTITUDE + 2])
    angle = norm(turn)
    if angle > _LARGEST_CORRECTION:
        turn = scale(_LARGEST_CORRECTION / angle, turn)
    bias_b = add(state.bias_b, (work[CORRECTION, BIAS], work[CORRECTION, BIAS + 1], work[CORRECTION, BIAS + 2]))
    return with_attitude(state, mrp_add(state.sigma_bn, rotation_vector_to_mrp(turn)), bias_b)
