# SPDX-License-Identifier: Apache-2.0
"""How attitude and rate of the Sun filter go on from one cycle to the next, by the best source of the rate there is.

RATE_BY_GYRO       the gyro's rate less its bias, which is estimated
RATE_BY_MOMENTUM   angular momentum H in b is conserved but for unknown torques: w = J^-1 (H - h), with the momentum
                   h of the wheels relative to the body by their measured speeds, J with their spin inertia (Schaub &
                   Junkins, section 4.5). H turns with -w and stays what it is in n; so the rate is known in the dark.
RATE_BY_WALK       nothing tells: the rate is that of the last cycle, and wanders. It is the former with J = 1, h = 0.
"""

import math

from css_common.attitude import rotation_vector_to_dcm
from css_common.kernel import kernel
from css_common.matrices import IDENTITY, scaled, skew, sum_of
from css_common.vectors import Mat3, Vec3, add, dot, matmul, multiply, scale, subtract, transpose
from css_environment.gravity_gradient import gravity_gradient_torque
from css_estimation.sun.sun_heading import Aiding
from css_estimation.sun.sun_tracking import is_body_rate
from css_estimation.sun_filter.memory import RATE, THETA, X_RATE, dcm_of, forget, set_dcm, triple
from css_estimation.sun_filter.options import Motion

RATE_BY_GYRO, RATE_BY_MOMENTUM, RATE_BY_WALK = 0, 1, 2

_FASTEST_WHEEL = 1e5  # [rad/s]
# Time [s] for which an error of the rate makes the same gyroscopic torque.
_SAME_TORQUE = 5.0
# Rounding of many turns; keeps the covariance positive.
_TURN_NOISE = 1e-14  # [rad2/s]


@kernel
def gyro_usable(p: Motion, aiding: Aiding) -> bool:
    """True when the gyro may be used and its reading is one."""
    return p.use_gyro and aiding.gyro_valid and is_body_rate(aiding.gyro_b, p.gyro_limit)


@kernel
def wheel_momentum(p: Motion, aiding: Aiding) -> tuple[Vec3, bool]:
    """Momentum of the wheels relative to the body [N m s] in b, and whether it is known."""
    x = y = z = 0.0
    if not p.has_wheels:
        return (x, y, z), True
    if not aiding.wheels_valid or aiding.wheel_speeds.shape[0] != p.wheels.shape[0]:
        return (x, y, z), False
    for i in range(p.wheels.shape[0]):
        speed = aiding.wheel_speeds[i]
        # a NaN compares false
        if not abs(speed) < _FASTEST_WHEEL:
            return (0.0, 0.0, 0.0), False
        x += p.wheels[i].hx * speed
        y += p.wheels[i].hy * speed
        z += p.wheels[i].hz * speed
    return (x, y, z), True


@kernel
def rate_model(p: Motion, gyro_ok: bool, wheels_ok: bool) -> int:
    """The best `RATE_BY_*` of this cycle."""
    if gyro_ok:
        return RATE_BY_GYRO
    return RATE_BY_MOMENTUM if p.knows_momentum and wheels_ok else RATE_BY_WALK


@kernel
def _inertia(p: Motion, model: int) -> tuple[Mat3, Mat3]:
    """Inertia and its inverse of a model."""
    return (p.inertia, p.inverse_inertia) if model == RATE_BY_MOMENTUM else (IDENTITY, IDENTITY)


@kernel
def begin_rate(p: Motion, model: int, omega_bn_b: Vec3, variance: float, wheels_b: Vec3, x, covariance) -> None:
    """States of the rate for a body that turns with `omega_bn_b` [rad/s], known to a variance about each axis."""
    if model == RATE_BY_GYRO:
        x[X_RATE], x[X_RATE + 1], x[X_RATE + 2] = 0.0, 0.0, 0.0
        forget(covariance, RATE, 3, p.gyro_bias)
        return
    forget(covariance, RATE, 3, variance)
    inertia, _ = _inertia(p, model)
    momentum_b = multiply(inertia, omega_bn_b)
    for i in range(3):
        x[X_RATE + i] = momentum_b[i] + (wheels_b[i] if model == RATE_BY_MOMENTUM else 0.0)
        for j in range(3):
            # J P J^T, P = variance
            covariance[RATE + i, RATE + j] = variance * (
                inertia[i][0] * inertia[j][0] + inertia[i][1] * inertia[j][1] + inertia[i][2] * inertia[j][2]
            )


@kernel
def _rate_variance(inverse: Mat3, covariance) -> float:
    """Sum of the variances of the rate [rad2/s2] about three axes, of J^-1 P J^-1."""
    total = 0.0
    for i in range(3):
        row = inverse[i]
        for j in range(3):
            for k in range(3):
                total += row[j] * covariance[RATE + j, RATE + k] * row[k]
    return total


