# SPDX-License-Identifier: Apache-2.0
"""Orbits against Kepler's integrals, the secular rates of J2 and SGP4 itself."""

import math

import numpy as np
import pytest
from celestial import orbit_period
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from sgp4.api import Satrec, jday

from css_environment.constants import EARTH_J2, EARTH_MU, EARTH_RADIUS
from css_environment.orbit import (
    TleOrbit,
    dcm_n_teme,
    eccentric_anomaly,
    keplerian_orbit,
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
    orbit = keplerian_orbit(6_778_137.0)
    assert orbit_period(orbit) / 60.0 == pytest.approx(92.56, abs=0.005)
    r, _ = orbit_states(orbit, EPOCH_2013, [0.0, orbit_period(orbit)])
    np.testing.assert_allclose(r[1], r[0], atol=1e-3)


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


def elements_over_anomaly(orbit, turns, samples):
    """Osculating elements under the force of J2, at steps of the mean anomaly so small that their means are exact.

    Rows: time, semi-major axis, eccentricity, inclination, node, argument of perigee, mean anomaly, the last three
    without jumps.
    """

    def force(_, x):
        r = x[:3]
        distance = np.linalg.norm(r)
        k = 1.5 * EARTH_J2 * EARTH_MU * EARTH_RADIUS**2 / distance**5
        z = 5.0 * (r[2] / distance) ** 2
        return np.concatenate((x[3:], -EARTH_MU / distance**3 * r + k * r * (z - np.array([1.0, 1.0, 3.0]))))

    r, v = orbit_states(orbit, EPOCH_2013, 0.0)
    span = turns * orbit_period(orbit)
    t = np.linspace(0.0, span, turns * samples)
    flown = solve_ivp(force, (0.0, span), np.concatenate((r[0], v[0])), "DOP853", t, rtol=1e-11, atol=1e-6).y
    r, v = flown[:3].T, flown[3:].T
    distance = np.linalg.norm(r, axis=1)
    a = 1.0 / (2.0 / distance - np.sum(v * v, 1) / EARTH_MU)
    h = np.cross(r, v)
    perigee = np.cross(v, h) / EARTH_MU - r / distance[:, None]
    e = np.linalg.norm(perigee, axis=1)
    node = np.stack((-h[:, 1], h[:, 0], np.zeros_like(t)), 1) / np.hypot(h[:, 0], h[:, 1])[:, None]
    across = np.cross(h / np.linalg.norm(h, axis=1)[:, None], node)
    argument = np.arctan2(np.sum(perigee * across, 1), np.sum(perigee * node, 1))
    eccentric = np.arctan2(np.sum(r * v, 1) / np.sqrt(EARTH_MU * a), 1.0 - distance / a)
    mean_anomaly = eccentric - e * np.sin(eccentric)
    angles = (np.unwrap(x) for x in (np.arctan2(h[:, 0], -h[:, 1]), argument, mean_anomaly))
    return np.array((t, a, e, np.arccos(h[:, 2] / np.linalg.norm(h, axis=1)), *angles))


@pytest.mark.parametrize("inclination", [20.0, 50.0, 97.3])
def test_secular_rates_are_those_of_the_motion_under_j2(inclination):
    """Node, perigee and mean anomaly drift as the integrated motion does, whose mean elements the theory is about."""
    turns, samples = 40, 400
    start = keplerian_orbit(8.0e6, 0.1, inclination, 60.0, 30.0, 10.0, j2_drift=True)
    t, a, e, i, *angles = elements_over_anomaly(start, turns, samples)
    # means over whole turns of the mean anomaly, in which the short-period terms cancel
    anomaly = angles[2]
    even = np.arange(anomaly[0], anomaly[-1], 2.0 * np.pi / samples)
    even = even[: len(even) // samples * samples]

    def over_turns(values):
        return np.interp(even, anomaly, values).reshape(-1, samples).mean(1)

    mean_a, mean_e, mean_i = (float(over_turns(x).mean()) for x in (a, e, i))
    times = over_turns(t)
    measured = [float(np.polyfit(times, over_turns(x), 1)[0]) for x in (angles[2], angles[0], angles[1])]
    mean = start._replace(semi_major_axis=mean_a, eccentricity=mean_e, inclination=mean_i)
    free = secular_rates(mean._replace(j2=0.0))
    size = 0.75 * free[0] * EARTH_J2 * (EARTH_RADIUS / (mean_a * (1.0 - mean_e**2))) ** 2
    # what the first order in J2 leaves out is of its second order
    np.testing.assert_allclose(np.subtract(measured, secular_rates(mean)) / size, 0.0, atol=0.02)


def test_positions_drift_with_the_secular_rates():
    """After whole anomalistic periods the spacecraft is at the perigee, which has turned with node and argument."""
    orbit = keplerian_orbit(8.0e6, 0.1, 50.0, 60.0, 30.0, 0.0, j2_drift=True)
    mean_motion, raan_rate, perigee_rate = secular_rates(orbit)
    t = 25.0 * 2.0 * math.pi / mean_motion
    r, _ = orbit_states(orbit, EPOCH_2013, t)
    turn = Rotation.from_euler("ZXZ", [math.radians(60.0) + raan_rate * t, math.radians(50.0), 0.0])
    argument = math.radians(30.0) + perigee_rate * t
    expected = 8.0e6 * 0.9 * turn.apply([math.cos(argument), math.sin(argument), 0.0])
    np.testing.assert_allclose(r[0], expected, atol=1e-3)


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
