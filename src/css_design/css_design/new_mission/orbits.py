# SPDX-License-Identifier: Apache-2.0
"""Orbits as people give them: altitude and local time of the node, elements, or a two-line element set."""

import math
import re
from datetime import datetime
from pathlib import Path
from typing import Any, NamedTuple

from css_common.epochs import format_utc, parse_utc
from css_design.errors import DesignError
from css_environment.constants import EARTH_J2, EARTH_MU, EARTH_RADIUS
from css_environment.tle_checks import format_faults

DEFAULT_EPOCH = "2026-06-01T00:00:00Z"

TROPICAL_YEAR = 365.242190402 * 86_400.0
"""[s] from equinox to equinox, in which the node of a Sun-synchronous orbit goes round once."""

_J2000_NS = parse_utc("2000-01-01T12:00:00Z")
_DAY_NS = 86_400 * 10**9
_MOST_BYTES = 1_000_000
_EXPECTED = "expected 'sso ALTITUDE_KM HH:MM', 'elements ALTITUDE_KM INCLINATION_DEG [NODE_DEG [ECC]]' or 'tle FILE'"


class Orbit(NamedTuple):
    """What the section `orbit` says."""

    parameters: dict[str, Any]  # by key of the section
    epoch: str  # UTC
    period_s: float
    perigee_m: float  # altitude
    words: str


def orbit_of(text: str, epoch: str) -> Orbit:
    """Orbit and epoch of what was written.

    Raises:
        DesignError: it is none.
    """
    kind, *given = text.split(maxsplit=1)
    rest = given[0] if given else ""
    if kind == "tle" and rest:
        return _of_tle(Path(rest), epoch)
    start = DEFAULT_EPOCH if epoch == "auto" else _checked(epoch)
    words = rest.split()
    if kind == "sso" and len(words) == 2:
        altitude = _number("altitude", words[0], 200.0, 5000.0)
        return _synchronous(altitude, words[1], start)
    if kind == "elements" and 2 <= len(words) <= 4:
        altitude = _number("altitude", words[0], 150.0, 200_000.0)
        inclination = _number("inclination", words[1], 0.0, 180.0)
        node = _number("node", words[2], -360.0, 360.0) if len(words) > 2 else 0.0
        eccentricity = _number("eccentricity", words[3], 0.0, 0.9) if len(words) > 3 else 0.0
        return _elements(altitude, inclination, node, eccentricity, start, f"{altitude:g} km, {inclination:g} deg")
    raise DesignError(f"--orbit: {text!r} given, {_EXPECTED}")


def _checked(epoch: str) -> str:
    try:
        return format_utc(parse_utc(epoch))
    except (ValueError, OverflowError) as error:
        raise DesignError(f"--epoch: {error}") from error


def _number(name: str, text: str, low: float, high: float) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not low <= value <= high:
        raise DesignError(f"--orbit: {name} {text!r} given, expected {low:g} to {high:g}")
    return value


def synchronous_inclination(altitude_m: float) -> float:
    """Inclination [rad] at which J2 turns the node of a circular orbit with the mean Sun (Wertz, Eq. 3-41).

    Raises:
        DesignError: there is none so high up.
    """
    axis = EARTH_RADIUS + altitude_m
    motion = math.sqrt(EARTH_MU / axis**3)
    cosine = -(2.0 * math.pi / TROPICAL_YEAR) / (1.5 * EARTH_J2 * (EARTH_RADIUS / axis) ** 2 * motion)
    if cosine < -1.0:
        raise DesignError(f"--orbit: no orbit is Sun-synchronous {altitude_m / 1e3:g} km up, expected at most 5970")
    return math.acos(cosine)


def node_at_local_time(epoch: str, hours: float) -> float:
    """Right ascension [rad] of an ascending node, mean equator J2000, that has a mean local time at an epoch.

    The mean Sun's right ascension is its mean longitude of date (Meeus, Eq. 25.2), brought back by the precession in
    right ascension since J2000.
    """
    days = (parse_utc(epoch) - _J2000_NS) / _DAY_NS
    centuries = days / 36_525.0
    sun_deg = 280.46646 + 36_000.76983 * centuries + 0.0003032 * centuries**2 - 1.2812 * centuries
    return math.radians((sun_deg + 15.0 * (hours - 12.0)) % 360.0)


