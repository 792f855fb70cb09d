# SPDX-License-Identifier: Apache-2.0
"""Who errs where speed and command contradict each other, a wheel or its tachometer, and what then is done."""

from css_common.health import (
    EVIDENCE_NOISE,
    EVIDENCE_RANGE,
    EVIDENCE_RESIDUAL,
    EVIDENCE_RESPONSE,
    KIND_BIAS,
    KIND_DEAD,
    KIND_FROZEN,
    KIND_INTERMITTENT,
    KIND_NOISY,
    KIND_SATURATED,
    KIND_SLOW,
    KIND_SPIKES,
    KIND_STUCK,
    KIND_UNKNOWN,
    hold,
    release,
    rename,
)
from css_common.kernel import kernel
from sunpoint_control.health_parameters import HealthParameters, beyond_noise
from sunpoint_control.wheel_naming import kind_of_tachometer, kind_of_wheel, line_of
from sunpoint_control.wheel_tracks import HEALTHY, ISOLATED, MENDED, UNREAD, clear_sums
from sunpoint_control.wheel_trials import ODDS, own_momentum, try_wheel

_CONFIRM = 2.0  # windows
_LEAPS = 3.0  # jumps of late that make a tachometer noisy
_FORGET = 0.98  # share of what was of late that is left after a window
_ROUGH = 2.0  # of the variance of noise: a hundred cycles make it 8 deviations
_ROUGH_WINDOWS = 10  # until it shows whether noise goes back in the next cycle
_MOST_ODDS = 50.0
_HYSTERESIS = 0.8  # of a tolerance, in trials
_IDLE = 0.1  # of the ordinary friction, where it does not act as friction would
_AT_LIMIT = 0.98  # of the largest speed
_ALIKE = 0.2  # relative error of a reading that is believed again


@kernel
def judge_wheel(
    p: HealthParameters,
    verdicts,
    i: int,
    n: int,
    t,
    time: float,
    cycle: int,
    by_body: float,
    weight: float,
    noise: float,
) -> None:
    """Judges wheel `i` of `n` by a window of its TRACK."""
    expected = t.expected
    contradiction = t.moment - expected
    still = abs(t.speed) <= p.sigma * p.speed_noise
    as_friction = still or contradiction * t.speed < 0.0
    friction = p.friction * t.max_torque * time * (1.0 if as_friction else _IDLE)
    tolerance = beyond_noise(p, t.inertia) + p.torque_error * t.effort + friction
    at_limit = abs(t.speed) >= _AT_LIMIT * t.max_speed > 0.0 and expected * t.speed > 0.0
    contradicts = abs(contradiction) > tolerance and not at_limit
    agrees = not contradicts and abs(expected) > 2.0 * tolerance
    beside_noise = abs(contradiction) > beyond_noise(p, t.inertia)
    if t.phase == 0:
        t.drag = contradiction / time if beside_noise else 0.0
    wheel, tachometer = verdicts[i], verdicts[n + i]

    # r of readings with white noise is a difference of two, its change one of three: 1 + 4 + 1 variances
    roughness = t.variation / (6.0 * noise * noise)
    rough = roughness > _ROUGH
    t.jumps = t.jumps * _FORGET + t.leaps
    t.zeros *= _FORGET

    if t.state == UNREAD:
        _look_at_reading(p, tachometer, t, time, expected, contradiction, contradicts or rough, noise)
        return
    if t.jumps >= _LEAPS:
        kind = KIND_INTERMITTENT if t.zeros > 0.4 * t.jumps else (KIND_NOISY if rough else KIND_SPIKES)
        _leave_unread(tachometer, wheel, t, kind, EVIDENCE_NOISE, t.jumps, _LEAPS, cycle - t.steps)
        return
    if t.state == ISOLATED:
        if beside_noise:
            more = weight * (by_body * contradiction - 0.5 * contradiction * contradiction)
            t.odds = min(max(t.odds + more, -_MOST_ODDS), _MOST_ODDS)
        fails = abs(contradiction) > _HYSTERESIS * tolerance or rough
        try_wheel(p, wheel, t, time, fails, abs(expected) > tolerance, rough, noise)
        if t.phase == 0 and t.odds >= ODDS:
            # it was the tachometer after all
            kind = kind_of_tachometer(t, line_of(t, noise), p.torque_error)
            _leave_unread(tachometer, wheel, t, kind, EVIDENCE_RESIDUAL, t.odds, ODDS, wheel.since_step)
        return
    t.rough = t.rough + 1 if rough else 0
    if t.score < _CONFIRM and (t.rough >= _ROUGH_WINDOWS or (rough and t.jumps > 0.5)):
        # noise of readings goes back in the next cycle, that of a torque does not
        if t.product < -0.25 * t.square or t.jumps > 0.5:
            _leave_unread(tachometer, wheel, t, KIND_NOISY, EVIDENCE_NOISE, roughness, _ROUGH, cycle - t.steps)
        else:
            _isolate(p, wheel, t, KIND_NOISY, EVIDENCE_NOISE, roughness, _ROUGH, cycle - t.steps)
        return
    _look_for_offset(p, tachometer, wheel, t, cycle, noise)
    if t.state == UNREAD:
        return
    if contradicts:
        if t.score == 0.0:
            t.since = cycle - t.steps
        t.score += 1.0
        t.beyond, t.bound = abs(contradiction), tolerance
        t.odds += weight * (by_body * contradiction - 0.5 * contradiction * contradiction)
    else:
        t.score = t.score - 1.0 if agrees else t.score * _FORGET
    if t.score < 0.5:
        t.score = 0.0
        t.odds = 0.0
        clear_sums(t)
        return
    waited = (cycle - t.since) * time / max(t.steps, 1)
    if t.score < _CONFIRM or (weight > 0.0 and abs(t.odds) < ODDS and waited < p.patience):
        return
    line = line_of(t, noise)
    if t.odds >= ODDS or (weight == 0.0 and t.offset != 0.0):
        kind = kind_of_tachometer(t, line, p.torque_error)
        _leave_unread(tachometer, wheel, t, kind, EVIDENCE_RESIDUAL, t.odds, ODDS, t.since)
        return
    kind = kind_of_wheel(line, own_momentum(p, time, t), p.torque_error, t.speed)
    kind = KIND_UNKNOWN if kind < 0 else kind
    _isolate(p, wheel, t, kind, EVIDENCE_RESPONSE, t.beyond, t.bound, t.since)


