# SPDX-License-Identifier: Apache-2.0
"""Physical constants of the environment, each with its unit and source."""

import math

from css_common.earth import EARTH_RADIUS as EARTH_RADIUS

ASTRONOMICAL_UNIT = 149_597_870_700.0
"""Astronomical unit [m], IAU 2012 Resolution B2 (exact)."""

SOLAR_RADIUS = 6.957e8
"""Nominal solar radius [m], IAU 2015 Resolution B3."""

EARTH_MU = 3.986004418e14
"""Gravitational parameter of the Earth with its atmosphere [m^3/s^2], WGS 84."""

EARTH_J2 = 1.08262668e-3
"""Second zonal harmonic of the Earth's gravity field, unnormalised [-], EGM96 / JGM-3."""

EARTH_ROTATION_RATE = 2.0 * math.pi * 1.00273781191135448 / 86400.0
"""Rate of the Earth rotation angle per second of UT1 [rad/s], IAU 2000 Resolution B1.8 (7.292115e-5)."""
