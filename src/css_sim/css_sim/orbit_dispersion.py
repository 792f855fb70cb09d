# SPDX-License-Identifier: Apache-2.0
"""The true orbit of a case: that of the mission's `orbit` section, whose elements were missed by something.

Flight software goes by the section; what is drawn here is the error of its place.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

from css_common.declared import builder, given, made, table_of
from css_common.orbit_section import ORBIT_SOURCE
from css_common.random_streams import RandomKey, Stream, normal4
from css_common.schema import Values, real
from css_environment.constants import EARTH_RADIUS
from css_environment.mission_environment import mission_orbit
from css_environment.orbit import IntegratedOrbit, KeplerianOrbit, Orbit


class OrbitDispersion(NamedTuple):
    """1 sigma of the true elements about those of the mission."""

    altitude: float = given(  # [m]
        real("dispersion.orbit.altitude", 0.0, "m", "1 sigma of the true semi-major axis", low=0.0, high=1e6)
    )
    inclination: float = made(  # [rad]
        math.radians,
        real("dispersion.orbit.inclination_deg", 0.0, "deg", "1 sigma of the true inclination", low=0.0, high=10.0),
    )
    raan: float = made(  # [rad]
        math.radians, real("dispersion.orbit.raan_deg", 0.0, "deg", "1 sigma of the true node", low=0.0, high=180.0)
    )
    true_anomaly: float = made(  # [rad]
        math.radians,
        real(
            "dispersion.orbit.true_anomaly_deg", 0.0, "deg", "1 sigma of the true place in orbit", low=0.0, high=180.0
        ),
    )


PARAMETERS = table_of(OrbitDispersion)
parameters = builder(OrbitDispersion)

_LOWEST_PERIGEE = EARTH_RADIUS + 100e3  # [m] as for a mission's own elements


def is_dispersed(values: Values) -> bool:
    """Whether cases differ in their orbits."""
    return any(sigma > 0.0 for sigma in parameters(values))


def conflicts(values: Values) -> Iterator[str]:
    """What is wrong between the values, one message each."""
    if is_dispersed(values) and values[ORBIT_SOURCE] != "elements":
        name = next(p.name for p, sigma in zip(PARAMETERS, parameters(values), strict=True) if sigma > 0.0)
        yield f"{name}: {values[ORBIT_SOURCE]} given as orbit.source, expected elements, which can be dispersed"


def case_orbit(values: Values, key: RandomKey) -> Orbit:
    """The true orbit of one case (section orbit): elements at the epoch plus normal errors; no perigee below 100 km."""
    orbit = mission_orbit(values)
    if not is_dispersed(values):
        return orbit
    if isinstance(orbit, IntegratedOrbit):
        return IntegratedOrbit(_dispersed(orbit.elements, parameters(values), key))
    assert isinstance(orbit, KeplerianOrbit)  # `conflicts` refuses others
    return _dispersed(orbit, parameters(values), key)


def _dispersed(orbit: KeplerianOrbit, sigma: OrbitDispersion, key: RandomKey) -> KeplerianOrbit:
    draws = normal4(key, Stream.ORBIT, 0, 0)
    inclination = orbit.inclination + sigma.inclination * draws[1]
    return orbit._replace(
        semi_major_axis=max(
            orbit.semi_major_axis + sigma.altitude * draws[0], _LOWEST_PERIGEE / (1.0 - orbit.eccentricity)
        ),
        inclination=min(max(inclination, 0.0), math.pi),
        raan=orbit.raan + sigma.raan * draws[2],
        true_anomaly=orbit.true_anomaly + sigma.true_anomaly * draws[3],
    )