@kernel
def _isolate(p, verdict, t, kind: int, evidence: int, statistic: float, threshold: float, since: int) -> None:
    """Leaves a wheel out, to be tried at once."""
    if t.returns > 0:
        # one that is limited in speed fails whenever it comes to its limit
        kind = KIND_SLOW if t.known == KIND_SLOW else KIND_INTERMITTENT
    hold(verdict, kind, evidence, statistic, threshold, since)
    t.pause = max(t.pause, p.pause)
    t.state = ISOLATED
    t.gain = 1.0
    t.score = t.odds = t.wait = 0.0
    t.phase = t.passed = t.outward = 0
    t.shown = -1
    clear_sums(t)


@kernel
def _leave_unread(
    tachometer, wheel, t, kind: int, evidence: int, statistic: float, threshold: float, since: int
) -> None:
    """Believes a tachometer no more: the wheel is used, and its speed counted from what it is commanded."""
    if wheel.held != 0 and t.state != MENDED:
        release(wheel)
    hold(tachometer, kind, evidence, statistic, threshold, since)
    t.state = UNREAD
    t.score = t.odds = t.wait = t.jumps = 0.0
    t.phase = 0
    clear_sums(t)


@kernel
def _look_at_reading(
    p, tachometer, t, time: float, expected: float, contradiction: float, wrong: bool, noise: float
) -> None:
    """Believes a tachometer again that has agreed for long enough while its wheel was turned."""
    biased = tachometer.kind == KIND_BIAS and abs(t.offset) > _least_offset(p, t)
    least = beyond_noise(p, t.inertia)
    if wrong or biased or t.leaps > 0 or abs(contradiction) > 0.5 * least + _ALIKE * abs(expected):
        t.wait = 0.0
        if tachometer.kind == KIND_BIAS and wrong:
            rename(tachometer, kind_of_tachometer(t, line_of(t, noise), p.torque_error))
    elif abs(expected) > 2.0 * least and t.same < t.steps:
        t.wait += time
        if tachometer.kind == KIND_FROZEN and abs(t.speed) < abs(t.model):
            rename(tachometer, KIND_SATURATED)  # it moves again below what it had stopped at
    if t.wait >= p.agreement:
        release(tachometer)
        t.state = HEALTHY
        t.model = t.speed
        t.score = t.odds = t.wait = t.offset = t.jumps = 0.0
        t.dwell = 0
        clear_sums(t)


@kernel
def _least_offset(p: HealthParameters, t) -> float:
    return 2.0 * beyond_noise(p, t.inertia)


@kernel
def _look_for_offset(p, tachometer, wheel, t, cycle: int, noise: float) -> None:
    """Finds a reading that has jumped and stays beside what it was."""
    if abs(t.offset) <= _least_offset(p, t):
        t.offset = 0.0
        t.dwell = 0
        return
    t.dwell += 1
    if t.dwell > p.patience / p.window and t.score == 0.0:
        kind = KIND_BIAS if t.same < t.dwell * t.steps // 2 else (KIND_DEAD if t.speed == 0.0 else KIND_STUCK)
        _leave_unread(
            tachometer,
            wheel,
            t,
            kind,
            EVIDENCE_RANGE,
            abs(t.offset),
            _least_offset(p, t),
            cycle - t.dwell * t.steps,
        )
