# SPDX-License-Identifier: Apache-2.0
"""Whether the gyro is right, by its own samples and by the Sun line; what is given on of its rate.

Modes and remedies stand in `gyro_state`. The Sun tells of two axes; of that along the Sun line nothing is known but
jumps, until the line has moved through the body. Without the Sun nothing is judged but samples, and all verdicts stand.
"""

import math

from css_common.health import EVIDENCE_DEAD, EVIDENCE_NOISE, EVIDENCE_SUN, KIND_SILENT, hold, release
from css_common.kernel import kernel
from css_common.vectors import Vec3, add, matmul, multiply, norm, scale
from css_estimation.health.gyro_bias import corrected
from css_estimation.health.gyro_judgement import heed_jumps, judge
from css_estimation.health.gyro_samples import READING_ABSENT, READING_FAILED, READING_JUMPED, check_samples
from css_estimation.health.gyro_state import (
    GYRO_CORRECTED,
    GYRO_LEFT,
    GyroHealthParameters,
    GyroState,
    Readings,
    leave,
)
from css_estimation.health.gyroless_sight import MOST_FOLLOWED, Glimpse
from css_estimation.health.rate_checks import forget_samples, unknown_turn
from css_estimation.health.reference_line import off_the_gyro
from css_estimation.health.sight_line import (
    begin_again,
    follow_sight,
    interrupted,
    whitening,
)


@kernel
def _not_given(
    p: GyroHealthParameters, state: GyroState, axes, fits, verdicts, dt: float, step: int
) -> tuple[GyroState, Vec3, bool, bool]:
    """A cycle without a reading."""
    r = state.readings
    if not r.spoken:
        return state, r.rate_b, False, False
    silent = r.silent + dt
    opinion = state.opinion
    if silent > p.silence and r.silent <= p.silence:
        for i in range(3):
            forget_samples(axes[i])
            hold(verdicts[i], KIND_SILENT, EVIDENCE_DEAD, silent, p.silence, step)
    readings = Readings(r.rate_b, r.before_b, r.dt, True, silent)
    state = GyroState(readings, opinion, interrupted(state.sight))
    return state, r.rate_b, False, silent > p.silence or opinion.mode == GYRO_LEFT


@kernel
def _compare_with_sun(
    p: GyroHealthParameters, state: GyroState, fits, verdicts, step: int, sight: Glimpse, misfits: bool
) -> GyroState:
    """Follows the Sun line through one cycle, and judges the gyro at the end of a block."""
    r = state.readings
    # the sight is that of the last cycle
    rate_b = scale(0.5, add(r.before_b, r.rate_b))
    opinion = state.opinion
    rate = norm(rate_b)
    unknown = unknown_turn(p.checks, rate, r.dt) if rate * r.dt < MOST_FOLLOWED else math.inf
    bias_b = opinion.bias.bias_b
    line, behind_b = follow_sight(p.sight, state.sight, r.dt, rate_b, bias_b, p.largest_error, unknown, sight)
    if sight.known and line.line.time >= p.block:
        white = whitening(p.sight, line, sight, r.dt, p.checks.noise * p.checks.noise)
        block = line.line
        opinion = judge(
            p,
            opinion,
            fits,
            verdicts,
            matmul(white, block.by_bias),
            matmul(white, block.by_scale),
            multiply(white, off_the_gyro(block, behind_b)),
            1.0,
            2,
            block.time,
            misfits,
            EVIDENCE_SUN,
            step,
        )
        line = begin_again(line, sight, opinion.bias.bias_b)
    return GyroState(r, opinion, line)


@kernel
def unheard(state: GyroState, axes) -> GyroState:
    """A cycle in which nobody listens to the gyro: nothing is judged, and what it says next is its first word.

    Args:
        axes: (3,) of GYRO_AXIS, advanced.
    """
    r = state.readings
    if r.spoken:
        for i in range(3):
            forget_samples(axes[i])
    return GyroState(Readings(r.rate_b, r.before_b, 0.0, False, 0.0), state.opinion, interrupted(state.sight))


@kernel
def check_gyro(
    p: GyroHealthParameters,
    state: GyroState,
    axes,
    fits,
    verdicts,
    dt: float,
    step: int,
    gyro_b: Vec3,
    valid: bool,
    sight: Glimpse,
    misfits: bool,
) -> tuple[GyroState, Vec3, bool, bool]:
    """One cycle.

    Args:
        axes: (3,) of GYRO_AXIS, advanced.
        fits: of `gyro_fit`, advanced.
        verdicts: (3,) of VERDICT, one an axis.
        dt: [s] since the last cycle.
        step: number of the cycle.
        gyro_b, valid: the reading [rad/s], and whether there is one.
        sight: of the last cycle.
        misfits: the cells contradict a Sun line that the gyro leads.

    Returns:
        State; rate to go on with [rad/s]; whether there is one; whether the gyro is left.
    """
    if not valid:
        return _not_given(p, state, axes, fits, verdicts, dt, step)
    r = state.readings
    rate_b, reading = check_samples(p.checks, axes, verdicts, r.silent + dt, step, gyro_b, r.rate_b)
    opinion = state.opinion
    if r.silent > p.silence:
        # one that speaks again says what it said before: silence is no lie
        for i in range(3):
            if verdicts[i].held != 0 and verdicts[i].kind == KIND_SILENT:
                release(verdicts[i])
    if reading == READING_ABSENT:
        return state, rate_b, False, opinion.mode == GYRO_LEFT
    line = state.sight
    if reading == READING_FAILED:
        opinion = leave(p, opinion, fits, opinion.claim)
        line = interrupted(line)
    elif reading == READING_JUMPED:
        opinion = heed_jumps(p, opinion, axes, fits, verdicts, EVIDENCE_NOISE, step)
        line = interrupted(line)
    if r.silent > 0.0 or not r.spoken:
        line = interrupted(line)
    else:
        state = _compare_with_sun(p, GyroState(r, opinion, line), fits, verdicts, step, sight, misfits)
        opinion, line = state.opinion, state.sight
    readings = Readings(rate_b, r.rate_b if r.spoken else rate_b, dt, True, 0.0)
    if opinion.mode == GYRO_CORRECTED:
        rate_b = corrected(rate_b, opinion.bias, p.body_rate)
    left = opinion.mode == GYRO_LEFT
    return GyroState(readings, opinion, line), rate_b, not left, left