def _synchronous(altitude_km: float, local_time: str, epoch: str) -> Orbit:
    found = re.fullmatch(r"([01]?\d|2[0-3]):([0-5]\d)", local_time)
    if not found:
        raise DesignError(f"--orbit: local time {local_time!r} given, expected one such as 10:30")
    hours = int(found[1]) + int(found[2]) / 60.0
    inclination = math.degrees(synchronous_inclination(altitude_km * 1e3))
    node = math.degrees(node_at_local_time(epoch, hours))
    words = f"Sun-synchronous, {altitude_km:g} km, ascending node at {local_time} mean local time"
    return _elements(altitude_km, round(inclination, 4), round(node, 4), 0.0, epoch, words)


def _elements(
    altitude_km: float, inclination: float, node: float, eccentricity: float, epoch: str, words: str
) -> Orbit:
    axis = EARTH_RADIUS + altitude_km * 1e3
    return Orbit(
        {
            "source": "elements",
            "altitude": altitude_km * 1e3,
            "eccentricity": eccentricity,
            "inclination_deg": inclination,
            "raan_deg": node,
            "argument_of_perigee_deg": 0.0,
            "true_anomaly_deg": 0.0,
            "j2": True,
        },
        epoch,
        2.0 * math.pi * math.sqrt(axis**3 / EARTH_MU),
        axis * (1.0 - eccentricity) - EARTH_RADIUS,
        words,
    )


def _of_tle(path: Path, epoch: str) -> Orbit:
    line1, line2 = tle_lines(path)
    set_epoch = tle_epoch(line1)
    start = set_epoch if epoch == "auto" else _checked(epoch)
    revolutions, eccentricity = float(line2[52:63]), float(f"0.{line2[26:33].strip()}")
    period = 86_400.0 / revolutions
    axis = (EARTH_MU * (period / (2.0 * math.pi)) ** 2) ** (1.0 / 3.0)
    return Orbit(
        {"source": "tle", "tle_line1": line1, "tle_line2": line2},
        start,
        period,
        axis * (1.0 - eccentricity) - EARTH_RADIUS,
        f"element set {line1[2:7].strip()} of {set_epoch[:10]}",
    )


def tle_lines(path: Path) -> tuple[str, str]:
    """The two lines of the one element set of a file, with or without a name above them.

    Raises:
        DesignError: there is no such file, none or several sets, or a damaged one.
    """
    try:
        if path.stat().st_size > _MOST_BYTES:
            raise DesignError(f"--orbit: {path}: {path.stat().st_size} bytes, expected a file of two lines")
        lines = [line.rstrip() for line in path.read_text(encoding="ascii", errors="replace").splitlines()]
    except (OSError, ValueError) as error:
        raise DesignError(f"--orbit: {path}: cannot be read: {getattr(error, 'strerror', error)}") from error
    found = [[line for line in lines if line.startswith(f"{number} ")] for number in (1, 2)]
    if [len(of_number) for of_number in found] != [1, 1]:
        raise DesignError(
            f"--orbit: {path}: {len(found[0])} first and {len(found[1])} second lines of element sets, expected one "
            "of each"
        )
    (line1,), (line2,) = found
    for index, fault in format_faults((line1, line2)):
        raise DesignError(f"--orbit: {path}: line {index + 1} of the set: {fault}")
    try:
        tle_epoch(line1)
        usable = float(line2[52:63]) > 0.0 and 0.0 <= float(f"0.{line2[26:33].strip()}") < 1.0
    except (ValueError, OverflowError):
        usable = False
    if not usable:
        raise DesignError(f"--orbit: {path}: no epoch or motion in the set, expected a two-line element set")
    return line1, line2


def tle_epoch(line1: str) -> str:
    """UTC of an element set, to the second; years of two digits are 1957 to 2056."""
    year, day = int(line1[18:20]), float(line1[20:32])
    begin = parse_utc(f"{1900 + year if year >= 57 else 2000 + year}-01-01T00:00:00Z")
    stamp = begin + round((day - 1.0) * 86_400.0) * 10**9
    return datetime.fromisoformat(format_utc(stamp)).strftime("%Y-%m-%dT%H:%M:%SZ")
