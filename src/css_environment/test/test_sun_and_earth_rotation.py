# SPDX-License-Identifier: Apache-2.0
"""Sun and Earth orientation against the Astronomical Almanac's series, sidereal time and DE421 (skyfield)."""

import math

import numpy as np
import pytest

from css_common.vectors import multiply
from css_environment.constants import ASTRONOMICAL_UNIT, EARTH_ROTATION_RATE
from css_environment.earth_rotation import advance_dcm_en, dcm_en_at
from css_environment.sun import sun_positions

EPOCHS = {  # UTC, those of the papers and a recent one
    "1996-06-06": 834_019_200,
    "2006-07-01": 1_151_712_000,
    "2013-06-01": 1_370_044_800,
    "2026-01-01": 1_767_225_600,
}


def almanac_sun(unix_s):
    """Low-precision Sun of the Astronomical Almanac (0.01 deg), turned from the equinox of date to J2000."""
    days = unix_s / 86400.0 + 2_440_587.5 - 2_451_545.0
    anomaly = math.radians(357.528 + 0.9856003 * days)
    longitude = 280.460 + 0.9856474 * days + 1.915 * math.sin(anomaly) + 0.020 * math.sin(2 * anomaly)
    longitude = math.radians(longitude - 3.8246e-5 * days)
    distance = 1.00014 - 0.01671 * math.cos(anomaly) - 0.00014 * math.cos(2 * anomaly)
    obliquity = math.radians(23.43928)
    direction = (
        math.cos(longitude),
        math.cos(obliquity) * math.sin(longitude),
        math.sin(obliquity) * math.sin(longitude),
    )
    return np.array(direction), distance * ASTRONOMICAL_UNIT


@pytest.mark.parametrize("unix_s", EPOCHS.values(), ids=EPOCHS.keys())
def test_sun_agrees_with_the_almanac_series(unix_s):
    position = sun_positions(unix_s * 10**9, 0.0)[0]
    direction, distance = almanac_sun(unix_s)
    assert np.linalg.norm(position) == pytest.approx(distance, rel=1e-4)
    assert math.degrees(np.linalg.norm(position / np.linalg.norm(position) - direction)) < 0.02


def test_sun_of_the_papers_first_day():
    x, y, z = sun_positions(EPOCHS["2013-06-01"] * 10**9, 0.0)[0]
    assert math.degrees(math.atan2(y, x)) == pytest.approx(68.88, abs=0.02)
    assert math.degrees(math.atan2(z, math.hypot(x, y))) == pytest.approx(22.02, abs=0.02)


@pytest.mark.parametrize("unix_s", EPOCHS.values(), ids=EPOCHS.keys())
def test_earth_turns_by_sidereal_time(unix_s):
    """Greenwich mean sidereal time by the 1982 polynomial (Vallado, Eq. 3-45)."""
    dcm = np.array(dcm_en_at(unix_s * 10**9))
    centuries = (unix_s / 86400.0 + 2_440_587.5 - 2_451_545.0) / 36525.0
    gmst = 67310.54841 + (876600 * 3600 + 8640184.812866) * centuries + 0.093104 * centuries**2
    precession_in_right_ascension = 1.2812 * centuries  # [deg] general precession m, equinox of date against J2000
    angle = math.degrees(math.atan2(dcm[0, 1], dcm[0, 0]))
    difference = angle - (gmst / 240.0 - precession_in_right_ascension)
    assert abs((difference + 180.0) % 360.0 - 180.0) < 0.01
    np.testing.assert_allclose(dcm @ dcm.T, np.eye(3), atol=1e-14)
    assert math.degrees(math.acos(dcm[2, 2])) == pytest.approx(abs(0.5567 * centuries), abs=0.005)


def test_advancing_the_earth_follows_the_full_model():
    epoch_ns = EPOCHS["2013-06-01"] * 10**9
    start = dcm_en_at(epoch_ns)
    for seconds in (0.1, 600.0, 21_600.0):
        np.testing.assert_allclose(advance_dcm_en(start, seconds), dcm_en_at(epoch_ns, seconds), atol=2e-7)
    day = 2.0 * math.pi / EARTH_ROTATION_RATE
    assert day == pytest.approx(86_164.0989, abs=1e-3)
    np.testing.assert_allclose(advance_dcm_en(start, day), start, atol=1e-12)


@pytest.mark.filterwarnings("ignore:The file finals2000A")  # skyfield-data ages; its UT1 is good to a second
@pytest.mark.parametrize("unix_s", EPOCHS.values(), ids=EPOCHS.keys())
def test_sun_and_orientation_against_de421(unix_s):
    api = pytest.importorskip("skyfield.api", reason="skyfield is not installed")
    data = pytest.importorskip("skyfield_data", reason="skyfield-data is not installed")
    from skyfield.framelib import itrs

    load = api.Loader(data.get_skyfield_data_path(), expire=False, verbose=False)
    time = load.timescale(builtin=True).from_datetimes(
        [np.datetime64(unix_s, "s").astype(object).replace(tzinfo=api.utc)]
    )
    planets = load("de421.bsp")
    reference = (planets["sun"] - planets["earth"]).at(time).position.m[:, 0]
    ours = sun_positions(unix_s * 10**9, 0.0)[0]
    assert np.linalg.norm(ours - reference) < 10e3
    assert np.linalg.norm(np.cross(ours, reference)) / np.dot(ours, reference) < 5e-8
    dcm = itrs.rotation_at(time)[:, :, 0]
    for axis in np.eye(3):
        assert np.linalg.norm(multiply(dcm_en_at(unix_s * 10**9), tuple(axis)) - dcm @ axis) < 1e-4