@kernel
def change_rate(p: Motion, before: int, after: int, omega_bn_b: Vec3, wheels_b: Vec3, x, covariance) -> None:
    """Goes over to another source of the rate, with the rate of the last cycle [rad/s].

    What is known of the rate about the worst axis is kept for all; what it has in common with the attitude is dropped.
    """
    variance = 0.0
    if before == RATE_BY_GYRO:
        for i in range(3):
            variance = max(variance, covariance[RATE + i, RATE + i])
        variance += p.gyro_noise
    else:
        _, inverse = _inertia(p, before)
        for i in range(3):
            row = inverse[i]
            total = 0.0
            for j in range(3):
                for k in range(3):
                    total += row[j] * covariance[RATE + j, RATE + k] * row[k]
            variance = max(variance, total)
    begin_rate(p, after, omega_bn_b, variance, wheels_b, x, covariance)


@kernel
def go_on(
    p: Motion, model: int, gyro_b: Vec3, wheels_b: Vec3, r_n: Vec3, dt: float, states: int, x, covariance
) -> Vec3:
    """Attitude, rate and their covariance after `dt` [s]; gives the body rate [rad/s].

    Args:
        r_n: place [m] where gravity turns the body; zeros when it is not known, or the attitude is not.
        states: how many of the states are in use.
    """
    dcm_bn = dcm_of(x)
    if model == RATE_BY_GYRO:
        omega_bn_b = subtract(gyro_b, triple(x, X_RATE))
        turn = rotation_vector_to_dcm(scale(dt, omega_bn_b))
        by_rate, kept = scaled(-dt, transpose(dcm_bn)), IDENTITY
        attitude_noise, rate_noise = p.gyro_noise * dt * dt, 0.0
    else:
        _, inverse = _inertia(p, model)
        wheels_b = wheels_b if model == RATE_BY_MOMENTUM else (0.0, 0.0, 0.0)
        momentum_b = triple(x, X_RATE)
        # the rate in the middle of the step: the momentum as it will have turned by then
        half = rotation_vector_to_dcm(scale(0.5 * dt, multiply(inverse, subtract(momentum_b, wheels_b))))
        omega_bn_b = multiply(inverse, subtract(multiply(half, momentum_b), wheels_b))
        turn = rotation_vector_to_dcm(scale(dt, omega_bn_b))
        # dw = J^-1 dH, and H turns by dw more: d(turn H) = turn (dH + dt [H x] dw)
        gyroscopic = scaled(dt, matmul(skew(momentum_b), inverse))
        kept = matmul(turn, sum_of(IDENTITY, gyroscopic))
        by_rate = scaled(dt, matmul(transpose(dcm_bn), inverse))
        if p.gravity_gradient and model == RATE_BY_MOMENTUM and dot(r_n, r_n) > 0.0:
            momentum_b = add(momentum_b, scale(dt, gravity_gradient_torque(p.inertia, multiply(dcm_bn, r_n))))
        x[X_RATE], x[X_RATE + 1], x[X_RATE + 2] = multiply(turn, momentum_b)
        attitude_noise = 0.0
        rate_noise = p.acceleration * dt
        if model == RATE_BY_MOMENTUM:
            # what is left out of the linear model, dw x J dw: it matters while the rate is little known
            neglected = 0.5 * p.anisotropy * _rate_variance(inverse, covariance)
            rate_noise = (p.torque + neglected * neglected * _SAME_TORQUE) * dt
    set_dcm(x, matmul(turn, dcm_bn))
    for j in range(states):
        rate = covariance[RATE, j], covariance[RATE + 1, j], covariance[RATE + 2, j]
        added, after = multiply(by_rate, rate), multiply(kept, rate)
        for i in range(3):
            covariance[THETA + i, j] += added[i]
            covariance[RATE + i, j] = after[i]
    for j in range(states):
        rate = covariance[j, RATE], covariance[j, RATE + 1], covariance[j, RATE + 2]
        added, after = multiply(by_rate, rate), multiply(kept, rate)
        for i in range(3):
            covariance[j, THETA + i] += added[i]
            covariance[j, RATE + i] = after[i]
    # what rounding has made unequal would grow with every turn that the motion makes of it, and nothing takes it away
    for i in range(RATE + 3):
        for j in range(i):
            covariance[i, j] = covariance[j, i] = 0.5 * (covariance[i, j] + covariance[j, i])
        for j in range(RATE + 3, states):
            covariance[i, j] = covariance[j, i] = 0.5 * (covariance[i, j] + covariance[j, i])
    for i in range(3):
        covariance[THETA + i, THETA + i] += attitude_noise + _TURN_NOISE * dt
        covariance[RATE + i, RATE + i] += rate_noise
    return omega_bn_b


@kernel
def fade(
    first: int, x_first: int, count: int, time: float, variance: float, dt: float, states: int, x, covariance
) -> None:
    """Lets errors that forget themselves within `time` [s] (Gauss-Markov of first order) go on by `dt` [s]."""
    kept = math.exp(-dt / time)
    for b in range(count):
        i = first + b
        x[x_first + b] *= kept
        for j in range(states):
            covariance[i, j] *= kept
            covariance[j, i] *= kept
        covariance[i, i] += variance * (1.0 - kept * kept)
