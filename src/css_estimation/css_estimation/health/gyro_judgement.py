# SPDX-License-Identifier: Apache-2.0
"""What is thought of the error of a gyro after one more comparison with a reference line."""

import math

from css_common.health import KIND_BIAS, KIND_DRIFTING, KIND_SIGN, KIND_UNKNOWN, hold, release, rename
from css_common.kernel import kernel
from css_common.vectors import Mat3, Vec3
from css_estimation.health.gyro_bias import Bias, after_jumps, axis_significance, jumped, learn, significance, walk
from css_estimation.health.gyro_fit import (
    NO_SHAPE,
    add_block,
    best_shape,
    forget_fits,
    is_motion,
    kind_of,
    refutes,
    sign_of_axis,
    wrong_sign,
)
from css_estimation.health.gyro_state import (
    GYRO_CORRECTED,
    GYRO_LEFT,
    GYRO_TRUSTED,
    GyroHealthParameters,
    Opinion,
    anew,
    leave,
)

_SIGN_TOLD = 4.0
_FEWEST_BLOCKS = 10  # in a trial
_CONSISTENT = 1.5  # normalised innovation squared per degree of freedom with which a bias is believed
_FEWEST_BIASED = 5  # that tell a bias: a single one is no evidence, however far it is off


@kernel
def release_all(verdicts) -> None:
    """No axis (3,) is held for failed."""
    for i in range(3):
        if verdicts[i].held != 0:
            release(verdicts[i])


@kernel
def _accuse(row, kind: int, evidence: int, statistic: float, threshold: float, step: int) -> None:
    if row.held == 0:
        hold(row, kind, evidence, statistic, threshold, step)
    elif kind not in (row.kind, KIND_UNKNOWN):
        rename(row, kind)


@kernel
def _accuse_biased(p: GyroHealthParameters, verdicts, bias: Bias, kind: int, evidence: int, step: int) -> None:
    """Holds for failed the axes whose bias is beyond the usual; the worst one at least."""
    worst = _worst_axis(p, bias)
    for i in range(3):
        statistic = axis_significance(bias, i, p.usual_bias)
        if i == worst:
            # no axis alone, but all together are beyond the threshold: then that is what decided
            statistic = max(statistic, significance(bias, p.usual_bias))
        if i == worst or statistic > p.threshold:
            _accuse(verdicts[i], kind, evidence, statistic, p.threshold, step)


@kernel
def _review_biased(p: GyroHealthParameters, verdicts, bias: Bias, evidence: int, step: int) -> None:
    """Which axes are biased is known better by and by."""
    worst = _worst_axis(p, bias)
    for i in range(3):
        statistic = axis_significance(bias, i, p.usual_bias)
        if verdicts[i].held == 0 and i == worst and statistic <= p.threshold:
            # all axes together are beyond what a gyro that is right again shows
            hold(verdicts[i], KIND_BIAS, evidence, significance(bias, p.usual_bias), p.agreement, step)
        elif verdicts[i].held == 0 and statistic > p.threshold:
            hold(verdicts[i], KIND_BIAS, evidence, statistic, p.threshold, step)
        elif verdicts[i].held != 0 and i != worst and statistic < p.agreement:
            release(verdicts[i])


@kernel
def _worst_axis(p: GyroHealthParameters, bias: Bias) -> int:
    """The axis whose bias is farthest beyond the usual."""
    worst, largest = 0, -1.0
    for i in range(3):
        statistic = axis_significance(bias, i, p.usual_bias)
        if statistic > largest:
            worst, largest = i, statistic
    return worst


@kernel
def _is_bias(bias: Bias, largest: float) -> bool:
    b = bias.bias_b
    return abs(b[0]) < largest and abs(b[1]) < largest and abs(b[2]) < largest


@kernel
def judge(
    p: GyroHealthParameters,
    opinion: Opinion,
    fits,
    verdicts,
    by_bias: Mat3,
    by_scale: Mat3,
    difference: Vec3,
    variance: float,
    degrees: int,
    time: float,
    misfits: bool,
    evidence: int,
    step: int,
) -> Opinion:
    """The opinion after one block.

    Args:
        fits: of `gyro_fit`, advanced.
        verdicts: (3,) of VERDICT, one an axis.
        by_bias, by_scale: F and G of `reference_line`.
        difference, variance, degrees: as of `gyro_bias.learn`.
        time: [s] of the block.
        misfits: the cells too contradict a Sun line that the gyro leads; without that a gyro that is trusted stays so.
        evidence: `EVIDENCE_*` of the line.
        step: number of the cycle.
    """
    # a bias that drifts goes on with its drift for as long as comparisons count
    wander = (p.walk + opinion.drift * opinion.drift * p.memory) * time
    bias = learn(walk(opinion.bias, wander, p.largest_bias), by_bias, difference, variance, degrees)
    fit_time = opinion.fit_time + time
    add_block(fits, by_bias, by_scale, difference, variance, fit_time - 0.5 * time, math.exp(-time / p.memory))
    drift = best_shape(fits, True, p.largest_bias, p.usual_drift)
    scaled = best_shape(fits, False, p.largest_bias, p.usual_scale)
    # while the rate hardly changes the one looks like the other; a bias that drifts can be followed
    goes_with_rate = scaled.statistic > max(p.threshold, drift.statistic + p.agreement) and is_motion(scaled)
    if not goes_with_rate and bias.blocks >= _FEWEST_BIASED:
        # a bias may by chance be near twice the reading: it has to be told from that too
        swapped = wrong_sign(fits, p.largest_bias, _SIGN_TOLD * p.threshold, p.agreement)
        if swapped.statistic > 0.0:
            scaled, goes_with_rate = swapped, True
    shape = scaled if goes_with_rate else drift
    shaped = shape.statistic > p.threshold
    contradicted = bias.nis > p.largest_nis or goes_with_rate or not _is_bias(bias, p.largest_error)
    now = Opinion(
        opinion.mode,
        bias,
        max(opinion.drift, abs(shape.value)) if shaped and shape.drifts else opinion.drift,
        fit_time,
        opinion.trial + time,
        opinion.trial_failed or contradicted,
        shape if shaped and not shape.drifts else opinion.claim,
        opinion.trial_time,
    )
    if shaped and (misfits or opinion.mode != GYRO_TRUSTED):
        if goes_with_rate and opinion.mode != GYRO_LEFT:
            # a bias that seemed to be one was not
            release_all(verdicts)
        _accuse(verdicts[shape.axis], kind_of(shape), evidence, shape.statistic, p.threshold, step)
    if opinion.mode == GYRO_LEFT:
        return _try_again(p, now, fits, verdicts, shaped, evidence, step)
    if contradicted:
        if opinion.mode == GYRO_TRUSTED and not misfits:
            # what was learnt while the Sun was found is no evidence
            return anew(p, fits, GYRO_TRUSTED, NO_SHAPE, now.trial_time)
        if not shaped:
            axis = _worst_axis(p, bias)
            _accuse(verdicts[axis], KIND_UNKNOWN, evidence, bias.nis, p.largest_nis, step)
        return leave(p, now, fits, now.claim)
    return _go_on(p, now, fits, verdicts, shaped, misfits, evidence, step)


