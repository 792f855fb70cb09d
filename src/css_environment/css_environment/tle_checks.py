# SPDX-License-Identifier: Apache-2.0
"""Is a two-line element set what it says, and does it hold for the time of a flight?

Format and checksum as in Hoots & Roehrich, Spacetrack Report No. 3, and Vallado et al. 2006 (AIAA 2006-6753).

Age. SGP4 is about 1 km off at the epoch of a set in low orbit and loses 1 to 3 km a day, mostly along the track and
ever faster, because drag is what it knows least (Vallado et al. 2006; Levit & Marshall 2011). After a week that is
20 km, 3 s of the orbit; after two months a thousand and more, minutes of the eclipse and degrees of the field.
"""

import math
import re
from collections.abc import Iterator

import numpy as np

from css_common.component import Finding
from css_common.epochs import format_utc
from css_environment.constants import EARTH_RADIUS
from css_environment.orbit import TleOrbit, orbit_states
from css_environment.time_scales import NANOSECONDS_PER_DAY, UNIX_EPOCH_JD

DOUBTFUL_DAYS = 7.0
"""Age from which a set is worth a warning."""

USELESS_DAYS = 60.0
"""Age from which nothing flies by a set."""

LOWEST = 100e3
"""Altitude [m] below which the atmosphere lets nothing orbit."""

_LENGTH = 69
_STRANGE = re.compile("[^ 0-9.+-]")
_NUMBERS_FROM = (17, 7)  # where the names in each line end
_SAMPLE_S = 60.0
_MOST_SAMPLES = 20_000


def format_faults(lines: tuple[str, str]) -> Iterator[tuple[int, str]]:
    """Number of a line, 0 or 1, and what is wrong with it."""
    for index, line in enumerate(lines):
        number = str(index + 1)
        if len(line) != _LENGTH:
            yield index, f"{len(line)} characters given, expected {_LENGTH}"
        elif not (line.isascii() and line.isprintable()):
            yield index, "characters given that are no printable ASCII"
        elif line[:2] != f"{number} ":
            yield index, f"begins with {line[:2]!r}, expected '{number} ', line {number} of the set"
        elif line[-1] != str(checksum(line)):
            yield index, f"checksum {line[-1]} given, its digits make {checksum(line)}: a digit is wrong"
        elif strange := _STRANGE.search(line, _NUMBERS_FROM[index]):
            # no digit, so that the checksum does not see it
            yield index, f"{strange.group()!r} given in column {strange.start() + 1}, expected a number there"
    if lines[0][2:7] != lines[1][2:7]:
        yield 1, f"of satellite {lines[1][2:7]}, expected {lines[0][2:7]}, that of the first line"


def checksum(line: str) -> int:
    """Sum of the digits of all but the last character, a minus counting as one, modulo 10."""
    return sum(1 if c == "-" else int(c) if c in "0123456789" else 0 for c in line[: _LENGTH - 1]) % 10


def tle_findings(orbit: TleOrbit, epoch_ns: int, duration_s: float) -> Iterator[Finding]:
    """What is wrong with a set for a flight from `epoch_ns` (UTC) on; the first that forbids it ends the list."""
    for index, fault in format_faults((orbit.line1, orbit.line2)):
        yield Finding(f"orbit.tle_line{index + 1}: {fault}", refused=True)
        return
    from sgp4.api import Satrec  # here: most missions give elements and need no SGP4

    satellite = Satrec.twoline2rv(orbit.line1, orbit.line2)
    begin_day = UNIX_EPOCH_JD + epoch_ns / NANOSECONDS_PER_DAY - (satellite.jdsatepoch + satellite.jdsatepochF)
    if satellite.error or not math.isfinite(begin_day):
        yield Finding("orbit.tle_line1: SGP4 cannot read the set, expected a two-line element set", refused=True)
        return
    for finding in _age_findings(satellite, begin_day, begin_day + duration_s / 86_400.0, epoch_ns):
        yield finding
        if finding.refused:
            return
    yield from _flight_findings(orbit, epoch_ns, duration_s)


def _age_findings(satellite, begin_day: float, end_day: float, epoch_ns: int) -> Iterator[Finding]:
    """The set against both ends of the flight, in days after its own epoch."""
    farthest = max(begin_day, end_day, key=abs)
    if abs(farthest) <= DOUBTFUL_DAYS:
        return
    own = format_utc(epoch_ns - round(begin_day * NANOSECONDS_PER_DAY))[:16]
    refused = abs(farthest) > USELESS_DAYS
    limit = USELESS_DAYS if refused else DOUBTFUL_DAYS
    side = "after" if farthest > 0.0 else "before"
    yield Finding(
        f"orbit.tle_line1: the set of {own} is used up to {abs(farthest):.1f} days {side} its epoch, expected at most "
        f"{limit:g}: SGP4 loses 1 to 3 km a day and ever more; take a set of the days of the flight",
        refused,
    )


def _flight_findings(orbit: TleOrbit, epoch_ns: int, duration_s: float) -> Iterator[Finding]:
    """Does the satellite stay up until the end of the flight?"""
    samples = min(_MOST_SAMPLES, 2 + int(duration_s / _SAMPLE_S))
    elapsed_s = np.linspace(0.0, duration_s, samples)
    try:
        r_n, _ = orbit_states(orbit, epoch_ns, elapsed_s)
    except ValueError as error:
        yield Finding(f"orbit.tle_line1: {error}; the satellite has decayed, or the set is wrong", refused=True)
        return
    if not np.all(np.isfinite(r_n)):
        yield Finding("orbit.tle_line2: SGP4 gives no position, expected the elements of a satellite", refused=True)
        return
    heights = np.linalg.norm(r_n, axis=1) - EARTH_RADIUS
    lowest = int(np.argmin(heights))
    if not heights[lowest] >= LOWEST:
        yield Finding(
            f"orbit.tle_line2: the orbit comes down to {heights[lowest] / 1e3:.0f} km {elapsed_s[lowest]:.0f} s after "
            f"the mission's epoch, expected at least {LOWEST / 1e3:g} km",
            refused=True,
        )
