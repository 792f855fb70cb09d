# SPDX-License-Identifier: Apache-2.0
"""Do orbit and models of the environment hold for the place and the time of a flight? Asked before it begins."""

from collections.abc import Iterator
from datetime import UTC, datetime

import numpy as np

from css_common.component import Finding
from css_common.epochs import mission_epoch
from css_common.schema import Values
from css_environment.ballistic import geodetic_heights
from css_environment.constants import EARTH_RADIUS
from css_environment.magnetic_field import LAST_YEAR
from css_environment.mission_environment import mission_orbit
from css_environment.orbit import ArcsOrbit, IntegratedOrbit, KeplerianOrbit, TleOrbit, orbit_states
from css_environment.tle_checks import tle_findings

LONGEST_EXTRAPOLATION = 5
"""Years beyond the field model after which its successor is due, and nothing flies by it."""

MAGNETOPAUSE = 8.0 * EARTH_RADIUS
"""Distance [m] from where on the solar wind rules the field, and the model of the Earth's own says little."""

MOON_MATTERS = 200_000e3
"""Distance [m] from where on the Moon pulls as no orbit here knows."""

_DEEPEST = -500.0  # [m] of a landing, below the ellipsoid
_SECOND_NS = 10**9


def orbit_findings(values: Values) -> Iterator[Finding]:
    """What is wrong with a mission's orbit over its flight (sections mission and orbit)."""
    epoch_ns, duration_s = mission_epoch(values.mission), values.mission.duration
    try:
        orbit = mission_orbit(values)
    except ValueError as error:
        yield Finding(f"orbit.launch.apogee: {error}, expected one that an arc from there reaches", refused=True)
        return
    if isinstance(orbit, ArcsOrbit):
        orbit = orbit.arcs[0]
    if isinstance(orbit, IntegratedOrbit):
        orbit = orbit.elements
    if isinstance(orbit, TleOrbit):
        yield from tle_findings(orbit, epoch_ns, duration_s)
    elif values.orbit.source == "ballistic":
        yield from _arc_findings(orbit, epoch_ns, duration_s)
    elif orbit.semi_major_axis * (1.0 + orbit.eccentricity) > MOON_MATTERS:
        yield Finding(
            f"orbit.altitude: {values.orbit.altitude:g} given, which reaches "
            f"{orbit.semi_major_axis * (1.0 + orbit.eccentricity) / 1e3:.0f} km from the Earth's centre, expected at "
            f"most {MOON_MATTERS / 1e3:g} km: beyond it the Moon moves the orbit, which is not modelled"
        )


def recorded_orbit_findings(values: Values, first_ns: int, last_ns: int) -> list[Finding]:
    """What is wrong with a mission's element set over the time of a recording; none of other orbits.

    Args:
        values: section orbit.
        first_ns, last_ns: of the recording (UTC), whatever the mission's own epoch.
    """
    if values.orbit.source != "tle":
        return []
    orbit = TleOrbit(values.orbit.tle_line1, values.orbit.tle_line2)
    return list(tle_findings(orbit, first_ns, max(1.0, (last_ns - first_ns) * 1e-9)))


def _arc_findings(orbit: KeplerianOrbit, epoch_ns: int, duration_s: float) -> Iterator[Finding]:
    r_n, _ = orbit_states(orbit, epoch_ns, duration_s)
    (height,) = geodetic_heights(epoch_ns, np.array([duration_s]), r_n)
    if height < _DEEPEST:
        yield Finding(
            f"mission.duration: {duration_s:g} given, at the end of which the arc is {-height / 1e3:.1f} km below the "
            "ground, expected the time until it is back there"
        )


def field_findings(values: Values) -> Iterator[Finding]:
    """What is wrong with the geomagnetic field over the flight, where it is used (sections mission and orbit)."""
    end_ns = mission_epoch(values.mission) + round(values.mission.duration * 1e9)
    end = datetime.fromtimestamp(end_ns / _SECOND_NS, tz=UTC)
    beyond = (end - datetime(LAST_YEAR, 1, 1, tzinfo=UTC)).total_seconds() / (365.25 * 86_400.0)
    if beyond > 0.0:
        remedy = "the field stands still from then on and is off by some 100 nT for each year"
        yield Finding(
            f"mission.epoch: the flight ends in {end.year}, expected an end before {LAST_YEAR}, the last year of the "
            f"field model IGRF-14: {remedy}",
            refused=beyond > LONGEST_EXTRAPOLATION,
        )
    if values.orbit.source == "elements":
        farthest = (EARTH_RADIUS + values.orbit.altitude) * (1.0 + values.orbit.eccentricity)
        if farthest > MAGNETOPAUSE:
            yield Finding(
                f"orbit.altitude: {values.orbit.altitude:g} given, which reaches {farthest / EARTH_RADIUS:.1f} radii "
                f"of the Earth, expected at most {MAGNETOPAUSE / EARTH_RADIUS:g} where the magnetic field is used: "
                "beyond it the solar wind rules, which IGRF does not know"
            )