@kernel
def _try_again(
    p: GyroHealthParameters, now: Opinion, fits, verdicts, shaped: bool, evidence: int, step: int
) -> Opinion:
    """The opinion of a gyro that was left, in the course of a trial."""
    if now.trial < now.trial_time:
        return now
    if now.trial_failed:
        return anew(p, fits, GYRO_LEFT, now.claim, now.trial_time)
    # an error that goes with the rate hides while the body rests
    claimed = now.claim.statistic > 0.0
    if now.bias.blocks < _FEWEST_BLOCKS or (
        claimed and not refutes(fits, now.claim, p.largest_bias, p.usual_scale, p.agreement)
    ):
        return now
    release_all(verdicts)
    if shaped or significance(now.bias, p.usual_bias) > p.threshold:
        _accuse_biased(p, verdicts, now.bias, KIND_DRIFTING if shaped else KIND_BIAS, evidence, step)
        return Opinion(GYRO_CORRECTED, now.bias, now.drift, now.fit_time, 0.0, False, NO_SHAPE, now.trial_time)
    return Opinion(GYRO_TRUSTED, now.bias, 0.0, now.fit_time, 0.0, False, NO_SHAPE, now.trial_time)


@kernel
def _go_on(
    p: GyroHealthParameters, now: Opinion, fits, verdicts, shaped: bool, misfits: bool, evidence: int, step: int
) -> Opinion:
    """The opinion of a gyro whose error is that of a bias at most."""
    beyond = significance(now.bias, p.usual_bias)
    biased = beyond > p.threshold and now.bias.blocks >= _FEWEST_BIASED and now.bias.nis < _CONSISTENT
    if now.mode == GYRO_TRUSTED:
        wrong = misfits and (shaped or biased)
        if wrong:
            _accuse_biased(p, verdicts, now.bias, KIND_DRIFTING if shaped else KIND_BIAS, evidence, step)
        mode = GYRO_CORRECTED if wrong else GYRO_TRUSTED
        return Opinion(mode, now.bias, now.drift, now.fit_time, 0.0, False, NO_SHAPE, now.trial_time)
    if beyond > p.agreement:
        _review_biased(p, verdicts, now.bias, evidence, step)
        return Opinion(GYRO_CORRECTED, now.bias, now.drift, now.fit_time, 0.0, False, NO_SHAPE, now.trial_time)
    if now.trial < max(p.return_time, now.trial_time):
        return now
    release_all(verdicts)
    return Opinion(GYRO_TRUSTED, now.bias, 0.0, now.fit_time, 0.0, False, NO_SHAPE, now.trial_time)


@kernel
def heed_jumps(p: GyroHealthParameters, opinion: Opinion, axes, fits, verdicts, evidence: int, step: int) -> Opinion:
    """The opinion after axes have jumped by what no body can: their error has changed by so much."""
    if opinion.mode == GYRO_LEFT:
        return anew(p, fits, GYRO_LEFT, opinion.claim, opinion.trial_time)
    gate = p.checks.gate
    for i in range(3):
        before = axes[i].good - axes[i].jump
        if axes[i].jumped != 0 and abs(before) > gate and abs(axes[i].good + before) < gate:
            _accuse(verdicts[i], KIND_SIGN, evidence, abs(axes[i].jump), gate, step)
            return leave(p, opinion, fits, sign_of_axis(i, gate / abs(before)))
    for i in range(3):
        if axes[i].jumped != 0 and verdicts[i].held == 0:
            hold(verdicts[i], KIND_BIAS, evidence, abs(axes[i].jump), gate, step)
    jump_b = (_jump(axes[0]), _jump(axes[1]), _jump(axes[2]))
    trusted = opinion.mode == GYRO_TRUSTED
    bias = after_jumps(jump_b, p.usual_bias, gate * gate) if trusted else jumped(opinion.bias, jump_b, gate * gate)
    forget_fits(fits)
    return Opinion(GYRO_CORRECTED, bias, opinion.drift, 0.0, 0.0, False, NO_SHAPE, opinion.trial_time)


@kernel
def _jump(axis) -> float:
    return axis.jump if axis.jumped != 0 else 0.0
