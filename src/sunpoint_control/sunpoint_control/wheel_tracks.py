# SPDX-License-Identifier: Apache-2.0
"""What the judgement of the wheels remembers, and what each control cycle adds to it.

A wheel's momentum about its axis changes by what its motor gives. Over one control cycle, with the inertia Js, the
speed W that the tachometer reports and the torque u that was commanded,

    r = Js (W - W before) - c u dt

is noise for a wheel that does what it is commanded; c is 1, or what a wheel makes of its commands that is known to
give another torque. The turning of the body, Js g . (omega - omega before), is some 1e-4 of that and left out.
"""

from typing import NamedTuple

import numpy as np

from css_common.health import SORT_TACHOMETER, SORT_WHEEL, new_verdicts
from css_common.kernel import kernel
from css_common.vectors import Vec3, cross
from sunpoint_control.wheel_allocation import WHEEL

HEALTHY, ISOLATED, MENDED, UNREAD = range(4)
"""What is done with a wheel: nothing; commanded none; commanded by what it gives; its tachometer is not believed."""

MEMORY = 0.01
"""Share of a cycle in what is of late."""

_FLOATS = (
    "inertia", "max_torque", "max_speed",  # [kg m^2], [N m], [rad/s] of the wheel
    "speed",  # [rad/s] reported last
    "command",  # [N m] of the cycle that ends
    "model",  # [rad/s] what it is taken to turn at
    "gain",  # c
    "expected",  # [N m s] sum of c u dt in the window, each within the largest torque
    "effort",  # [N m s] sum of |u| dt
    "moment",  # [N m s] what the reported speed says of it
    "last",  # [N m s] last r
    "before",  # [N m s] the last u dt
    "variation",  # [(N m s)^2] mean squared change of r of late
    "square",  # [(N m s)^2] mean of r^2
    "product",  # [(N m s)^2] mean of r times the r before it
    "offset",  # [N m s] jumps of the reading that have not gone back
    "jumps",  # jumps of late
    "zeros",  # of them, those to a reading of zero
    "beyond",  # [N m s] the last contradiction
    "bound",  # [N m s] what it was beyond
    "score",  # windows that contradict, less those that agree
    "odds",  # log-likelihood ratio: the tachometer errs, the wheel does
    "wait",  # [s] to the next trial; with a tachometer not believed: for how long it has agreed
    "pause",  # [s] between trials
    "push",  # [N m] of a trial outward
    "drag",  # [N m] what it gave in the last window, uncommanded
    "su", "sh", "suu", "suh", "shh",  # sums over cycles for a line through moment and impulse
)  # fmt: skip
_INTEGERS = (
    "state",  # HEALTHY to UNREAD
    "since",  # cycle of the first contradiction
    "count",  # cycles in the sums
    "phase",  # of a trial: 0 none, 1 outward, 2 inward
    "outward",  # FOLLOWED, HALTED or 0: what it did in the first half of a trial
    "passed",  # trials in a row
    "steps",  # cycles in the window
    "leaps",  # jumps in the window
    "same",  # cycles in a row in which the reading has been the same
    "rough",  # windows in a row that were too rough
    "dwell",  # windows since an offset came
    "returns",  # how often it was used again
    "known",  # KIND_* that it had before it was used again
    "shown",  # KIND_* that a trial has shown, -1: none
)

TRACK = np.dtype([*((n, np.float64) for n in _FLOATS), *((n, np.int64) for n in _INTEGERS)], align=True)
"""Of one wheel."""

_BODY_FLOATS = ("time", "dt", "wx", "wy", "wz", "bx", "by", "bz", "lx", "ly", "lz", "tx", "ty", "tz")
BODY = np.dtype(
    [*((n, np.float64) for n in _BODY_FLOATS), *((n, np.int64) for n in ("cycle", "running", "rated"))], align=True
)
"""Of the body: time [s] of the window and of the last cycle; body rate [rad/s] as it was given last, and free of its
low-pass at the begin of the window; impulse [N m s] that turns the momentum with the body, less that of the rods;
torque [N m] of the rods; number of the cycle; whether a window runs, and whether a gyro was heard all along."""


