# SPDX-License-Identifier: Apache-2.0
"""Attitude, rate and wheel speeds at the epoch, and dispersed mass properties, of any case.

O'Keefe & Schaub 2013: attitude uniform over all attitudes, each rate uniform up to 2 deg/s; wheels at rest.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from css_common.actuator_sections import WHEEL_INERTIA, WHEEL_MAX_SPEED, WHEEL_MAX_TORQUE, of_each_wheel, wheel_axes
from css_common.attitude import mrp_shadow, quaternion_to_mrp
from css_common.declared import builder, given, made, table_of
from css_common.kernel import kernel
from css_common.random_streams import RandomKey, Stream, normal4, uniform4
from css_common.schema import Values, choice, real, reals
from css_common.sections import INERTIA
from css_common.vectors import Vec3, vector_of
from css_sim import wheel_friction
from css_sim.disturbances import DIPOLE
from css_sim.rigid_body import RigidBody, RotationState, rigid_body, wheel_momentum_at_speed

_RADIANS_PER_RPM = 2.0 * math.pi / 60.0


def _rates(omega_deg_s: np.ndarray) -> Vec3:
    w1, w2, w3 = (math.radians(w) for w in omega_deg_s)
    return w1, w2, w3


RATE_KIND = choice(
    "initial.rate",
    "random",
    ("random", "direction", "fixed"),
    "uniform per axis, initial.rate_deg_s in a random direction, or initial.omega_deg_s",
)

MAX_RATE = real("initial.max_rate_deg_s", 2.0, "deg/s", "bound of the random rate, per axis", low=0.0, high=3600.0)
RATE = real("initial.rate_deg_s", 2.0, "deg/s", "body rate in a random direction", low=0.0, high=3600.0)
FIXED_RATE = reals("initial.omega_deg_s", (0.0, 0.0, 0.0), "deg/s", "fixed body rate", length=3)


class InitialConditions(NamedTuple):
    """How a case begins."""

    random_attitude: bool = made(
        lambda word: word == "random",
        choice("initial.attitude", "random", ("random", "fixed"), "uniform over all attitudes, or initial.sigma_bn"),
    )
    sigma_bn: Vec3 = made(
        vector_of,
        reals("initial.sigma_bn", (0.0, 0.0, 0.0), "-", "MRP of the fixed attitude, b relative to n", length=3),
    )
    random_rate: bool = made(lambda word: word == "random", RATE_KIND)
    max_rate: float = made(math.radians, MAX_RATE)  # [rad/s]
    random_direction: bool = made(lambda word: word == "direction", RATE_KIND)
    rate: float = made(math.radians, RATE)  # [rad/s]
    omega_bn_b: Vec3 = made(_rates, FIXED_RATE)  # [rad/s]


class Dispersion(NamedTuple):
    """How far mass properties and limits of a case are from those of the mission."""

    inertia: float = given(
        real("dispersion.inertia", 0.0, "-", "1 sigma of each principal moment, relative", low=0.0, high=0.2)
    )
    dipole: float = given(  # [A m^2]
        real(
            "dispersion.dipole",
            0.0,
            "A m^2",
            "1 sigma of the residual dipole about its mean, per axis",
            low=0.0,
            high=100.0,
        )
    )
    wheel_torque: float = given(
        real("dispersion.wheel_torque", 0.0, "-", "1 sigma of each wheel's torque limit, relative", low=0.0, high=0.5)
    )


WHEEL_SPEEDS = reals("initial.wheel_speed_rpm", (), "rpm", "wheel speeds relative to the body; empty: at rest")

PARAMETERS = (*table_of(InitialConditions), WHEEL_SPEEDS, *table_of(Dispersion), *wheel_friction.PARAMETERS)
parameters = builder(InitialConditions)
dispersion = builder(Dispersion)


def conflicts(values: Values) -> Iterator[str]:
    """What is wrong between the values, one message each."""
    speeds, wheels = values[WHEEL_SPEEDS], len(wheel_axes(values))
    if len(speeds) not in ((0, 1, wheels) if wheels else (0,)):
        expected = f"none, 1 or {wheels}" if wheels else "none without wheels"
        yield f"initial.wheel_speed_rpm: {len(speeds)} values given, expected {expected}"
    coulomb = wheel_friction.parameters(values).coulomb
    if wheels and coulomb > 0.0 and coulomb >= np.min(of_each_wheel(values, WHEEL_MAX_TORQUE)):
        yield f"friction.coulomb: {coulomb:g} given, expected less than wheels.max_torque, which would not turn a wheel"
    fastest = np.max(np.abs(speeds), initial=0.0)
    if wheels and len(speeds) in (1, wheels) and np.any(np.abs(speeds) > of_each_wheel(values, WHEEL_MAX_SPEED)):
        yield f"initial.wheel_speed_rpm: {fastest:g} given, expected at most wheels.max_speed_rpm"


@kernel
def random_attitude(key: RandomKey) -> Vec3:
    """MRP of an attitude uniform over all attitudes (Shoemake, Graphics Gems III, 1992)."""
    u = uniform4(key, Stream.INITIAL_ATTITUDE, 0, 0)
    a, b = math.sqrt(1.0 - u[0]), math.sqrt(u[0])
    p, q = 2.0 * math.pi * u[1], 2.0 * math.pi * u[2]
    return quaternion_to_mrp((a * math.sin(p), a * math.cos(p), b * math.sin(q), b * math.cos(q)))


@kernel
def random_rate(key: RandomKey, max_rate: float) -> Vec3:
    """Body rate with each component uniform between -max_rate and max_rate [rad/s]."""
    u = uniform4(key, Stream.INITIAL_RATE, 0, 0)
    return (max_rate * (2.0 * u[0] - 1.0), max_rate * (2.0 * u[1] - 1.0), max_rate * (2.0 * u[2] - 1.0))


@kernel
def random_direction(key: RandomKey, rate: float) -> Vec3:
    """Body rate of a given size [rad/s] in a direction uniform over the sphere."""
    u = uniform4(key, Stream.INITIAL_RATE, 0, 0)
    z, azimuth = 2.0 * u[0] - 1.0, 2.0 * math.pi * u[1]
    across = math.sqrt(1.0 - z * z)
    return (rate * across * math.cos(azimuth), rate * across * math.sin(azimuth), rate * z)


@kernel
def initial_state(p: InitialConditions, key: RandomKey) -> RotationState:
    """Attitude and rate at the epoch of one case."""
    sigma_bn = random_attitude(key) if p.random_attitude else mrp_shadow(p.sigma_bn)
    omega_bn_b = p.omega_bn_b
    if p.random_rate:
        omega_bn_b = random_rate(key, p.max_rate)
    elif p.random_direction:
        omega_bn_b = random_direction(key, p.rate)
    return RotationState(sigma_bn, omega_bn_b)


def initial_wheel_momentum(body: RigidBody, omega_bn_b: Vec3, wheel_speed_rpm) -> np.ndarray:
    """Wheel momenta (N,) [N m s] for speeds relative to the body [rev/min]; none given: at rest."""
    speeds = np.broadcast_to(np.asarray(wheel_speed_rpm if len(wheel_speed_rpm) else 0.0), len(body.wheels))
    return np.array(
        [
            wheel_momentum_at_speed(wheel, omega_bn_b, float(speed) * _RADIANS_PER_RPM)
            for wheel, speed in zip(body.wheels, speeds, strict=True)
        ],
        dtype=np.float64,
    )


def dispersed_dipole(values: Values, key: RandomKey) -> Vec3:
    """Residual dipole of one case in b [A m^2]: `disturbances.dipole`, dispersed."""
    x, y, z = vector_of(values[DIPOLE])
    sigma = dispersion(values).dipole
    if sigma == 0.0:
        return (x, y, z)
    n = normal4(key, Stream.DIPOLE, 0, 0)
    return (x + sigma * n[0], y + sigma * n[1], z + sigma * n[2])


def has_dipole(values: Values) -> bool:
    """Whether the spacecraft of some case has a residual dipole."""
    return bool(np.any(values[DIPOLE])) or dispersion(values).dipole > 0.0


def dispersed_body(values: Values, key: RandomKey, substeps: int = 1) -> RigidBody:
    """The spacecraft of one case: mission values, dispersed as `PARAMETERS` ask.

    Principal moments are scaled, axes stay; scaled moments that no rigid body has (triangle inequality) are
    brought back to the nearest that one has.
    """
    spread = dispersion(values)
    inertia, axes = values[INERTIA], wheel_axes(values)
    inertias, torque, speeds = (
        of_each_wheel(values, each)[: len(axes)] for each in (WHEEL_INERTIA, WHEEL_MAX_TORQUE, WHEEL_MAX_SPEED)
    )
    if spread.inertia > 0.0:
        moments, principal = np.linalg.eigh(inertia)
        draws = np.array(normal4(key, Stream.INERTIA, 0, 0)[:3])
        moments = moments * np.clip(1.0 + spread.inertia * draws, 0.1, None)
        largest = int(np.argmax(moments))
        moments[largest] = min(moments[largest], np.sum(np.delete(moments, largest)))
        inertia = (principal * moments) @ principal.T
    if spread.wheel_torque > 0.0:
        draws = np.array([normal4(key, Stream.WHEEL_LIMIT, 0, i)[0] for i in range(len(torque))])
        torque = torque * np.clip(1.0 + spread.wheel_torque * draws, 0.0, None)
    friction = wheel_friction.dispersed_friction(wheel_friction.parameters(values), key, len(axes))
    return rigid_body(inertia, axes, inertias, torque, speeds, substeps, friction)
