# SPDX-License-Identifier: Apache-2.0
"""Whatever place and date they are asked for, the models of the environment give numbers in their range."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from css_common.epochs import parse_utc
from css_environment.atmosphere import ATMOSPHERE_400_KM, air_velocity, density
from css_environment.constants import ASTRONOMICAL_UNIT, EARTH_RADIUS
from css_environment.earth_rotation import dcm_en_at
from css_environment.eclipse import conical_illumination, cylindrical_illumination
from css_environment.ephemeris import at, build_ephemeris
from css_environment.magnetic_field import field_along_orbit
from css_environment.orbit import keplerian_orbit, orbit_states
from css_environment.sun import sun_positions

ANYWHERE = st.tuples(*[st.floats(-2e8, 2e8)] * 3)
ANYTHING = st.tuples(*[st.floats()] * 3)
DIRECTIONS = ANYWHERE.filter(lambda v: math.hypot(*v) > 1.0).map(lambda v: tuple(c / math.hypot(*v) for c in v))
STAMPS = st.integers(0, 2**31 * 10**9 - 1)
LIMITS = ["1970-01-01T00:00:01", "1972-01-01", "2016-12-31T23:59:59", "2030-01-01", "2038-01-19T03:14:07"]


@settings(max_examples=300, deadline=None)
@given(ANYWHERE, DIRECTIONS)
def test_illumination_is_a_fraction_also_inside_the_earth(r_n, sun_n):
    for fraction in (
        conical_illumination(r_n, sun_n, ASTRONOMICAL_UNIT),
        cylindrical_illumination(r_n, sun_n),
    ):
        assert 0.0 <= fraction <= 1.0


@pytest.mark.parametrize("r_n", [(0.0, 0.0, 0.0), (1e-300, 0.0, 0.0), (-1.0, 0.0, 0.0), (-EARTH_RADIUS, 0.0, 0.0)])
def test_illumination_at_the_centre_and_on_the_ground(r_n):
    sun_n = (1.0, 0.0, 0.0)
    assert conical_illumination(r_n, sun_n, ASTRONOMICAL_UNIT) == (1.0 if r_n[0] >= 0.0 else 0.0)


@settings(max_examples=200, deadline=None)
@given(ANYTHING, DIRECTIONS)
def test_a_place_that_is_no_number_harms_nothing(r_n, sun_n):
    for value in (
        conical_illumination(r_n, sun_n, ASTRONOMICAL_UNIT),
        cylindrical_illumination(r_n, sun_n),
        density(ATMOSPHERE_400_KM, r_n),
    ):
        assert isinstance(value, float)  # perhaps NaN, but no exception and no hang
    assert len(air_velocity(r_n, r_n)) == 3


@settings(max_examples=200, deadline=None)
@given(ANYWHERE)
def test_density_is_finite_and_falls_with_height(r_n):
    value = density(ATMOSPHERE_400_KM, r_n)
    assert 0.0 <= value <= density(ATMOSPHERE_400_KM, (0.0, 0.0, 0.0)) < 1e-8


@settings(max_examples=60, deadline=None)
@given(STAMPS)
def test_sun_and_earth_at_any_date_that_a_stamp_can_hold(stamp_ns):
    distance = np.linalg.norm(sun_positions(stamp_ns, [0.0])) / ASTRONOMICAL_UNIT
    assert 0.983 < distance < 1.017
    dcm = np.array(dcm_en_at(stamp_ns))
    np.testing.assert_allclose(dcm @ dcm.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(dcm) == pytest.approx(1.0)


@pytest.mark.parametrize("date", LIMITS)
def test_tables_at_the_limits_of_dates(date, recwarn):
    ephemeris = build_ephemeris(keplerian_orbit(7e6, 0.01, 50.0), parse_utc(date), span_s=60.0)
    state = at(ephemeris, 30.0)
    assert math.hypot(*state.sun_n) == pytest.approx(1.0, abs=1e-12)
    assert 1e-5 < math.hypot(*state.field_n) < 6e-5
    assert 0.96 < state.solar_flux < 1.04 and 0.0 <= state.illumination <= 1.0
    assert not [warning for warning in recwarn if "dubious" in str(warning.message)]


def test_field_on_the_axis_of_the_earth_is_finite():
    r_n = np.array([[0.0, 0.0, 7e6], [0.0, 0.0, -7e6], [0.0, 7e6, 0.0]])
    field = field_along_orbit(r_n, np.zeros(3), np.eye(3), parse_utc("2013-06-01"))
    assert np.all(np.isfinite(field)) and np.all(np.linalg.norm(field, axis=1) > 1e-5)


@settings(max_examples=200, deadline=None)
@given(
    st.floats(6.4e6, 1e9), st.floats(0.0, 0.999), st.floats(0.0, 180.0), st.floats(-360.0, 360.0), st.floats(-1e8, 1e8)
)
def test_ellipses_stay_between_perigee_and_apogee(axis, eccentricity, inclination, anomaly, elapsed):
    orbit = keplerian_orbit(axis, eccentricity, inclination, true_anomaly_deg=anomaly)
    r_n, v_n = orbit_states(orbit, 0, [elapsed])
    distance = float(np.linalg.norm(r_n))
    assert axis * (1.0 - eccentricity) * (1.0 - 1e-9) <= distance <= axis * (1.0 + eccentricity) * (1.0 + 1e-9)
    assert np.all(np.isfinite(v_n))


def test_the_sun_seen_from_the_centre_of_the_earth():
    assert np.linalg.norm(sun_positions(0, [0.0])) == pytest.approx(ASTRONOMICAL_UNIT, rel=0.02)
