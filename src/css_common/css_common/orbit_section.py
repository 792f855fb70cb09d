# SPDX-License-Identifier: Apache-2.0
"""The section `orbit`: what defines where the spacecraft is."""

import math
from collections.abc import Iterator

import numpy as np

from css_common.earth import EARTH_RADIUS
from css_common.mission_section import EPOCH
from css_common.schema import Table, Values, choice, flag, real, reals, text
from css_common.section import Section

_LOWEST = 100e3  # altitude [m] below which the atmosphere lets nothing orbit

ORBIT_SOURCE = choice(
    "orbit.source",
    "none",
    ("none", "elements", "tle", "ballistic"),
    "what defines the orbit",
    example="orbit: {source: elements, altitude: 400.0e+3, inclination_deg: 51.6}",
)
ALTITUDE = real("orbit.altitude", 0.0, "m", "semi-major axis above the equatorial radius", low=0.0, high=1e9)
ECCENTRICITY = real("orbit.eccentricity", 0.0, "-", "eccentricity", low=0.0, high=0.9)
LAUNCH_LATITUDE = real(
    "orbit.launch.latitude_deg",
    None,
    "deg",
    "geodetic latitude where a ballistic arc begins",
    low=-90.0,
    high=90.0,
    example="orbit: {launch: {latitude_deg: 69.29}}",
)
LAUNCH_LONGITUDE = real(
    "orbit.launch.longitude_deg",
    None,
    "deg",
    "its longitude, east",
    low=-180.0,
    high=360.0,
    example="orbit: {launch: {longitude_deg: 16.02}}",
)
LAUNCH_HEIGHT = real("orbit.launch.height", 0.0, "m", "its height above the ellipsoid", low=-500.0, high=100e3)
LAUNCH_AZIMUTH = real(
    "orbit.launch.azimuth_deg",
    None,
    "deg",
    "direction of the arc's start from north over east",
    low=-360.0,
    high=360.0,
    example="orbit: {launch: {azimuth_deg: 330.0}}",
)
LAUNCH_ELEVATION = real(
    "orbit.launch.elevation_deg",
    None,
    "deg",
    "its elevation",
    low=10.0,
    high=90.0,
    example="orbit: {launch: {elevation_deg: 80.0}}",
)
LAUNCH_APOGEE = real(
    "orbit.launch.apogee",
    None,
    "m",
    "height of its apogee above the ellipsoid",
    low=1e3,
    high=2000e3,
    example="orbit: {launch: {apogee: 169.0e+3}}",
)
LATER_ELEMENTS = reals(
    "orbit.later_elements",
    (),
    "-",
    "further elements of the integrated model, a row each: seconds after the epoch from which on they hold, then "
    "altitude [m], eccentricity, inclination, raan, argument of perigee and true anomaly [deg] at that instant",
    columns=7,
)

ORBIT: Table = (
    ORBIT_SOURCE,
    ALTITUDE,
    ECCENTRICITY,
    real("orbit.inclination_deg", 0.0, "deg", "to the mean equator J2000", low=0.0, high=180.0),
    real("orbit.raan_deg", 0.0, "deg", "right ascension of the ascending node", low=-360.0, high=360.0),
    real("orbit.argument_of_perigee_deg", 0.0, "deg", "argument of perigee", low=-360.0, high=360.0),
    real("orbit.true_anomaly_deg", 0.0, "deg", "true anomaly at the epoch", low=-360.0, high=360.0),
    choice(
        "orbit.model",
        "secular",
        ("secular", "j2_integrated"),
        "elements that stand still or drift evenly, or motion from them integrated under J2, short periods included",
    ),
    flag("orbit.j2", False, "secular drift of node, perigee and anomaly by J2, of the secular model"),
    LATER_ELEMENTS,
    text("orbit.tle_line1", "", "first line of the element set, when the source is tle"),
    text("orbit.tle_line2", "", "second line of the element set"),
    LAUNCH_LATITUDE,
    LAUNCH_LONGITUDE,
    LAUNCH_HEIGHT,
    LAUNCH_AZIMUTH,
    LAUNCH_ELEVATION,
    LAUNCH_APOGEE,
)


def needed_of_orbit(values: Values) -> tuple[str, ...]:
    """What a component cannot do without that has to know where the spacecraft is."""
    launch = (LAUNCH_LATITUDE, LAUNCH_LONGITUDE, LAUNCH_AZIMUTH, LAUNCH_ELEVATION, LAUNCH_APOGEE)
    of_source = launch if values[ORBIT_SOURCE] == "ballistic" else ()
    return tuple(p.name for p in (ORBIT_SOURCE, EPOCH, *of_source))


def _orbit_conflicts(orbit: Values) -> Iterator[str]:
    if orbit.source == "tle":
        for key in ("tle_line1", "tle_line2"):
            if len(getattr(orbit, key)) != 69:
                yield f"orbit.{key}: expected the 69 characters of a two-line element set"
    if orbit.model == "j2_integrated" and orbit.source in ("tle", "ballistic"):
        yield f"orbit.model: j2_integrated given with orbit.source {orbit.source}, expected elements as the source"
    if len(orbit.later_elements) and (orbit.source != "elements" or orbit.model != "j2_integrated"):
        yield "orbit.later_elements: given, expected elements as orbit.source and j2_integrated as orbit.model"
    if orbit.source != "elements":
        return
    yield from _later_conflicts(orbit.later_elements)
    if orbit.altitude < _LOWEST:
        given = f"{orbit.altitude:g} given" if orbit.altitude else "missing"
        yield f"orbit.altitude: {given}, expected a number [m], at least {_LOWEST:g}, for instance 400.0e+3"
        return
    axis = EARTH_RADIUS + orbit.altitude
    perigee = axis * (1.0 - orbit.eccentricity) - EARTH_RADIUS
    if perigee < _LOWEST - 1e-3:
        most = math.floor((orbit.altitude - _LOWEST) / axis * 1e4) * 1e-4
        yield (
            f"orbit.eccentricity: {orbit.eccentricity:g} given, which with orbit.altitude {orbit.altitude:g} m puts "
            f"the perigee at {perigee / 1e3:.0f} km; expected at most {most:.4f}, a perigee of {_LOWEST / 1e3:g} km"
        )


def _later_conflicts(rows: np.ndarray) -> Iterator[str]:
    """What is wrong with further elements (N, 7)."""
    for number, (start, altitude, eccentricity, inclination, *angles) in enumerate(rows.tolist()):
        before = rows[number - 1, 0] if number else 0.0
        wrong = ""
        if not start > before:
            wrong = f"holds from {start:g} s on, expected a time after {before:g} s"
        elif not (0.0 <= eccentricity <= 0.9 and 0.0 <= inclination <= 180.0 and all(abs(a) <= 360.0 for a in angles)):
            wrong = "expected an eccentricity of 0 to 0.9, an inclination of 0 to 180 deg, angles of -360 to 360 deg"
        elif not _LOWEST - 1e-3 <= (EARTH_RADIUS + altitude) * (1.0 - eccentricity) - EARTH_RADIUS <= 1e9:
            wrong = f"altitude {altitude:g} m, expected a perigee of at least {_LOWEST / 1e3:g} km"
        if wrong:
            yield f"orbit.later_elements: row {number}: {wrong}"
            return


SECTIONS = {"orbit": Section(ORBIT, _orbit_conflicts)}
