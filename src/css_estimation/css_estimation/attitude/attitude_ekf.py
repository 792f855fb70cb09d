# SPDX-License-Identifier: Apache-2.0
"""Multiplicative Kalman filter on attitude and gyro bias from field, Sun and gyro.

Lefferts, Markley & Shuster 1982; Crassidis & Junkins, Optimal Estimation of Dynamic Systems, section 6.2. The
measurement models plug in: the field (`field_direction`), and the Sun as a vector of the lit cells (`lit_sun_vector`)
or as the output of each cell (`cell_voltages`), as DiGregorio & Crassidis compare them. Between cycles the attitude
turns with the mean of the gyro's readings at both ends, which is exact for a rate that changes evenly.

It begins, and begins anew, from the Sun and the field together (`attitude_start`): when it has never had an attitude,
when a step was too long to be bridged, when its uncertainty has grown beyond use, and when the field or the Sun has
contradicted it for too long. Until all rolls about the field have been weighed (`roll_search`) no attitude is taken for
sure: a wide one is not narrowed by the cells, in which it might settle wrongly, and one that is not where the weight is
gives way.

An attitude filter is a module with `parameters(values)`, `initial_state(p)`, `initial_memory(p)` and the kernel `step`
below. What `parameters` returns is a NamedTuple that the module itself defines: by its type a study finds the module.
"""

from css_common.attitude import (
    dcm_to_mrp,
    mrp_add,
    rotation_vector_to_dcm,
    rotation_vector_to_mrp,
)
from css_common.kernel import kernel
from css_common.schema import Values
from css_common.vectors import Vec3, add, scale, subtract
from css_estimation.attitude import attitude_options, attitude_solution, roll_search, slow_errors
from css_estimation.attitude.attitude_confirmation import begun_at, judged, search_roll
from css_estimation.attitude.attitude_options import LOST_VARIANCE, AttitudeParameters
from css_estimation.attitude.attitude_solution import (
    MODE_LOST,
    MODE_PROPAGATING,
    MODE_STARTED,
    MODE_TRACKING,
    MODE_WAITING,
    USED_FIELD,
    USED_GYRO,
    USED_SUN,
    VALIDITY_HELD,
    VALIDITY_NONE,
    VALIDITY_VALID,
    AttitudeMemory,
    AttitudeSolution,
    AttitudeState,
    with_alignment,
    with_attitude,
    with_cells,
    with_search,
)
from css_estimation.attitude.attitude_update import Tally, find_start, measure
from css_estimation.attitude.field_direction import plausible_field
from css_estimation.attitude.flight_references import References
from css_estimation.health.cell_health import trust_cells
from css_estimation.health.cell_memory import CellHealthState
from css_estimation.sun import cell_calibration
from css_estimation.sun.error_covariance import (
    ATTITUDE,
    BIAS,
    FURTHER,
    attitude_block,
    bound,
    propagate,
    set_block,
)
from css_estimation.sun.sun_heading import PREDICTION_ECLIPSED, PREDICTION_SUNLIT, RATE_GYRO, RATE_NONE, Sky
from css_estimation.sun.sun_tracking import is_body_rate
from css_estimation.symmetric import isotropic, trace

# Trace of the attitude covariance [rad^2] beyond which a fresh start is better: 33 deg for each axis.
_USELESS = 1.0
_LONGEST_SPAN = 1e9
_HALF, _NOT_ALL = 0.5, 0.99  # of the Sun's disc
_NOWHERE: Vec3 = (0.0, 0.0, 0.0)
# After so long without field or Sun the search is given up, and a wide attitude is narrowed by what there is [s].
_LONGEST_IDLE = 30.0


class AttitudeEkf(AttitudeParameters):
    """The parameters of this filter."""

    __slots__ = ()


def parameters(values: Values) -> AttitudeEkf:
    """Parameters from checked values (`attitude_options.PARAMETERS` and what goes with them)."""
    return AttitudeEkf(*attitude_options.parameters(values))


def initial_state(p: AttitudeParameters) -> AttitudeState:
    """State before the first cycle."""
    return attitude_solution.initial_state(p)


def initial_memory(p: AttitudeParameters) -> AttitudeMemory:
    """Arrays before the first cycle."""
    return attitude_solution.initial_memory(p)


@kernel
def step(
    p: AttitudeParameters,
    state: AttitudeState,
    memory: AttitudeMemory,
    dt: float,
    voltages,
    gyro_b: Vec3,
    gyro_valid: bool,
    field_b: Vec3,
    field_valid: bool,
    references: References,
    light,
) -> tuple[AttitudeState, AttitudeSolution]:
    """One cycle.

    Args:
        memory: advanced in place.
        dt: time since the last cycle [s].
        voltages: (N,) cell outputs [-].
        gyro_b: body rate [rad/s], a measurement if `gyro_valid`.
        field_b: magnetic field [T], a measurement if `field_valid`.
        references: of the flight's models.
        light: (192,) patches of light of the Earth, read when albedo is compensated.
    """
    dt = min(dt, _LONGEST_SPAN) if dt > 0.0 else 0.0
    gyro_ok = _gyro_usable(p, gyro_b, gyro_valid)
    state = with_cells(state, _judge_cells(p, state, memory, dt, voltages, gyro_b, gyro_ok, references, light))
    outputs = memory.health.trusted
    if state.started or state.search.begun:
        state = _predict(p, state, memory, dt, gyro_b, gyro_ok)
    field_ok = field_valid and plausible_field(field_b) and plausible_field(references.field_n)
    tally = Tally(0.0, 0, False, 0, 0)
    started_now = False
    distrusted = state.contradicted > p.restart_after
    if not state.aligned or distrusted or trace(attitude_block(memory.covariance)) > _USELESS:
        begun, mask = find_start(p, memory, outputs, field_b, field_ok, references)
        if begun.found:
            started_now = True
            state = begun_at(p, state, memory, dcm_to_mrp(begun.dcm_bn), begun.covariance, distrusted)
            state = with_search(state, False, roll_search.no_search())
            tally = Tally(0.0, 0, False, mask, USED_FIELD | USED_SUN)
    if not state.confirmed and field_ok:
        state, moved, mask = search_roll(p, state, memory, dt, outputs, field_b, references, light)
        if moved:
            started_now = True
            tally = Tally(0.0, 0, False, mask, USED_FIELD | USED_SUN if mask != 0 else USED_FIELD)
    if state.aligned and not started_now:
        narrow = state.confirmed or trace(attitude_block(memory.covariance)) < p.gated_below
        sun_too = narrow or not state.search.begun or state.search.idle > _LONGEST_IDLE
        state, tally = measure(p, state, memory, outputs, field_b, field_ok, sun_too, references, light)
        state = judged(state, tally, dt)
    bound(memory.covariance, memory.largest)
    return _finish(state, gyro_b, gyro_ok, dt, started_now, tally)


