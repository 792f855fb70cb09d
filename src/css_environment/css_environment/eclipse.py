# SPDX-License-Identifier: Apache-2.0
"""Shadow of the Earth: fraction of the solar disc a spacecraft sees."""

import math

from css_common.kernel import kernel
from css_common.vectors import Vec3, dot
from css_environment.constants import EARTH_RADIUS, SOLAR_RADIUS


@kernel
def cylindrical_illumination(r_n: Vec3, sun_n: Vec3, earth_radius: float = EARTH_RADIUS) -> float:
    """1 in sunlight, 0 in a shadow cylinder of the Earth's radius; `sun_n` is the unit vector to the Sun."""
    along = dot(r_n, sun_n)
    if along >= 0.0 or dot(r_n, r_n) - along * along > earth_radius * earth_radius:
        return 1.0
    return 0.0


@kernel
def conical_illumination(
    r_n: Vec3,
    sun_n: Vec3,
    sun_distance: float,
    earth_radius: float = EARTH_RADIUS,
    sun_radius: float = SOLAR_RADIUS,
) -> float:
    """Fraction of the solar disc in view, 0 (umbra) to 1, from the overlap of the discs of Sun and Earth.

    Montenbruck & Gill, Satellite Orbits, sec. 3.4.2.
    `r_n` [m] is the position from the Earth's centre, `sun_n` the unit vector from the spacecraft to the Sun,
    `sun_distance` [m] its distance. Beyond the tip of the umbra the Earth covers only part of the disc.
    """
    along = dot(r_n, sun_n)
    if along >= 0.0:
        return 1.0
    distance_squared = dot(r_n, r_n)
    across = math.sqrt(max(0.0, distance_squared - along * along))
    sun = math.asin(min(1.0, sun_radius / sun_distance))
    # Clear of the penumbra's cone by a margin: full Sun without the disc geometry.
    if across > 1.001 * earth_radius - 1.05 * sun * along:
        return 1.0
    earth = math.asin(min(1.0, earth_radius / math.sqrt(distance_squared)))
    separation = math.atan2(across, -along)
    if separation >= sun + earth:
        return 1.0
    if separation <= earth - sun:
        return 0.0
    if separation <= sun - earth:
        return 1.0 - (earth / sun) ** 2
    # Both discs end at the common chord, x from the Sun's centre and 2 y long. Written with differences and
    # arc tangents: the textbook arc cosines lose half the digits where the discs only touch.
    x = 0.5 * (sun * sun + (separation - earth) * (separation + earth)) / separation
    y = math.sqrt(max(0.0, (sun - x) * (sun + x)))
    covered = _segment_area(sun, x, y) + _segment_area(earth, separation - x, y)
    return max(0.0, min(1.0, 1.0 - covered / (math.pi * sun * sun)))


@kernel
def _segment_area(radius: float, x: float, y: float) -> float:
    """Area of the part of a disc beyond a chord of half length y at the distance x from the centre."""
    half_angle = math.atan2(y, x)
    return radius * radius * half_angle - x * y
