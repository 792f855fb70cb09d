# SPDX-License-Identifier: Apache-2.0
"""Rotation of a rigid body with reaction wheels (Schaub & Junkins, section 4.5; O'Keefe & Schaub 2013).

Equations of motion, with g_i the spin axis of wheel i and h_i = J_i (W_i + g_i.w) its momentum along it:

    [I] w' = -w x ([I] w + sum h_i g_i) - sum (u_i + f_i) g_i + L
    h_i'   = u_i + f_i
    s'     = 1/4 [(1 - s.s) I + 2 [s x] + 2 s s^T] w

W_i is the wheel speed relative to the body, u_i the motor torque on the wheel, f_i
its friction (`wheel_friction`, none unless asked for), L the external torque. [I]
holds the body and the wheels, but not J_i along the spin axes, which is inside h_i.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from css_common import matrices
from css_common.attitude import mrp_rate, mrp_shadow
from css_common.kernel import kernel
from css_common.vectors import Mat3, Vec3, add, cross, dot, mat3, multiply, norm, scale, subtract
from css_sim.wheel_friction import shaft_torque

_RADIANS_PER_RPM = 2.0 * math.pi / 60.0
# Passes of the speed limit: each shrinks the excess by the ratio of wheel to body inertia.
_LIMIT_PASSES = 4

LARGEST_ANGLE = 0.15
"""Angle [rad] that no integration step exceeds: a step of RK4 then errs by 6e-7 rad and 1e-7 of the energy.

