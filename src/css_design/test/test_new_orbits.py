# SPDX-License-Identifier: Apache-2.0
"""Orbits of new missions against the ephemeris of the flights, and element sets that are refused."""

import math

import pytest

from css_common.epochs import parse_utc
from css_common.mission import load_mission
from css_design.errors import DesignError
from css_design.new_mission.new_mission import new_mission, read_items
from css_design.new_mission.orbits import (
    TROPICAL_YEAR,
    node_at_local_time,
    orbit_of,
    synchronous_inclination,
    tle_epoch,
    tle_lines,
)
from css_environment.constants import EARTH_J2, EARTH_MU, EARTH_RADIUS
from css_environment.mission_environment import MissionEnvironment
from css_environment.tle_checks import checksum

LINE1 = "1 25544U 98067A   24001.50000000  .00016717  00000-0  10270-3 0  9000"
LINE2 = "2 25544  51.6400 208.9163 0006317  69.9862  25.2906 15.49560532  1000"


def with_sum(line):
    return line[:68] + str(checksum(line))


SET = (with_sum(LINE1), with_sum(LINE2))


@pytest.mark.parametrize("altitude", [400e3, 600e3, 1200e3])
def test_the_node_of_a_synchronous_orbit_goes_round_in_a_year(altitude):
    axis = EARTH_RADIUS + altitude
    drift = -1.5 * EARTH_J2 * (EARTH_RADIUS / axis) ** 2 * math.sqrt(EARTH_MU / axis**3)
    assert drift * math.cos(synchronous_inclination(altitude)) * TROPICAL_YEAR == pytest.approx(2.0 * math.pi)


def test_a_known_synchronous_orbit():
    # 98.2 deg at 705 km, as the orbits of Landsat are published
    assert math.degrees(synchronous_inclination(705e3)) == pytest.approx(98.2, abs=0.05)
    with pytest.raises(DesignError, match="Sun-synchronous"):
        synchronous_inclination(7000e3)


@pytest.mark.parametrize("epoch", ["2026-06-01T00:00:00Z", "2026-12-21T09:00:00Z", "2013-03-20T11:02:00Z"])
@pytest.mark.parametrize("hours", [10.5, 22.5, 6.0])
def test_the_sun_stands_over_a_node_at_noon(epoch, hours):
    """The true Sun is off the mean one by the equation of time, 4.1 deg of right ascension at most."""
    mission = load_mission("okeefe_2013", [f"mission.epoch={epoch}", "mission.duration=10"])
    x, y, _ = MissionEnvironment(mission.node("dynamics").values, field=False).at(0.0).sun_n
    sun = math.atan2(y, x)
    apart = node_at_local_time(epoch, hours) - sun - math.radians(15.0 * (hours - 12.0))
    assert abs(math.remainder(apart, 2.0 * math.pi)) < math.radians(4.2)


def test_the_largest_equation_of_time():
    mission = load_mission("okeefe_2013", ["mission.epoch=2026-11-03T12:00:00Z", "mission.duration=10"])
    x, y, _ = MissionEnvironment(mission.node("dynamics").values, field=False).at(0.0).sun_n
    early = math.remainder(node_at_local_time("2026-11-03T12:00:00Z", 12.0) - math.atan2(y, x), 2.0 * math.pi)
    assert 4.0 * math.degrees(early) == pytest.approx(16.45, abs=0.1)  # min, the largest of the year


def test_elements_and_their_period():
    orbit = orbit_of("elements 400 51.6 20 0.01", "2026-01-01T00:00:00Z")
    assert orbit.parameters["inclination_deg"] == 51.6 and orbit.parameters["raan_deg"] == 20.0
    assert orbit.period_s == pytest.approx(92.56 * 60.0, rel=1e-3)
    assert orbit.perigee_m == pytest.approx(400e3 - 0.01 * (EARTH_RADIUS + 400e3))


def test_an_element_set_gives_epoch_and_period(tmp_path):
    file = tmp_path / "iss.tle"
    file.write_text("ISS (ZARYA)\n" + "\n".join(SET) + "\n")
    orbit = orbit_of(f"tle {file}", "auto")
    assert orbit.epoch == "2024-01-01T12:00:00Z" == tle_epoch(SET[0])
    assert orbit.period_s == pytest.approx(86_400.0 / 15.49560532)
    assert 410e3 < orbit.perigee_m < 425e3
    assert orbit_of(f"tle {file}", "2024-01-02T00:00:00Z").epoch == "2024-01-02T00:00:00Z"


BAD_SETS = {
    "digit": ((SET[0], SET[1].replace("51.6400", "51.6500")), "line 2 of the set: checksum"),
    "satellites": ((SET[0], with_sum(SET[1].replace("25544", "25545"))), "of satellite 25545, expected 25544"),
    "one": ((SET[0],), "1 first and 0 second lines"),
    "several": ((*SET, *SET), "2 first and 2 second lines"),
    "short": ((SET[0][:60], SET[1]), "60 characters given, expected 69"),
    "rubbish": (("\x00\xff",), "0 first and 0 second lines"),
}


@pytest.mark.parametrize("kind", BAD_SETS)
def test_damaged_sets_are_refused_with_the_reason(kind, tmp_path):
    lines, words = BAD_SETS[kind]
    file = tmp_path / "bad.tle"
    file.write_text("\n".join(lines), encoding="latin-1")
    with pytest.raises(DesignError, match=words):
        tle_lines(file)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("sso 500", "expected 'sso ALTITUDE_KM"),
        ("sso 500 25:00", "local time '25:00'"),
        ("sso 50 10:30", "altitude '50' given, expected 200"),
        ("elements nan 51", "altitude 'nan'"),
        ("elements 500 51 0 1.5", "eccentricity '1.5'"),
        ("circle 500", "expected 'sso"),
        ("tle missing.tle", "cannot be read"),
        ("", "expected"),
    ],
)
def test_what_is_no_orbit_is_refused(text, words):
    with pytest.raises(DesignError, match=words):
        orbit_of(text or "x", "auto")


def test_what_is_no_epoch_is_refused():
    for epoch in ("yesterday", "2026-13-01", "9999-99-99"):
        with pytest.raises(DesignError, match="--epoch"):
            orbit_of("sso 500 10:30", epoch)
    assert parse_utc(orbit_of("sso 500 10:30", "2026-02-03").epoch) == parse_utc("2026-02-03T00:00:00Z")


def test_an_epoch_that_nobody_named_is_held_against_today(tmp_path):
    file = tmp_path / "iss.tle"
    file.write_text("\n".join(SET) + "\n")

    def warnings(today, **given):
        asked, origin = read_items({"orbit": f"tle {file}", **given}, "1u")
        return new_mission("mine", asked, origin, parse_utc(today)).warnings

    (line,) = warnings("2034-01-01T12:00:00Z")
    assert line.startswith("--epoch: auto takes that of the element set, 2024-01-01T12:00:00Z, 10.0 years ago: ")
    assert line.endswith("expected a set of the days of the flight, or --epoch 2024-01-01T12:00:00Z")
    assert "100 days ahead" in warnings("2023-09-23T12:00:00Z")[0]
    assert warnings("2024-02-01T00:00:00Z") == ()
    assert warnings("2034-01-01T12:00:00Z", epoch="2024-01-01T12:00:00Z") == ()
