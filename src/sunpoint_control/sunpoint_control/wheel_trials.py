# SPDX-License-Identifier: Apache-2.0
"""Trials of wheels that are left out: what they answer to a torque outward and one inward, a window each.

Nothing of it is left in the body. A wheel that is limited in speed fails outward alone; what comes and goes is there
in one trial and not in another.
"""

from css_common.health import (
    KIND_DEAD,
    KIND_FRICTION,
    KIND_INTERMITTENT,
    KIND_NOISY,
    KIND_SCALED,
    KIND_SIGN,
    KIND_SLOW,
    KIND_STUCK,
    KIND_UNKNOWN,
    release,
    rename,
)
from css_common.kernel import kernel
from sunpoint_control.health_parameters import HealthParameters, beyond_noise
from sunpoint_control.wheel_naming import kind_of_wheel, line_of
from sunpoint_control.wheel_tracks import HEALTHY, ISOLATED, MENDED, ControlMemory, clear_sums

FOLLOWED, HALTED = 1, 2
"""What a wheel did outward, where it did not fail in another way."""

ODDS = 7.0
"""Of the logarithm of odds: a thousand to one."""

_HALT = 0.1  # of a trial outward: less than that is a wheel that turns no faster
_PUSH = 1.25  # of what a failure needs to be seen
_MOST_PAUSES = 16.0
_SOON = 5.0  # [s] to the next trial after one that was passed
_LEAST_GAIN, _MOST_GAIN = 0.25, 4.0


@kernel
def own_momentum(p: HealthParameters, time: float, t) -> float:
    """Momentum [N m s] that friction, or a torque of its own, gives in a cycle if it is worth a name."""
    return 0.5 * p.friction * t.max_torque * time / max(t.steps, 1)


@kernel
def try_wheel(
    p: HealthParameters, verdict, t, time: float, contradicts: bool, pushed: bool, rough: bool, noise: float
) -> None:
    """Goes on with the trials of a wheel that is left out."""
    if t.phase != 0 and not pushed:
        # not commanded as it should have been: in safe mode
        t.phase = 0
        t.wait = _SOON
        return
    if t.phase == 1:
        t.outward = FOLLOWED
        if contradicts:
            t.outward = HALTED if abs(t.moment) < _HALT * abs(t.expected) else 0
        t.phase = 2
        return
    if t.phase == 2:
        t.phase = 0
        _conclude(p, verdict, t, time, contradicts, rough, noise)
        return
    t.wait -= time
    if t.wait <= 0.0:
        t.phase = 1
        # no more than shows a failure: a wheel that gives a multiple must have room for it
        most = _PUSH * (beyond_noise(p, t.inertia) / time + p.friction * t.max_torque)
        size = min(most / (1.0 - p.torque_error), t.max_torque)
        t.push = size if t.speed >= 0.0 else -size
        clear_sums(t)


@kernel
def _conclude(p: HealthParameters, verdict, t, time: float, contradicts: bool, rough: bool, noise: float) -> None:
    """What a trial has shown."""
    if t.outward == FOLLOWED and not contradicts:
        t.passed += 1
        t.wait = _SOON
        if t.passed >= p.returns:
            verdict_kind = verdict.kind
            release(verdict)
            t.state = HEALTHY
            t.gain = 1.0
            t.returns += 1
            t.known = verdict_kind
            clear_sums(t)
        return
    line = line_of(t, noise)
    kind = kind_of_wheel(line, own_momentum(p, time, t), p.torque_error, t.speed)
    if t.outward == HALTED and not contradicts and abs(t.speed) > p.sigma * p.speed_noise:
        kind = KIND_SLOW
    if rough:
        kind = KIND_NOISY
    elif t.passed > 0 or (t.shown >= 0 and kind >= 0 and kind != t.shown):
        kind = KIND_INTERMITTENT  # now so, now so
    t.passed = 0
    # friction, or its largest speed, may hold a wheel still
    held = kind in (KIND_DEAD, KIND_SLOW, KIND_INTERMITTENT, KIND_UNKNOWN)
    keeps = verdict.kind == KIND_NOISY or (verdict.kind == KIND_INTERMITTENT and kind != KIND_NOISY)
    keeps = keeps or (verdict.kind in (KIND_FRICTION, KIND_STUCK) and held)
    if kind >= 0 and kind != KIND_UNKNOWN and not keeps:
        t.shown = kind
        if kind != verdict.kind:
            rename(verdict, kind)
    # a gain of a reading alone may be that of the tachometer
    by_body = t.odds <= -ODDS
    if by_body and kind in (KIND_SCALED, KIND_SIGN) and _LEAST_GAIN <= abs(line.gain) <= _MOST_GAIN:
        t.state = MENDED
        t.gain = line.gain
        t.score = t.odds = 0.0
        clear_sums(t)
        return
    t.wait = t.pause
    t.pause = min(2.0 * t.pause, _MOST_PAUSES * p.pause)


@kernel
def add_trials(memory: ControlMemory, torques) -> None:
    """Writes the motor torques [N m] of wheels that are tried."""
    for i in range(memory.tracks.shape[0]):
        t = memory.tracks[i]
        if t.state == ISOLATED and t.phase != 0:
            torques[i] = t.push if t.phase == 1 else -t.push