It is that of the body's rate, and of the rate at which its wheels' momentum makes it precess. A cycle in which it would
be larger takes as many steps as keep it below.
"""

MOST_STEPS = 100_000
"""Integration steps in one cycle; whatever needs more is no spacecraft any more."""


WHEEL = np.dtype(
    [
        (name, np.float64)
        for name in ("gx", "gy", "gz", "inertia", "max_torque", "max_speed", "coulomb", "viscous", "response")
    ],
    align=True,
)
"""One reaction wheel: unit spin axis in b, spin inertia [kg m2], limits of torque [N m] and speed [rad/s], Coulomb
[N m] and viscous [N m s] friction, and how its speed relative to the body responds to a torque on it [rad/s2/(N m)].
"""


class RigidBody(NamedTuple):
    """Mass properties and wheels."""

    inertia: Mat3  # [kg m2] in b, without the wheels' inertia along their spin axes
    inertia_inverse: Mat3  # [1/(kg m2)]
    wheels: np.ndarray  # (N,) of WHEEL: one array, because each one in a parameter costs time at every call
    substeps: int  # least integration steps per call


class RotationState(NamedTuple):
    """Attitude and rate of the body; the wheel momenta (N,) are an array beside it."""

    sigma_bn: Vec3
    omega_bn_b: Vec3  # [rad/s]


def rigid_body(
    inertia: ArrayLike,
    wheel_axes: ArrayLike = (),
    wheel_inertia: ArrayLike = 0.001,
    wheel_max_torque: ArrayLike = 0.030,
    wheel_max_speed_rpm: ArrayLike = 6000.0,
    substeps: int = 1,
    wheel_friction: tuple[ArrayLike, ArrayLike] = (0.0, 0.0),
) -> RigidBody:
    """Build the parameters of `propagate`.

    Args:
        inertia: nine elements, row-major [kg m2].
        wheel_axes: spin axes one after the other, any length [-]; empty for no wheels.
        wheel_inertia: about the spin axis, one value or one per wheel [kg m2].
        wheel_max_torque: one value or one per wheel [N m].
        wheel_max_speed_rpm: one value or one per wheel [rev/min].
        substeps: least integration steps per call of `propagate`.
        wheel_friction: Coulomb [N m] and viscous [N m s], each one value or one per wheel.
    """
    matrix = np.asarray(inertia, dtype=np.float64).reshape(3, 3)
    axes = np.asarray(wheel_axes, dtype=np.float64).reshape(-1, 3)
    wheels = np.zeros(len(axes), WHEEL)
    wheels["gx"], wheels["gy"], wheels["gz"] = (axes / np.linalg.norm(axes, axis=1, keepdims=True)).T
    wheels["inertia"] = wheel_inertia
    wheels["max_torque"] = wheel_max_torque
    wheels["max_speed"] = np.asarray(wheel_max_speed_rpm) * _RADIANS_PER_RPM
    inverse = matrices.inverse(mat3(matrix))
    unit_axes = np.column_stack([wheels["gx"], wheels["gy"], wheels["gz"]])
    wheels["coulomb"], wheels["viscous"] = wheel_friction
    wheels["response"] = 1.0 / wheels["inertia"] + np.einsum("ij,jk,ik->i", unit_axes, np.array(inverse), unit_axes)
    return RigidBody(mat3(matrix), inverse, wheels, int(substeps))


@kernel
def angular_acceleration(
    inertia: Mat3, inertia_inverse: Mat3, omega_bn_b: Vec3, wheel_momentum_b: Vec3, torque_b: Vec3
) -> Vec3:
    """Body rate derivative [rad/s2]; `torque_b` [N m] is the external torque less the motor torques."""
    momentum_b = add(multiply(inertia, omega_bn_b), wheel_momentum_b)
    return multiply(inertia_inverse, subtract(torque_b, cross(omega_bn_b, momentum_b)))


@kernel
def _runge_kutta(inertia, inverse, sigma, omega, h0_b, motor_b, torque_b, dt) -> tuple[Vec3, Vec3]:
    """One RK4 step; the sum of wheel momenta grows linearly from `h0_b` because the motor torque is held."""
    half = 0.5 * dt
    h_half = add(h0_b, scale(half, motor_b))
    h_full = add(h0_b, scale(dt, motor_b))

    a1 = angular_acceleration(inertia, inverse, omega, h0_b, torque_b)
    s1 = mrp_rate(sigma, omega)

    w2 = add(omega, scale(half, a1))
    a2 = angular_acceleration(inertia, inverse, w2, h_half, torque_b)
    s2 = mrp_rate(add(sigma, scale(half, s1)), w2)

    w3 = add(omega, scale(half, a2))
    a3 = angular_acceleration(inertia, inverse, w3, h_half, torque_b)
    s3 = mrp_rate(add(sigma, scale(half, s2)), w3)

    w4 = add(omega, scale(dt, a3))
    a4 = angular_acceleration(inertia, inverse, w4, h_full, torque_b)
    s4 = mrp_rate(add(sigma, scale(dt, s3)), w4)

    k = dt / 6.0
    omega = (
        omega[0] + k * (a1[0] + 2.0 * (a2[0] + a3[0]) + a4[0]),
        omega[1] + k * (a1[1] + 2.0 * (a2[1] + a3[1]) + a4[1]),
        omega[2] + k * (a1[2] + 2.0 * (a2[2] + a3[2]) + a4[2]),
    )
    sigma = (
        sigma[0] + k * (s1[0] + 2.0 * (s2[0] + s3[0]) + s4[0]),
        sigma[1] + k * (s1[1] + 2.0 * (s2[1] + s3[1]) + s4[1]),
        sigma[2] + k * (s1[2] + 2.0 * (s2[2] + s3[2]) + s4[2]),
    )
    return mrp_shadow(sigma), omega


@kernel
def sum_along_axes(wheels, components) -> Vec3:
    """Vector sum in b of (N,) components along the spin axes, such as wheel momenta or motor torques."""
    x, y, z = 0.0, 0.0, 0.0
    for i in range(components.shape[0]):
        x += components[i] * wheels[i].gx
        y += components[i] * wheels[i].gy
        z += components[i] * wheels[i].gz
    return (x, y, z)


@kernel
def wheel_speed(wheel, omega_bn_b: Vec3, momentum: float) -> float:
    """Speed [rad/s] relative to the body of a wheel with a momentum [N m s]."""
    return momentum / wheel.inertia - dot((wheel.gx, wheel.gy, wheel.gz), omega_bn_b)


@kernel
def wheel_momentum_at_speed(wheel, omega_bn_b: Vec3, speed: float) -> float:
    """Momentum [N m s] of a wheel that turns at `speed` [rad/s] relative to the body."""
    return wheel.inertia * (speed + dot((wheel.gx, wheel.gy, wheel.gz), omega_bn_b))


@kernel
def wheel_speeds(p: RigidBody, omega_bn_b: Vec3, wheel_momentum, speeds_out) -> None:
    """Speeds of all wheels relative to the body [rad/s], written to `speeds_out`."""
    for i in range(wheel_momentum.shape[0]):
        speeds_out[i] = wheel_speed(p.wheels[i], omega_bn_b, wheel_momentum[i])


@kernel
def _size(v: Vec3) -> float:
    return abs(v[0]) + abs(v[1]) + abs(v[2])


@kernel
def integration_steps(p: RigidBody, omega_bn_b: Vec3, h_b: Vec3, torque_b: Vec3, dt: float) -> int:
    """Steps that `dt` [s] takes, so that none turns the body by more than `LARGEST_ANGLE`.

    Args:
        omega_bn_b: body rate [rad/s].
        h_b: sum of the wheel momenta [N m s].
        torque_b: on the body [N m]; it may speed the body up within `dt`.
    """
    i = p.inertia_inverse
    # a bound without roots, below which nearly every cycle stays: no norm is above a sum of sizes
    rate = _size(omega_bn_b) + (i[0][0] + i[1][1] + i[2][2]) * (_size(h_b) + dt * _size(torque_b))
    if rate * dt <= LARGEST_ANGLE:
        return p.substeps
    rate = norm(omega_bn_b) + norm(multiply(p.inertia_inverse, h_b)) + dt * norm(multiply(p.inertia_inverse, torque_b))
    steps = rate * dt / LARGEST_ANGLE
    if steps <= p.substeps:
        return p.substeps
    return math.ceil(steps) if steps < MOST_STEPS else MOST_STEPS  # what is no number, too


@kernel
def _integrate(p, state, h_b, motor_b, external_torque_b, dt) -> RotationState:
    torque_b = subtract(external_torque_b, motor_b)
    sigma, omega = state.sigma_bn, state.omega_bn_b
    steps = integration_steps(p, omega, h_b, torque_b, dt)
    step = dt / steps
    for _ in range(steps):
        sigma, omega = _runge_kutta(p.inertia, p.inertia_inverse, sigma, omega, h_b, motor_b, torque_b, step)
        h_b = add(h_b, scale(step, motor_b))
    return RotationState(sigma, omega)


@kernel
def _limit_torques(wheels, command, torque_out) -> int:
    """Commands cut to the wheels' torque limits; mask of those cut."""
    mask = 0
    for i in range(command.shape[0]):
        limit = wheels[i].max_torque
        torque = command[i]
        if not abs(torque) <= limit:  # also catches a command that is not a number: no torque
            torque = limit if torque > limit else (-limit if torque < -limit else 0.0)
            mask |= 1 << i
        torque_out[i] = torque
    return mask


