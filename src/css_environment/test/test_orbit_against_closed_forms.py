# SPDX-License-Identifier: Apache-2.0
"""Orbits against Kepler's integrals, the secular rates of J2 and SGP4 itself."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sgp4.api import Satrec, jday

from css_environment.constants import EARTH_MU
from css_environment.orbit import (
    TleOrbit,
    dcm_n_teme,
    eccentric_anomaly,
    keplerian_orbit,
    orbit_period,
    orbit_states,
    secular_rates,
)

EPOCH_2013 = 1_370_044_800 * 10**9  # 2013-06-01 00:00:00 UTC
VALLADO_TLE = TleOrbit(
    "1 00005U 58002B   00179.78495062  .00000023  00000-0  28098-4 0  4753",
    "2 00005  34.2682 348.7242 1859667 331.7664  19.3264 10.82419157413667",
)


@given(
    st.floats(6.7e6, 4.2e7),
    st.floats(0.0, 0.95),
    st.floats(0.0, 180.0),
    st.tuples(*3 * [st.floats(-180.0, 360.0)]),
)
@settings(deadline=None, max_examples=100)
def test_two_body_motion_keeps_energy_momentum_and_eccentricity_vector(a, e, inclination, angles):
    orbit = keplerian_orbit(a, e, inclination, *angles)
    r, v = orbit_states(orbit, EPOCH_2013, np.linspace(0.0, 3.0 * orbit_period(orbit), 50))
    energy = 0.5 * np.sum(v * v, 1) - EARTH_MU / np.linalg.norm(r, axis=1)
    np.testing.assert_allclose(energy, -EARTH_MU / (2.0 * a), rtol=1e-9)
    momentum = np.cross(r, v)
    np.testing.assert_allclose(np.linalg.norm(momentum, axis=1), math.sqrt(EARTH_MU * a * (1 - e * e)), rtol=1e-10)
    normal = momentum / np.linalg.norm(momentum, axis=1)[:, None]
    np.testing.assert_allclose(normal[:, 2], math.cos(math.radians(inclination)), atol=1e-10)
    toward_perigee = np.cross(v, momentum) / EARTH_MU - r / np.linalg.norm(r, axis=1)[:, None]
    np.testing.assert_allclose(np.linalg.norm(toward_perigee, axis=1), e, atol=1e-8)
    np.testing.assert_allclose(toward_perigee, np.broadcast_to(toward_perigee[0], (50, 3)), atol=1e-8)


def test_elements_at_the_epoch_are_where_they_say():
    a, e = 7.2e6, 0.05
    r, v = orbit_states(keplerian_orbit(a, e, 90.0, 60.0, 0.0, 0.0), EPOCH_2013, 0.0)
    np.testing.assert_allclose(r[0], a * (1 - e) * np.array([0.5, math.sqrt(0.75), 0.0]), atol=1e-6)
    np.testing.assert_allclose(v[0], [0, 0, math.sqrt(EARTH_MU / a * (1 + e) / (1 - e))], atol=1e-9)


def test_period_at_400_km_is_the_papers():
    assert orbit_period(keplerian_orbit(6_778_137.0)) / 60.0 == pytest.approx(92.56, abs=0.005)


@given(st.floats(-50.0, 50.0), st.floats(0.0, 0.999))
def test_eccentric_anomaly_solves_keplers_equation(mean_anomaly, e):
    anomaly = float(eccentric_anomaly(mean_anomaly, e))
    assert anomaly - e * math.sin(anomaly) == pytest.approx(mean_anomaly, abs=1e-11)


def test_node_drifts_with_the_sun_on_the_clark_orbit():
    """475.047 km, 97.297 deg: 0.984 deg a day, nearly the 0.9856 of a Sun-synchronous orbit."""
    orbit = keplerian_orbit(6_853_184.0, 0.0, 97.297, 243.6, j2_drift=True)
    assert math.degrees(secular_rates(orbit)[1]) * 86400 == pytest.approx(0.984, abs=0.001)
    r, v = orbit_states(orbit, EPOCH_2013, [0.0, 86400.0])
    normal = np.cross(r, v)
    node = np.degrees(np.arctan2(normal[:, 0], -normal[:, 1]))
    assert node[1] - node[0] == pytest.approx(0.984, abs=0.005)


def test_perigee_stands_still_at_the_critical_inclination():
    critical = math.degrees(math.acos(math.sqrt(0.2)))
    assert secular_rates(keplerian_orbit(2.6e7, 0.7, critical, j2_drift=True))[2] == pytest.approx(0.0, abs=1e-18)


@pytest.mark.parametrize("j2_drift", [False, True])
def test_velocity_is_the_derivative_of_position(j2_drift):
    orbit = keplerian_orbit(7.5e6, 0.1, 50.0, 60.0, 30.0, 10.0, j2_drift)
    t = 1234.0
    r, v = orbit_states(orbit, EPOCH_2013, [t - 0.5, t, t + 0.5])
    np.testing.assert_allclose(r[2] - r[0], v[1], atol=5e-4)


def test_elements_that_are_no_ellipse_are_refused():
    with pytest.raises(ValueError, match="eccentricity"):
        keplerian_orbit(7e6, 1.0)
    with pytest.raises(ValueError, match="semi-major"):
        keplerian_orbit(-7e6)


def test_tle_states_are_sgp4s_states_rotated_to_j2000():
    jd, fraction = jday(2000, 6, 27, 18, 50, 20.0)
    epoch_ns = 962_131_820 * 10**9  # the same instant
    t = np.array([0.0, 600.0, 7200.0])
    r, v = orbit_states(VALLADO_TLE, epoch_ns, t)
    satellite = Satrec.twoline2rv(*VALLADO_TLE)
    for k, elapsed in enumerate(t):
        error, r_teme, v_teme = satellite.sgp4(jd, fraction + elapsed / 86400.0)
        assert error == 0
        dcm = dcm_n_teme(epoch_ns, t[k : k + 1])[0]
        np.testing.assert_allclose(r[k], 1e3 * dcm @ r_teme, atol=1e-2)
        np.testing.assert_allclose(v[k], 1e3 * dcm @ v_teme, atol=1e-5)


def test_teme_to_j2000_against_vallados_worked_example():
    """Vallado et al. 2006, AIAA 2006-6753, appendix C: 2004-04-06 07:51:28.386 UTC."""
    # The example applies measured nutation corrections, worth 2 m.
    epoch_ns = 1_081_237_888_386_009_000
    dcm = dcm_n_teme(epoch_ns, np.zeros(1))[0]
    r_j2000 = dcm @ [5094.18016210, 6127.64465950, 6380.34453270]
    v_j2000 = dcm @ [-4.746131487, 0.785818041, 5.531931288]
    np.testing.assert_allclose(r_j2000, [5102.50960000, 6123.01152000, 6378.13630000], atol=5e-3)
    np.testing.assert_allclose(v_j2000, [-4.7432196000, 0.7905366000, 5.5337561900], atol=5e-6)


def test_a_tle_that_sgp4_cannot_propagate_says_when():
    decayed = TleOrbit(
        "1 33333U 05037B   05333.02012661  .25992681  00000-0  24476-3 0  1534",
        "2 33333  96.4736 157.9986 9950000 244.0492 110.6523  4.00004038 10708",
    )
    with pytest.raises(ValueError, match=r"SGP4 fails .* s after the epoch"):
        orbit_states(decayed, EPOCH_2013, [0.0])
