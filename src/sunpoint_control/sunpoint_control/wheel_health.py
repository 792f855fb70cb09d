# SPDX-License-Identifier: Apache-2.0
"""Wheels and tachometers that fail: found by what speeds answer to commands, told apart by what the body does.

Cycles are judged in windows of `health.window`. In each, with the impulse U = sum u dt and the momentum H that the
tachometer reports, R = H - c U is a contradiction when it is beyond

    sqrt(2) k sigma_h + e sum |u| dt + f T,

noise of two readings, ordinary error of a torque and ordinary friction; friction counts whole only where it would act
that way. Windows in which next to nothing was commanded say nothing: a wheel that rests is not judged. Two windows
more that contradict than agree are needed, and then who errs: if the tachometer, the body was turned by U, if the
wheel, by H. With I, the rate omega of the gyro and all other wheels, the momentum that turns with the body says

    E = I (omega - omega before) + sum omega x (I omega + h) dt - rods + sum g H,    E . g = R or 0,

with the noise of the rate, so that each window adds (E . g R - R^2 / 2) / sigma^2 to the logarithm of the odds.
Without gyro, or when the odds do not decide within `health.patience`, the wheel is left out: it is the safer of the
two errors. A reading that jumps by more than a motor can turn is the tachometer's in any case.

A wheel that is left out is tried: once outward, once inward, a window each, so that nothing is left of it in the
body. What it answered names what it does. One that gives a known multiple of what it is commanded, its sign swapped
or not, is commanded accordingly and goes on being judged at every cycle. Others are tried again, after twice as long
each time, and used again after `health.returns` trials that were passed.
"""

import math

from css_common.kernel import kernel
from css_common.vectors import Vec3, add, dot, multiply, norm, scale, subtract
from sunpoint_control.health_parameters import HealthParameters, beyond_noise, reading_noise
from sunpoint_control.wheel_allocation import spin_axis, wheel_momentum
from sunpoint_control.wheel_judgement import judge_wheel
from sunpoint_control.wheel_tracks import (
    HEALTHY,
    ISOLATED,
    UNREAD,
    ControlMemory,
    begin_body_window,
    clear_window,
    follow_body,
    follow_wheel,
)
from sunpoint_control.wheel_trials import ODDS

_GAP = 1.5  # of the cycle before
_LEAST_CYCLES = 5.0  # in a window


@kernel
def begin_health(memory: ControlMemory, speeds) -> None:
    """Begins to listen with a reading of speeds (n,) [rad/s]: before it nothing is known of the wheels' motion."""
    for i in range(memory.tracks.shape[0]):
        t = memory.tracks[i]
        t.speed = speeds[i]
        if t.state != UNREAD:
            t.model = speeds[i]
        t.last = 0.0
        clear_window(t)
    memory.body[0].running = 1


@kernel
def follow_health(
    p: HealthParameters,
    wheels,
    memory: ControlMemory,
    dt: float,
    speeds,
    omega_bn_b: Vec3,
    rated: bool,
) -> None:
    """Takes in a control cycle, and judges when a window ends.

    Args:
        wheels: (n,) of `wheel_allocation.WHEEL`.
        speeds: (n,) reported [rad/s].
        omega_bn_b: body rate [rad/s].
        rated: it comes from a gyro.
    """
    b = memory.body[0]
    b.cycle += 1
    before: Vec3 = (b.wx, b.wy, b.wz)
    b.wx, b.wy, b.wz = omega_bn_b
    # after a gap nobody knows what the wheels were commanded in it
    gap = dt > _GAP * b.dt
    b.dt = dt
    if b.running == 0 or gap or not dt > 0.0:
        begin_health(memory, speeds)
        begin_body_window(b, _before_low_pass(p, before, omega_bn_b, dt), rated)
        return
    wheels_b = wheel_momentum(wheels, memory.speeds, omega_bn_b)
    follow_body(b, omega_bn_b, add(multiply(p.inertia_b, omega_bn_b), wheels_b), dt)
    if not rated:
        b.rated = 0
    for i in range(speeds.shape[0]):
        t, wheel = memory.tracks[i], wheels[i]
        t.inertia, t.max_torque, t.max_speed = wheel.inertia, wheel.max_torque, wheel.max_speed
        leap = 2.0 * t.max_torque * dt + beyond_noise(p, t.inertia)
        follow_wheel(t, t.inertia, speeds[i], dt, t.max_torque * dt, leap)
    if b.time >= max(p.window, _LEAST_CYCLES * dt) * (1.0 - 1e-9):
        raw = _before_low_pass(p, before, omega_bn_b, dt)
        _judge_all(p, wheels, memory, raw)
        begin_body_window(b, raw, rated)