@kernel
def _near_speed_limit(wheels, omega, wheel_momentum, torque, dt) -> bool:
    """True when some wheel may pass its limit; cheap, because it bounds g.w instead of computing it."""
    body = abs(omega[0]) + abs(omega[1]) + abs(omega[2])
    for i in range(torque.shape[0]):
        if abs(wheel_momentum[i] + dt * torque[i]) > wheels[i].inertia * (wheels[i].max_speed - body):
            return True
    return False


@kernel
def _on_shaft(wheel, omega_bn_b: Vec3, momentum: float, torque: float, dt: float) -> float:
    """Torque [N m] of motor and friction on a wheel over a step that begins with that body rate and momentum."""
    if wheel.coulomb == 0.0 and wheel.viscous == 0.0:
        return torque
    speed = wheel_speed(wheel, omega_bn_b, momentum)
    return shaft_torque(wheel.coulomb, wheel.viscous, torque, speed, wheel.response, dt)


@kernel
def _on_shafts(wheels, omega_bn_b: Vec3, wheel_momentum, torque, dt: float) -> Vec3:
    """Vector sum in b of `_on_shaft` of all wheels."""
    x, y, z = 0.0, 0.0, 0.0
    for i in range(torque.shape[0]):
        on_shaft = _on_shaft(wheels[i], omega_bn_b, wheel_momentum[i], torque[i], dt)
        x += on_shaft * wheels[i].gx
        y += on_shaft * wheels[i].gy
        z += on_shaft * wheels[i].gz
    return (x, y, z)


