# SPDX-License-Identifier: Apache-2.0
"""Density of the upper atmosphere and the velocity of a spacecraft through it."""

import math
from typing import NamedTuple

from css_common.kernel import kernel
from css_common.vectors import Vec3, norm
from css_environment.constants import EARTH_RADIUS, EARTH_ROTATION_RATE


class ExponentialAtmosphere(NamedTuple):
    """Density that falls by 1/e every `scale_height`."""

    reference_density: float  # [kg/m3]
    reference_altitude: float  # [m] above the equatorial radius
    scale_height: float  # [m]


ATMOSPHERE_400_KM = ExponentialAtmosphere(3.725e-12, 400e3, 58_515.0)
"""Mean solar activity from 400 to 450 km (Vallado, Table 8-4); the density varies from 5e-13 to 1e-11 kg/m3."""


@kernel
def density(atmosphere: ExponentialAtmosphere, r_n: Vec3) -> float:
    """Density at a position [kg/m3]; below sea level that at sea level, which keeps it finite."""
    altitude = max(0.0, norm(r_n) - EARTH_RADIUS)
    return atmosphere.reference_density * math.exp((atmosphere.reference_altitude - altitude) / atmosphere.scale_height)


@kernel
def air_velocity(r_n: Vec3, v_n: Vec3) -> Vec3:
    """Velocity relative to an atmosphere that turns with the Earth about the z axis of n [m/s]."""
    return (v_n[0] + EARTH_ROTATION_RATE * r_n[1], v_n[1] - EARTH_ROTATION_RATE * r_n[0], v_n[2])