@kernel
def _before_low_pass(p: HealthParameters, before_b: Vec3, omega_bn_b: Vec3, dt: float) -> Vec3:
    """The rate [rad/s] that a low-pass took in between two that it gave."""
    if p.rate_cutoff <= 0.0 or dt <= 0.0:
        return omega_bn_b
    share = -math.expm1(-2.0 * math.pi * p.rate_cutoff * dt)
    return add(before_b, scale(1.0 / share, subtract(omega_bn_b, before_b)))


@kernel
def _judge_all(p: HealthParameters, wheels, memory: ControlMemory, omega_bn_b: Vec3) -> None:
    b = memory.body[0]
    n = memory.tracks.shape[0]
    turned = multiply(p.inertia_b, subtract(omega_bn_b, (b.bx, b.by, b.bz)))
    rest = add(turned, (b.lx, b.ly, b.lz))
    for i in range(n):
        t = memory.tracks[i]
        rest = add(rest, scale(t.expected if t.state == UNREAD else t.moment, spin_axis(wheels[i])))
    for i in range(n):
        wheel = wheels[i]
        t = memory.tracks[i]
        if wheel.mx != 0.0 or wheel.my != 0.0 or wheel.mz != 0.0:
            g = spin_axis(wheel)
            sigma = norm(multiply(p.inertia_b, g)) * p.rate_noise
            variance = 2.0 * sigma * sigma + (p.torque_error * norm(turned)) ** 2
            weight = 1.0 / variance if b.rated != 0 else 0.0
            noise = reading_noise(p, t.inertia)
            judge_wheel(p, memory.verdicts, i, n, t, b.time, b.cycle, dot(rest, g), weight, noise)
        clear_window(t)


@kernel
def out_of_use(memory: ControlMemory) -> int:
    """Mask of the wheels that are commanded nothing."""
    mask = 0
    for i in range(memory.tracks.shape[0]):
        if memory.tracks[i].state == ISOLATED:
            mask |= 1 << i
    return mask


@kernel
def all_as_built(memory: ControlMemory) -> bool:
    """Whether no wheel is left out, commanded by another gain or unread."""
    other = 0
    for i in range(memory.tracks.shape[0]):
        other |= memory.tracks[i].state ^ HEALTHY
    return other == 0


@kernel
def speeds_taken(memory: ControlMemory, speeds) -> None:
    """Writes into the memory the speeds (n,) [rad/s] that wheels are taken to turn at."""
    for i in range(speeds.shape[0]):
        t = memory.tracks[i]
        memory.speeds[i] = t.model if t.state == UNREAD else speeds[i]


@kernel
def uncommanded_torque(memory: ControlMemory, wheels) -> Vec3:
    """Torque [N m] on the body by wheels that are left out and turn by themselves, if the body says so too."""
    total: Vec3 = (0.0, 0.0, 0.0)
    for i in range(memory.tracks.shape[0]):
        t = memory.tracks[i]
        if t.state == ISOLATED and t.odds <= -ODDS:
            total = subtract(total, scale(t.drag, spin_axis(wheels[i])))
    return total


@kernel
def note_commands(memory: ControlMemory, torques, rods_b: Vec3) -> None:
    """Takes note of the motor torques (n,) [N m] and of the torque of the rods on the body [N m] of the next cycle."""
    for i in range(torques.shape[0]):
        memory.tracks[i].command = torques[i]
    b = memory.body[0]
    b.tx, b.ty, b.tz = rods_b
