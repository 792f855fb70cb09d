# SPDX-License-Identifier: Apache-2.0
"""The tabulated environment against direct evaluation: orbit, Sun, field and Earth rotation."""

import math
from datetime import UTC, datetime

import erfa
import numpy as np
import ppigrf
import pytest
from celestial import sun_directions

from css_common.vectors import multiply
from css_environment.constants import ASTRONOMICAL_UNIT
from css_environment.earth_rotation import dcm_en_at
from css_environment.eclipse import conical_illumination, cylindrical_illumination
from css_environment.ephemeris import SEGMENT_S, at, build_ephemeris, segment_start
from css_environment.magnetic_field import HIGHEST_DEGREE, field_along_orbit, omitted_field
from css_environment.orbit import TleOrbit, keplerian_orbit, orbit_states

EPOCH_NS = 1_370_044_800 * 10**9
ORBITS = {
    "okeefe": keplerian_orbit(6_778_137.0, 0.0, 45.0, 60.0),
    "polar_300_km": keplerian_orbit(6_678_137.0, 0.0, 90.0, 60.0, j2_drift=True),
    "eccentric": keplerian_orbit(7_178_137.0, 0.05, 63.4, 10.0, 20.0, 30.0),
}
ISS = TleOrbit(
    "1 25544U 98067A   13151.50000000  .00009500  00000-0  16717-3 0  9995",
    "2 25544  51.6480 100.0000 0010000  90.0000 270.0000 15.50500000    05",
)


@pytest.fixture(scope="module", params=ORBITS)
def tabulated(request):
    orbit = ORBITS[request.param]
    return orbit, build_ephemeris(orbit, EPOCH_NS, SEGMENT_S)


def instants(count=400):
    return SEGMENT_S + SEGMENT_S * np.random.default_rng(1).random(count)


def test_position_velocity_and_sun(tabulated):
    orbit, ephemeris = tabulated
    t = instants()
    r, v = orbit_states(orbit, EPOCH_NS, t)
    sun, distance = sun_directions(EPOCH_NS, t, r)
    states = [at(ephemeris, float(k)) for k in t]
    assert np.abs(np.array([s.r_n for s in states]) - r).max() < 1e-3
    assert np.abs(np.array([s.v_n for s in states]) - v).max() < 1e-3
    assert np.abs(np.array([s.sun_n for s in states]) - sun).max() < 1e-9
    np.testing.assert_allclose([s.solar_flux for s in states], (ASTRONOMICAL_UNIT / distance) ** 2, rtol=1e-10)


@pytest.mark.parametrize("conical", [True, False])
def test_light_is_that_of_the_shadow_that_was_asked_for(conical):
    """Each instant of an orbit, and a sunset in steps of 0.1 s: a penumbra with the cone, none with the cylinder."""
    orbit = ORBITS["okeefe"]
    ephemeris = build_ephemeris(orbit, EPOCH_NS, field=False, conical_shadow=conical)
    coarse = np.arange(0.0, 5600.0, 20.0)
    lit = np.array([at(ephemeris, float(k)).illumination for k in coarse]) > 0.5
    dusk = coarse[np.flatnonzero(lit[:-1] & ~lit[1:])[0]]
    t = np.concatenate((coarse, np.arange(dusk - 10.0, dusk + 30.0, 0.1)))
    r, _ = orbit_states(orbit, EPOCH_NS, t)
    sun, distance = sun_directions(EPOCH_NS, t, r)
    states = [at(ephemeris, float(k)) for k in t]
    rows = zip(r.tolist(), sun.tolist(), distance.tolist(), strict=True)
    expected = [
        conical_illumination(tuple(a), tuple(b), d) if conical else cylindrical_illumination(tuple(a), tuple(b))
        for a, b, d in rows
    ]
    light = np.array([s.illumination for s in states])
    np.testing.assert_allclose(light, expected, atol=1e-5)
    between = np.count_nonzero((light > 0.0) & (light < 1.0))
    assert 60 < between < 120 if conical else between == 0
    np.testing.assert_allclose([s.solar_flux for s in states], (ASTRONOMICAL_UNIT / distance) ** 2, rtol=1e-9)


def test_tle_orbit_is_interpolated_as_well():
    """SGP4's velocity is not exactly the derivative of its position: centimetres between knots 10 s apart."""
    ephemeris = build_ephemeris(ISS, EPOCH_NS, field=False)
    t = instants() - SEGMENT_S
    r, v = orbit_states(ISS, EPOCH_NS, t)
    states = [at(ephemeris, float(k)) for k in t]
    assert np.abs(np.array([s.r_n for s in states]) - r).max() < 0.05
    assert np.abs(np.array([s.v_n for s in states]) - v).max() < 0.05