class ControlMemory(NamedTuple):
    """Arrays that the control changes in place."""

    tracks: np.ndarray  # (n,) of TRACK
    body: np.ndarray  # (1,) of BODY
    verdicts: np.ndarray  # (2 n,) of css_common.health.VERDICT: wheels, then tachometers
    allocation: np.ndarray  # (n,) of WHEEL, as the wheels are used
    speeds: np.ndarray  # (n,) [rad/s] as they are taken to turn


def new_memory(wheels: int) -> ControlMemory:
    """Nothing known of so many wheels."""
    tracks = np.zeros(wheels, TRACK)
    tracks["gain"] = 1.0
    verdicts = [new_verdicts(SORT_WHEEL, wheels), new_verdicts(SORT_TACHOMETER, wheels)]
    return ControlMemory(tracks, np.zeros(1, BODY), np.concatenate(verdicts), np.zeros(wheels, WHEEL), np.zeros(wheels))


@kernel
def clear_sums(t) -> None:
    """Begins the sums over cycles of a TRACK anew."""
    t.su = t.sh = t.suu = t.suh = t.shh = 0.0
    t.count = 0


@kernel
def clear_window(t) -> None:
    """Begins a window of a TRACK."""
    t.expected = t.effort = t.moment = 0.0
    t.steps = t.leaps = 0


@kernel
def follow_wheel(t, inertia: float, speed: float, dt: float, most: float, leap: float) -> None:
    """Adds a control cycle of `dt` [s] that ends with a reported speed [rad/s] to a TRACK.

    Args:
        inertia: of the wheel about its axis [kg m^2].
        most: momentum [N m s] that a motor gives at its largest torque.
        leap: r [N m s] beyond which no motor has turned the wheel.
    """
    u = t.command * dt
    h = inertia * (speed - t.speed)
    expected = min(max(t.gain * u, -most), most)
    r = h - expected
    t.expected += expected
    t.effort += abs(expected)
    if abs(r) > leap:
        t.leaps += 1
        t.zeros += 1.0 if speed == 0.0 or t.speed == 0.0 else 0.0
        t.offset += r
        h -= r
        r = 0.0
    t.same = t.same + 1 if speed == t.speed else 0
    # what has been contradicted, or has jumped, is not followed
    if t.score == 0.0 and t.offset == 0.0 and t.state != UNREAD:
        t.model = speed
    else:
        t.model += expected / inertia
    t.moment += h
    t.square += MEMORY * (r * r - t.square)
    t.product += MEMORY * (r * t.last - t.product)
    # what a wheel makes of a step of its command is no noise
    change = max(abs(r - t.last) - 2.0 * abs(u - t.before), 0.0)
    t.variation += MEMORY * (change * change - t.variation)
    t.last, t.before = r, u
    if t.score > 0.0 or t.state != HEALTHY:
        t.su += u
        t.sh += h
        t.suu += u * u
        t.suh += u * h
        t.shh += h * h
        t.count += 1
    t.steps += 1
    t.speed = speed


@kernel
def follow_body(b, omega_bn_b: Vec3, momentum_b: Vec3, dt: float) -> None:
    """Adds a control cycle of `dt` [s] to BODY.

    Args:
        omega_bn_b: body rate [rad/s].
        momentum_b: of body and wheels [N m s].
    """
    turning = cross(omega_bn_b, momentum_b)
    b.lx += dt * (turning[0] - b.tx)
    b.ly += dt * (turning[1] - b.ty)
    b.lz += dt * (turning[2] - b.tz)
    b.time += dt


@kernel
def begin_body_window(b, omega_bn_b: Vec3, rated: bool) -> None:
    """Begins a window of BODY with a rate [rad/s] that is free of any low-pass."""
    b.time = b.lx = b.ly = b.lz = 0.0
    b.bx, b.by, b.bz = omega_bn_b
    b.rated = 1 if rated else 0
