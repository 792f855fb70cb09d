# SPDX-License-Identifier: Apache-2.0
"""MRP feedback that turns the array normal to the Sun (O'Keefe & Schaub 2013, Eqs. 18-20).

The law in its general form (also Hogan & Schaub 2015, Eq. 13), u_s the motor torques, h_s the wheel momenta:

    Gs u_s = -[I](omega_r' - omega x omega_r) + K sigma_br + P domega + P K_I z
             - ([omega_r x] - [(K_I z) x])([I] omega + Gs h_s) + L

Sun pointing asks for a reference at rest, omega_r = 0, unless the body shall spin about the Sun line, and knows no
external torque L unless it is told. What is left at rest,

    Gs u_s = K sigma_br + P omega + P K_I z + (K_I z) x ([I] omega + Gs h_s),    z = K int(sigma_br) dt +
    [I] omega,

acts on the body with the opposite sign. The minus inside the bracket is the paper's: only with it do the
gyroscopic terms leave the Lyapunov function, whose rate is then -(omega + K_I z)^T P (omega + K_I z). For a reference
that turns, domega = omega - omega_r and z = K int(sigma_br) dt + [I] domega. The law is then that at rest for domega
and the momenta Gs h_s + [I] omega_r, and beside it

    Gs u_s = ... - [I](omega_r' - omega x omega_r) - omega_r x ([I] omega + Gs h_s) + L.
"""

import math
from typing import NamedTuple

from css_common.declared import builder, computed, given, made, table_of
from css_common.kernel import kernel
from css_common.schema import Values, choice, real, reals
from css_common.vectors import Mat3, Vec3, add, cross, dot, mat3, multiply, norm, scale, subtract, unit, vector_of

# Sine of an angle between Sun and array normal at which they no longer span a plane.
_ALIGNED = 1e-6


def _inertia(values: Values) -> Mat3:
    return mat3(values.spacecraft.inertia)


_AXIS = reals(
    "reference.axis",
    (0.0, 0.0, 0.0),
    "-",
    "axis of the body, of any length, to turn to the Sun; zeros: the array normal",
    length=3,
    low=-1.0,
    high=1.0,
    tunable=True,
)
# An axis shorter than this is none.
_NO_AXIS = 1e-6


def _axis(values: Values) -> Vec3:
    x, y, z = values[_AXIS]
    length = math.hypot(x, y, z)
    if length < _NO_AXIS:
        return vector_of(values.spacecraft.array_normal)
    return x / length, y / length, z / length


class PointingParameters(NamedTuple):
    """The law's gains and the body that it turns, the mission's `spacecraft`."""

    k: float = given(real("gains.k", 0.148, "N m", "attitude gain K", low=0.0, tunable=True))
    p: float = given(real("gains.p", 0.9, "N m s", "rate gain P, the same on all axes", low=0.0, tunable=True))
    ki: float = given(real("gains.ki", 1e-4, "1/(kg m^2)", "integral gain K_I", low=0.0, tunable=True))
    integral_limit: float = given(
        real("gains.integral_limit", 10.0, "N m s", "bound on each axis of K int(sigma) dt", low=0.0, tunable=True)
    )
    spin_rate: float = made(  # [rad/s]
        math.radians,
        real(
            "reference.spin_deg_s",
            0.0,
            "deg/s",
            "rate about the direction to the Sun, by the right hand; 0: the reference is at rest",
            low=-60.0,
            high=60.0,
            tunable=True,
        ),
    )
    spin_acceleration: float = made(  # [rad/s^2]
        math.radians,
        real(
            "reference.acceleration_deg_s2",
            0.0,
            "deg/s^2",
            "acceleration of the reference to that rate; 0: it has it at once",
            low=0.0,
            high=60.0,
            tunable=True,
        ),
    )
    known_torque_b: Vec3 = made(  # [N m]
        vector_of,
        reals(
            "reference.known_torque",
            (0.0, 0.0, 0.0),
            "N m",
            "external torque on the body that is known and constant in b",
            length=3,
            tunable=True,
        ),
    )
    inertia_b: Mat3 = computed(_inertia)  # [kg m^2]
    axis_b: Vec3 = computed(_axis, _AXIS)  # unit, is turned to the Sun
    deadband: float = made(  # [rad]
        math.radians,
        real(
            "deadband_deg",
            15.0,
            "deg",
            "no attitude control while the estimated Sun is closer to the array normal",
            low=0.0,
            high=180.0,
            tunable=True,
        ),
    )
    damp_in_deadband: bool = made(
        lambda word: word == "damp",
        choice("deadband_behaviour", "zero", ("zero", "damp"), "torque in the deadband: none, or rate damping alone"),
    )


PARAMETERS = table_of(PointingParameters)
parameters = builder(PointingParameters)


class Reference(NamedTuple):
    """What the body shall follow beside the Sun."""

    omega_rn_b: Vec3  # [rad/s]
    acceleration_b: Vec3  # [rad/s^2] derivative of omega_rn in inertial space, in b
    known_torque_b: Vec3  # [N m] external torque on the body
    at_rest: bool  # all of them are zero