@kernel
def _cut_at_speed_limit(p, before, omega, wheel_momentum, torque, dt) -> int:
    """Cut the torque of wheels that pass their speed limit at the end of the step; mask of those wheels."""
    mask = 0
    for i in range(torque.shape[0]):
        wheel = p.wheels[i]
        on_shaft = _on_shaft(wheel, before, wheel_momentum[i], torque[i], dt)
        speed = wheel_speed(wheel, omega, wheel_momentum[i] + dt * on_shaft)
        excess = speed - min(max(speed, -wheel.max_speed), wheel.max_speed)
        # a tolerance of rounding only: a wheel held at its limit must not be cut again and again
        if abs(excess) > 1e-12 * wheel.max_speed:
            axis = (wheel.gx, wheel.gy, wheel.gz)
            gain = dt * (1.0 / wheel.inertia + dot(axis, multiply(p.inertia_inverse, axis)))
            cut = torque[i] - excess / gain
            torque[i] = min(max(cut, -wheel.max_torque), wheel.max_torque)
            mask |= 1 << i
    return mask


@kernel
def propagate(
    p: RigidBody,
    state: RotationState,
    wheel_momentum,
    wheel_command,
    external_torque_b: Vec3,
    dt: float,
    wheel_torque_out,
) -> tuple[RotationState, int, int]:
    """Advance attitude, rate and wheel momenta by `dt` [s] under constant motor and external torques, and friction.

    A command beyond a wheel's torque limit is cut to it. A torque that would carry a wheel past its speed
    limit by the end of the step is cut so that the wheel ends there, as far as the torque limit allows.

    Args:
        wheel_momentum: (N,) [N m s], advanced in place.
        wheel_command: (N,) motor torques asked for [N m].
        external_torque_b: [N m].
        wheel_torque_out: (N,) motor torques applied [N m], written.

    Returns:
        Rotation state (|sigma_bn| <= 1), mask of torque-limited wheels, mask of speed-limited wheels.
    """
    torque_limited = _limit_torques(p.wheels, wheel_command, wheel_torque_out)
    h_b = sum_along_axes(p.wheels, wheel_momentum)
    before = state.omega_bn_b
    motor_b = _on_shafts(p.wheels, before, wheel_momentum, wheel_torque_out, dt)
    end = _integrate(p, state, h_b, motor_b, external_torque_b, dt)
    speed_limited = 0
    if _near_speed_limit(p.wheels, end.omega_bn_b, wheel_momentum, wheel_torque_out, dt):
        for _ in range(_LIMIT_PASSES):
            cut = _cut_at_speed_limit(p, before, end.omega_bn_b, wheel_momentum, wheel_torque_out, dt)
            if cut == 0:
                break
            speed_limited |= cut
            motor_b = _on_shafts(p.wheels, before, wheel_momentum, wheel_torque_out, dt)
            end = _integrate(p, state, h_b, motor_b, external_torque_b, dt)
    for i in range(wheel_momentum.shape[0]):
        wheel_momentum[i] += dt * _on_shaft(p.wheels[i], before, wheel_momentum[i], wheel_torque_out[i], dt)
    return end, torque_limited, speed_limited