@kernel
def _judge_cells(
    p: AttitudeParameters,
    state: AttitudeState,
    memory: AttitudeMemory,
    dt: float,
    voltages,
    gyro_b: Vec3,
    gyro_ok: bool,
    references: References,
    light,
) -> CellHealthState:
    """Health of the cells after this cycle; what can be trusted of their outputs is then in its memory."""
    r = references
    part = 1.0 if r.sunlit else min(r.intensity, _NOT_ALL)
    predicted = PREDICTION_ECLIPSED if part < _HALF else PREDICTION_SUNLIT
    sky = Sky(True, predicted, r.sun_n, r.intensity, part, _NOWHERE, r.field_n, light)
    rate = subtract(gyro_b, state.bias_b) if gyro_ok else state.omega_bn_b
    source = RATE_GYRO if gyro_ok else RATE_NONE
    return trust_cells(p.judges_cells, p.health, state.cells, memory.health, dt, voltages, rate, source, sky)


@kernel
def _gyro_usable(p: AttitudeParameters, gyro_b: Vec3, gyro_valid: bool) -> bool:
    return p.use_gyro and gyro_valid and is_body_rate(gyro_b, p.gyro_limit)


@kernel
def _predict(p, state: AttitudeState, memory: AttitudeMemory, dt: float, gyro_b: Vec3, gyro_ok: bool) -> AttitudeState:
    """State and covariance at this cycle, before its measurements."""
    if dt > p.longest_step:
        # what turned the body meanwhile is unknown; how its bias may have walked is not
        set_block(memory.covariance, ATTITUDE, isotropic(LOST_VARIANCE))
        for i in range(BIAS, FURTHER):
            memory.covariance[i, i] += p.bias_noise * dt
        slow_errors.relax(p.slow, memory.covariance, memory.slow, dt)
        return with_search(with_alignment(state, False, 0.0), False, roll_search.no_search())
    rate = state.omega_bn_b
    if gyro_ok:
        mean = scale(0.5, add(state.gyro_b, gyro_b)) if state.gyro_known else gyro_b
        rate = subtract(mean, state.bias_b)
    turn = scale(dt, rate)
    noise = p.angle_noise if gyro_ok else p.noise_without_gyro
    propagate(memory.covariance, rotation_vector_to_dcm(turn), dt, noise, p.bias_noise, gyro_ok)
    slow_errors.relax(p.slow, memory.covariance, memory.slow, dt)
    cell_calibration.add_drift(p.cells.calibration, p.cells.calibration_at, memory.covariance, dt)
    if state.search.begun:
        state = with_search(state, state.confirmed, roll_search.turned(state.search, turn, dt))
    return with_attitude(state, mrp_add(state.sigma_bn, rotation_vector_to_mrp(turn)), state.bias_b)


@kernel
def _finish(
    state: AttitudeState, gyro_b: Vec3, gyro_ok: bool, dt: float, started_now: bool, tally: Tally
) -> tuple[AttitudeState, AttitudeSolution]:
    """State for the next cycle, and what this one has to tell."""
    started = state.started or started_now
    validity, mode, age, used = VALIDITY_NONE, MODE_WAITING, 0.0, tally.used
    if started:
        seen = used != 0
        validity = VALIDITY_VALID if seen else VALIDITY_HELD
        age = 0.0 if seen else state.age + dt
        mode = MODE_LOST
        if started_now:
            mode = MODE_STARTED
        elif state.aligned:
            mode = MODE_TRACKING if seen else MODE_PROPAGATING
        if gyro_ok and state.started:
            used |= USED_GYRO
    omega_bn_b = subtract(gyro_b, state.bias_b) if gyro_ok else state.omega_bn_b
    last_b = gyro_b if gyro_ok else (0.0, 0.0, 0.0)
    after = AttitudeState(
        started,
        state.aligned,
        state.sigma_bn,
        state.bias_b,
        omega_bn_b,
        last_b,
        gyro_ok,
        age,
        state.contradicted,
        state.confirmed,
        state.search,
        state.cells,
    )
    return after, AttitudeSolution(
        state.sigma_bn,
        omega_bn_b,
        state.bias_b,
        age,
        tally.nis,
        tally.taken,
        tally.lit_mask,
        validity,
        used,
        mode,
        state.cells.isolated,
    )