@kernel
def error_mrp(sun_b: Vec3, array_normal_b: Vec3) -> tuple[Vec3, float]:
    """Attitude error sigma_br of Eq. 20 and the angle [rad] from array normal to Sun, both unit vectors in b.

    The reference frame r is the body turned the short way until the array normal lies on the Sun, so
    sigma_br points along sun_b x array_normal_b. With c2 the cosine of the half angle, Eq. 20 is (sun_b x
    array_normal_b) / (2 c2 (1 + c2)): no singularity at alignment. Opposite vectors leave the axis open; it
    is then taken normal to the array normal and the x axis, or the y axis if that lies along the array
    normal.
    """
    axis = cross(sun_b, array_normal_b)
    sine = norm(axis)
    cosine = dot(sun_b, array_normal_b)
    angle = math.atan2(sine, cosine)
    if cosine < 0.0 and sine < _ALIGNED:
        axis = cross(array_normal_b, (1.0, 0.0, 0.0))
        if norm(axis) < _ALIGNED:
            axis = cross(array_normal_b, (0.0, 1.0, 0.0))
        return scale(math.tan(0.25 * angle), unit(axis)), angle
    c2 = math.cos(0.5 * angle)
    return scale(0.5 / (c2 * (1.0 + c2)), axis), angle


@kernel
def pointing_torque(
    p: PointingParameters, sigma_br: Vec3, omega_bn_b: Vec3, integral: Vec3, wheel_momentum_b: Vec3
) -> tuple[Vec3, Vec3]:
    """Torque on the body [N m] that the wheels are to give, and z [N m s].

    Args:
        sigma_br: attitude error.
        omega_bn_b: body rate [rad/s].
        integral: K int(sigma_br) dt [N m s].
        wheel_momentum_b: Gs h_s [N m s].
    """
    body_momentum = multiply(p.inertia_b, omega_bn_b)
    z = add(integral, body_momentum)
    kz = scale(p.ki, z)
    gyroscopic = cross(kz, add(body_momentum, wheel_momentum_b))
    return (
        -(p.k * sigma_br[0] + p.p * (omega_bn_b[0] + kz[0]) + gyroscopic[0]),
        -(p.k * sigma_br[1] + p.p * (omega_bn_b[1] + kz[1]) + gyroscopic[1]),
        -(p.k * sigma_br[2] + p.p * (omega_bn_b[2] + kz[2]) + gyroscopic[2]),
    ), z


@kernel
def spin_reference(p: PointingParameters, sun_b: Vec3, spin: float, dt: float) -> tuple[Reference, float]:
    """Reference that spins about the Sun line, and its rate [rad/s] after `dt` [s] that began with `spin`."""
    change = p.spin_rate - spin
    acceleration = 0.0
    if p.spin_acceleration > 0.0 and dt > 0.0:
        most = p.spin_acceleration * dt
        change = min(max(change, -most), most)
        acceleration = change / dt
    spin += change
    t = p.known_torque_b
    at_rest = spin == 0.0 and acceleration == 0.0 and t[0] == 0.0 and t[1] == 0.0 and t[2] == 0.0
    return Reference(scale(spin, sun_b), scale(acceleration, sun_b), t, at_rest), spin


@kernel
def tracking_torque(
    p: PointingParameters, sigma_br: Vec3, omega_bn_b: Vec3, integral: Vec3, wheel_momentum_b: Vec3, r: Reference
) -> tuple[Vec3, Vec3]:
    """As `pointing_torque`, for a reference that turns and an external torque that is known."""
    if r.at_rest:
        return pointing_torque(p, sigma_br, omega_bn_b, integral, wheel_momentum_b)
    relative_b = subtract(omega_bn_b, r.omega_rn_b)
    momentum_b = add(wheel_momentum_b, multiply(p.inertia_b, r.omega_rn_b))
    torque_b, z = pointing_torque(p, sigma_br, relative_b, integral, momentum_b)
    turning_b = subtract(r.acceleration_b, cross(omega_bn_b, r.omega_rn_b))
    gyroscopic = cross(r.omega_rn_b, add(multiply(p.inertia_b, omega_bn_b), wheel_momentum_b))
    forward_b = subtract(add(multiply(p.inertia_b, turning_b), gyroscopic), r.known_torque_b)
    return add(torque_b, forward_b), z


@kernel
def damping_torque(p: PointingParameters, omega_bn_b: Vec3, omega_rn_b: Vec3) -> Vec3:
    """Torque on the body [N m] that brings its rate to `omega_rn_b` [rad/s], without regard to attitude."""
    return (
        -p.p * (omega_bn_b[0] - omega_rn_b[0]),
        -p.p * (omega_bn_b[1] - omega_rn_b[1]),
        -p.p * (omega_bn_b[2] - omega_rn_b[2]),
    )


@kernel
def integrate_error(p: PointingParameters, integral: Vec3, sigma_br: Vec3, dt: float) -> Vec3:
    """K int(sigma_br) dt [N m s] after `dt` [s] more, bounded on each axis."""
    k = p.k * dt
    limit = p.integral_limit
    return (
        min(max(integral[0] + k * sigma_br[0], -limit), limit),
        min(max(integral[1] + k * sigma_br[1], -limit), limit),
        min(max(integral[2] + k * sigma_br[2], -limit), limit),
    )
