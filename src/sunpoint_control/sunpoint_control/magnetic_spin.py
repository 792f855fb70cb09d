# SPDX-License-Identifier: Apache-2.0
"""Laws for torque rods alone: detumbling by B-dot, and a spin about the Sun line.

**Detumbling** (Avanzini & Giulietti, "Magnetic Detumbling of a Rigid Spacecraft", JGCD 35(4), 2012). The dipole
m = -(k/|B|) b', b' the derivative of the unit field in the body, gives the torque

    m x B = -k (omega - b (b . omega)),

which takes kinetic energy away whatever the inertia. As the field turns along the orbit the part about it decays too;
their gain for that, k = 2 n (1 + sin xi) J_min of the orbital rate n, the inclination xi to the geomagnetic equator
and the least moment of inertia, is the default. Their xi varies by the tilt of the Earth's dipole over a day; here the
inclination of the orbit stands for it.

**Spin about the Sun line** (the pure spin of Avanzini, de Angelis & Giulietti, JGCD 36(6), 2013, made to point as in de
Angelis, Giulietti, de Ruiter & Avanzini, "Spin-axis pointing of a magnetically actuated spacecraft", Acta Astronautica
94, 2014). Two errors are fed back at once: of the momentum from where it shall be in space, along the Sun s, and of
the momentum from where it shall be in the body, along the array normal c. Here both are written as rates,

    tau = k (omega_d - omega),    omega_d = Omega (alpha s + (1 - alpha) c),

since of the rate just the part across the field is known without gyro, and just that enters the torque that rods
can give, tau - b (b . tau). Spin Omega and alignment are reached together: with omega about c the difference s - c
precesses the spin axis to the Sun at about alpha k / I, and omega_d - omega damps the nutation. While no Sun is known
alpha is zero: the spin is kept, its direction drifts with the disturbances, the less the faster it is.

c should be the axis of the largest moment of inertia. About another one a body with anything flexible in it does not
keep spinning.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from css_common.declared import builder, computed, given, made, table_of
from css_common.kernel import kernel
from css_common.schema import Values, real
from css_common.vectors import Vec3, add, scale, subtract, vector_of
from css_environment.constants import EARTH_MU, EARTH_RADIUS

DAMPING_GAIN = real(
    "gains.damping",
    0.0,
    "N m s",
    "gain k of detumbling; 0: Avanzini & Giulietti's, from orbit and inertia",
    low=0.0,
    tunable=True,
)
SPIN_GAIN = real(
    "gains.spin",
    0.0,
    "N m s",
    "gain k of the spin about the Sun line; 0: their gain with the largest moment of inertia instead of the least",
    low=0.0,
    tunable=True,
)


def detumbling_gain(orbital_rate: float, inclination: float, moment: float) -> float:
    """Gain k [N m s] of Avanzini & Giulietti 2012: 2 n (1 + sin xi) J.

    Args:
        orbital_rate: n [rad/s].
        inclination: xi [rad], of the orbit to the geomagnetic equator, prograde or retrograde.
        moment: of inertia J [kg m^2], the least one for detumbling.
    """
    return 2.0 * orbital_rate * (1.0 + abs(math.sin(inclination))) * moment


def _orbit(values: Values) -> tuple[float, float]:
    """Mean orbital rate [rad/s] and inclination [rad]; 0 where the mission does not say."""
    orbit = values.orbit
    if orbit.source == "elements":
        axis = EARTH_RADIUS + orbit.altitude
        return math.sqrt(EARTH_MU / axis**3), math.radians(orbit.inclination_deg)
    if orbit.source == "tle":
        line = orbit.tle_line2
        return float(line[52:63]) * 2.0 * math.pi / 86400.0, math.radians(float(line[8:16]))
    return 0.0, 0.0


def _gain(values: Values, given_gain: float, moment: float) -> float:
    return given_gain if given_gain > 0.0 else detumbling_gain(*_orbit(values), moment)


def _damping_gain(values: Values) -> float:
    return _gain(values, values[DAMPING_GAIN], float(np.linalg.eigvalsh(values.spacecraft.inertia)[0]))


def _spin_gain(values: Values) -> float:
    return _gain(values, values[SPIN_GAIN], float(np.linalg.eigvalsh(values.spacecraft.inertia)[2]))


def _array_normal(values: Values) -> Vec3:
    return vector_of(values.spacecraft.array_normal)


class SpinParameters(NamedTuple):
    """Gains in N m s, and the spin that is wanted."""

    damping_gain: float = computed(_damping_gain, DAMPING_GAIN)
    spin_gain: float = computed(_spin_gain, SPIN_GAIN)
    spin_rate: float = made(  # [rad/s]
        math.radians,
        real("spin.rate_deg_s", 2.0, "deg/s", "rate Omega about the Sun line", low=0.01, high=60.0, tunable=True),
    )
    alignment: float = given(
        real(
            "spin.alignment",
            0.5,
            "-",
            "share alpha of the wanted rate that lies along the Sun line, the rest along the array normal",
            low=0.0,
            high=1.0,
            tunable=True,
        )
    )
    array_normal_b: Vec3 = computed(_array_normal)


PARAMETERS = table_of(SpinParameters)
parameters = builder(SpinParameters)


def conflicts(values: Values) -> Iterator[str]:
    """What is wrong between the values, one message each."""
    if values.orbit.source in ("elements", "tle"):
        return
    for parameter in (DAMPING_GAIN, SPIN_GAIN):
        if values[parameter] == 0.0:
            yield f"{parameter.name}: 0 given, which takes it from the orbit, but orbit.source is {values.orbit.source}"


@kernel
def damping_torque(p: SpinParameters, omega_bn_b: Vec3) -> Vec3:
    """Torque [N m] against the body rate [rad/s]."""
    return scale(-p.damping_gain, omega_bn_b)


@kernel
def wanted_rate(p: SpinParameters, sun_b: Vec3, sun_known: bool) -> Vec3:
    """Rate omega_d [rad/s] in b, with or without a Sun; a direction that is not known may be no number."""
    if not sun_known:
        return scale(p.spin_rate, p.array_normal_b)
    alpha = p.alignment
    return scale(p.spin_rate, add(scale(alpha, sun_b), scale(1.0 - alpha, p.array_normal_b)))


@kernel
def spin_torque(p: SpinParameters, sun_b: Vec3, sun_known: bool, omega_bn_b: Vec3) -> Vec3:
    """Torque [N m] towards the spin that is wanted; what of it lies along the field is for nobody to give."""
    return scale(p.spin_gain, subtract(wanted_rate(p, sun_b, sun_known), omega_bn_b))