def test_field_against_ppigrf_at_the_instant(tabulated):
    """ppigrf's geodetic call at the instant's own date, through ERFA's geodetic coordinates."""
    _, ephemeris = tabulated
    for t in instants(12):
        state = at(ephemeris, float(t))
        longitude, latitude, height = erfa.gc2gd(1, np.array(multiply(state.dcm_en, state.r_n)))
        date = datetime.fromtimestamp(EPOCH_NS / 1e9 + t, tz=UTC).replace(tzinfo=None)
        east, north, up = (
            component.item()
            for component in ppigrf.igrf(math.degrees(longitude), math.degrees(latitude), height / 1e3, date)
        )
        enu = erfa.rx(math.pi / 2 - latitude, erfa.rz(math.pi / 2 + longitude, np.eye(3)))
        field_e = 1e-9 * enu.T @ [east, north, up]
        np.testing.assert_allclose(state.field_n, np.transpose(state.dcm_en) @ field_e, atol=1e-9)


def test_field_interpolation_alone(tabulated):
    orbit, ephemeris = tabulated
    t = instants()
    r, _ = orbit_states(orbit, EPOCH_NS, t)
    direct = field_along_orbit(r, t - SEGMENT_S, ephemeris.dcm_en_start, EPOCH_NS + int(SEGMENT_S * 1e9))
    states = np.array([at(ephemeris, float(k)).field_n for k in t])
    assert np.abs(states - direct).max() < 1e-10


def test_field_over_the_pole_is_continuous():
    r = np.array([[1e-3, 0.0, 6.778e6], [0.0, 0.0, 6.778e6], [0.0, 1e-3, 6.778e6]])
    field = field_along_orbit(r, np.zeros(3), np.eye(3), EPOCH_NS)
    assert np.isfinite(field).all()
    np.testing.assert_allclose(field[1], field[0], atol=1e-9)
    np.testing.assert_allclose(field[1], field[2], atol=1e-9)


def test_earth_orientation_at_the_end_of_a_segment(tabulated):
    _, ephemeris = tabulated
    end = 2.0 * SEGMENT_S
    np.testing.assert_allclose(at(ephemeris, end).dcm_en, dcm_en_at(EPOCH_NS, end), atol=2e-7)


def test_values_do_not_depend_on_when_a_segment_was_built():
    orbit = ORBITS["okeefe"]
    short = build_ephemeris(orbit, EPOCH_NS, 0.0, 600.0)
    long = build_ephemeris(orbit, EPOCH_NS, 0.0, 1200.0)
    for t in (0.0, 0.1, 299.95, 600.0):
        np.testing.assert_allclose(
            np.hstack([np.ravel(x) for x in at(short, t)]),
            np.hstack([np.ravel(x) for x in at(long, t)]),
            rtol=1e-13,
        )
    assert segment_start(0.0) == 0.0
    assert segment_start(SEGMENT_S) == SEGMENT_S
    assert segment_start(SEGMENT_S - 0.1) == 0.0


def test_segments_meet():
    orbit = ORBITS["okeefe"]
    first, second = build_ephemeris(orbit, EPOCH_NS), build_ephemeris(orbit, EPOCH_NS, SEGMENT_S)
    before, after = at(first, SEGMENT_S), at(second, SEGMENT_S)
    np.testing.assert_allclose(before.r_n, after.r_n, atol=1e-6)
    np.testing.assert_allclose(before.sun_n, after.sun_n, atol=1e-14)
    np.testing.assert_allclose(before.field_n, after.field_n, atol=2e-10)
    np.testing.assert_allclose(before.dcm_en, after.dcm_en, atol=2e-7)


def test_range_of_the_tables():
    ephemeris = build_ephemeris(ORBITS["okeefe"], EPOCH_NS, 100.0, 55.0, field=False)
    assert ephemeris.r_n.shape == (7, 3)
    assert np.all(np.isfinite(np.hstack([np.ravel(x) for x in at(ephemeris, 170.0)])))
    assert at(ephemeris, 130.0).field_n == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("degree", [4, 6, 10])
def test_what_a_short_field_model_leaves_out(degree):
    """Root mean square over the sphere, against the two models side by side."""
    directions = np.random.default_rng(3).normal(size=(4000, 3))
    places = 6_771_200.0 * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    when = (np.zeros(len(places)), np.eye(3), 1_577_836_800 * 10**9)
    off = field_along_orbit(places, *when, degree) - field_along_orbit(places, *when)
    assert omitted_field(degree) == pytest.approx(np.sqrt(np.mean(off**2)), rel=0.05)
    assert omitted_field(HIGHEST_DEGREE) == 0.0 < omitted_field(degree, 800e3) < omitted_field(degree)
