# SPDX-License-Identifier: Apache-2.0
"""Element sets and models of the environment that do not hold for a flight are refused or doubted, by key and value."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from css_common.epochs import parse_utc
from css_common.mission_section import MISSION
from css_common.orbit_section import ORBIT
from css_common.schema import shaped_values
from css_environment.magnetic_field import field_along_orbit
from css_environment.orbit import TleOrbit
from css_environment.orbit_checks import field_findings, orbit_findings, recorded_orbit_findings
from css_environment.tle_checks import checksum, tle_findings

EPOCH = parse_utc("2013-06-01T12:00:00Z")
LINE1 = "1 25544U 98067A   13152.50000000  .00006000  00000-0  11000-3 0  9998"
LINE2 = "2 25544  51.6450 100.0000 0010000  60.0000 300.0000 15.50000000832003"
DAY = 86_400 * 10**9


def with_checksum(line):
    return line[:-1] + str(checksum(line))


LINE2 = with_checksum(LINE2)


def findings(line1=LINE1, line2=LINE2, epoch_ns=EPOCH, duration_s=5550.0):
    return list(tle_findings(TleOrbit(line1, line2), epoch_ns, duration_s))


def test_checksums_of_published_sets():
    # Vallado et al. 2006, verification set: satellites 5 and 6251
    for line in (
        "1 00005U 58002B   00179.78495062  .00000023  00000-0  28098-4 0  4753",
        "2 00005  34.2682 348.7242 1859667 331.7664  19.3264 10.82419157413667",
        "1 06251U 62025E   06176.82412014  .00008885  00000-0  12808-3 0  3985",
        "2 06251  58.0579  54.0425 0030035 139.1568 221.1854 15.56387291  6774",
    ):
        assert checksum(line) == int(line[-1])


def test_a_good_set_of_the_day_passes():
    assert findings() == []


@pytest.mark.parametrize(
    ("line1", "line2", "words"),
    [
        (LINE1[:-1] + "7", LINE2, "orbit.tle_line1: checksum 7 given, its digits make 8"),
        (LINE1[:-1], LINE2, "orbit.tle_line1: 68 characters given, expected 69"),
        (LINE1, LINE2.replace("51.6450", "51.6460"), "orbit.tle_line2: checksum"),
        (LINE1, with_checksum(LINE2.replace("25544", "25545")), "orbit.tle_line2: of satellite 25545, expected 25544"),
        (LINE2, LINE1, "orbit.tle_line1: begins with '2 ', expected '1 '"),
        (LINE1.replace("U", "Ü"), LINE2, "orbit.tle_line1: characters given that are no printable ASCII"),
        (LINE1[:17] + ":" + LINE1[18:], LINE2, "orbit.tle_line1: ':' given in column 18, expected a number there"),
        ("", "", "orbit.tle_line1: 0 characters given"),
    ],
)
def test_a_set_that_is_not_what_it_says_is_refused(line1, line2, words):
    (finding,) = findings(line1, line2)
    assert finding.refused and finding.text.startswith(words)


@pytest.mark.parametrize(
    ("days", "duration_s", "expected"),
    [
        (6.0, 5550.0, []),
        (6.0, 2 * 86400.0, [False]),
        (20.0, 60.0, [False]),
        (-20.0, 60.0, [False]),
        (80.0, 60.0, [True]),
    ],
)
def test_age_of_a_set_over_the_whole_flight(days, duration_s, expected):
    found = findings(epoch_ns=EPOCH + round(days * DAY), duration_s=duration_s)
    assert [finding.refused for finding in found] == expected
    if found:
        age = abs(days) + (duration_s / 86400.0 if days > 0 else 0.0)
        assert f"used up to {age:.1f} days {'after' if days > 0 else 'before'} its epoch" in found[0].text
        assert "2013-06-01T12:00" in found[0].text


def test_a_satellite_that_comes_down_is_refused():
    still = with_checksum(LINE1.replace(" 11000-3", " 00000-0"))
    low = with_checksum(LINE2[:52] + "16.55000000" + LINE2[63:]).replace(" 0010000 ", " 0070000 ")
    (finding,) = findings(still, with_checksum(low))
    assert finding.refused and "the orbit comes down to" in finding.text and "expected at least 100 km" in finding.text
    heavy = with_checksum(LINE1.replace(" 11000-3", " 99999-1"))
    (finding,) = findings(heavy, duration_s=5 * 86400.0)
    assert finding.refused and "SGP4 fails" in finding.text and "decayed" in finding.text


@settings(max_examples=300, deadline=None)
@given(st.text(max_size=80), st.integers(0, 68), st.characters(codec="ascii"))
def test_no_text_passes_for_a_set_and_none_makes_the_checks_crash(text, place, character):
    for line1 in (text, LINE1[:place] + character + LINE1[place + 1 :]):
        for finding in findings(line1):
            assert "\n" not in finding.text and "nan" not in finding.text


def values(**changes):
    table = (*MISSION, *ORBIT)
    circle = {"orbit.source": "elements", "orbit.altitude": 400e3}
    flight = {"mission.epoch": "2013-06-01T00:00:00Z", "mission.duration": 5550.0}
    canonical = {p.name: p.default for p in table} | flight | circle | changes
    return shaped_values(table, canonical)


@pytest.mark.parametrize(
    ("epoch", "expected"),
    [("2029-12-31T00:00:00Z", []), ("2029-12-31T23:59:00Z", [False]), ("2036-01-01T00:00:00Z", [True])],
)
def test_years_of_the_field_model(epoch, expected):
    found = list(field_findings(values(**{"mission.epoch": epoch})))
    assert [finding.refused for finding in found] == expected
    assert all("2030" in finding.text and "IGRF-14" in finding.text for finding in found)


def test_beyond_its_years_the_field_stands_still_and_says_nothing(capfd):
    r_n = np.array([[7e6, 0.0, 0.0]])
    last, later = (
        field_along_orbit(r_n, np.zeros(1), np.eye(3), parse_utc(date)) for date in ("2030-01-01", "2036-05-05T12:00")
    )
    np.testing.assert_array_equal(last, later)
    assert 1e-5 < np.linalg.norm(last) < 5e-5
    assert capfd.readouterr() == ("", "")


def test_orbits_that_models_do_not_reach():
    (far,) = orbit_findings(values(**{"orbit.altitude": 4e8}))
    assert not far.refused and "the Moon" in far.text
    (outside,) = field_findings(values(**{"orbit.altitude": 8e7}))
    assert not outside.refused and "IGRF does not know" in outside.text
    assert list(orbit_findings(values())) == list(field_findings(values())) == []


def test_arcs_that_end_in_the_ground_or_are_none():
    arc = {"orbit.source": "ballistic", "mission.epoch": "2006-07-01T06:39:00Z", "mission.period": 0.1}
    arc |= {"orbit.launch.latitude_deg": 69.29, "orbit.launch.longitude_deg": 16.02, "orbit.launch.azimuth_deg": 330.0}
    arc |= {"orbit.launch.elevation_deg": 80.0, "orbit.launch.apogee": 169e3}
    assert list(orbit_findings(values(**arc, **{"mission.duration": 374.0}))) == []
    (deep,) = orbit_findings(values(**arc, **{"mission.duration": 500.0}))
    assert "km below the ground" in deep.text and math.isfinite(float(deep.text.split(" is ")[1].split()[0]))
    (none,) = orbit_findings(values(**arc | {"orbit.launch.height": 2000.0, "orbit.launch.apogee": 1500.0}))
    assert none.refused and none.text.startswith("orbit.launch.apogee")


def test_a_recording_of_another_time_than_its_element_set():
    by_set = values(**{"orbit.source": "tle", "orbit.tle_line1": LINE1, "orbit.tle_line2": LINE2})
    assert recorded_orbit_findings(by_set, EPOCH, EPOCH + DAY) == []
    (doubtful,) = recorded_orbit_findings(by_set, EPOCH + 10 * DAY, EPOCH + 11 * DAY)
    assert not doubtful.refused and "used up to 11.0 days after its epoch" in doubtful.text
    (refused,) = recorded_orbit_findings(by_set, EPOCH + 3653 * DAY, EPOCH + 3654 * DAY)
    assert refused.refused and "up to 3654.0 days after its epoch, expected at most 60" in refused.text
    assert recorded_orbit_findings(values(), EPOCH + 3653 * DAY, EPOCH + 3654 * DAY) == []
