# SPDX-License-Identifier: Apache-2.0
"""The integrated orbit against scipy's integrator, what J2 conserves, and the short periods of its theory."""

import math

import numpy as np
import pytest
from celestial import orbit_period
from scipy.integrate import solve_ivp

from css_common.mission import load_mission
from css_environment.constants import EARTH_J2, EARTH_MU, EARTH_RADIUS
from css_environment.j2_integration import LEG_STEPS, STEP_S, energy
from css_environment.mission_environment import MissionEnvironment
from css_environment.orbit import IntegratedOrbit, keplerian_orbit, orbit_states, secular_rates

LOW = keplerian_orbit(6_778_137.0, 0.0, 45.0, 60.0)
LONG = keplerian_orbit(1.0e7, 0.33, 116.6, 30.0, 80.0, 10.0)
DAY = 86_400.0


def integrated(orbit, elapsed_s):
    return orbit_states(IntegratedOrbit(orbit), 0, elapsed_s)


def potential(r):
    """Of the Earth with J2 [m^2/s^2], for complex positions too."""
    distance = np.sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2])
    legendre = 1.5 * (r[2] / distance) ** 2 - 0.5
    return -EARTH_MU / distance * (1.0 - EARTH_J2 * (EARTH_RADIUS / distance) ** 2 * legendre)


def force(_, x):
    """Minus the gradient of the potential, by complex steps."""
    steps = 1e-20j * np.eye(3)
    return np.concatenate([x[3:], [-potential(x[:3] + step).imag / 1e-20 for step in steps]])


@pytest.mark.parametrize("orbit", [LOW, LONG], ids=["400 km", "eccentric and retrograde"])
def test_motion_is_that_of_another_integrator(orbit):
    t = np.linspace(0.0, 3.0 * orbit_period(orbit), 40)
    r, v = orbit_states(orbit, 0, 0.0)  # elements are osculating at the epoch
    flown = solve_ivp(force, (0.0, t[-1]), [*r[0], *v[0]], "DOP853", t, rtol=1e-13, atol=1e-8).y
    r, v = integrated(orbit, t)
    np.testing.assert_allclose(r, flown[:3].T, atol=2e-3)
    np.testing.assert_allclose(v, flown[3:].T, atol=2e-6)


@pytest.mark.parametrize("orbit", [LOW, LONG], ids=["400 km", "eccentric and retrograde"])
def test_energy_and_momentum_about_the_pole_stay(orbit):
    r, v = integrated(orbit, np.arange(0.0, DAY, 97.3))
    np.testing.assert_allclose(energy(r, v), energy(r, v)[0], rtol=1e-11)
    h = np.cross(r, v)
    np.testing.assert_allclose(h[:, 2], h[0, 2], rtol=1e-11)
    two_body = 0.5 * np.sum(v * v, 1) - EARTH_MU / np.linalg.norm(r, axis=1)
    assert np.ptp(two_body) > 1e-4 * abs(two_body[0])


def test_the_radius_swings_twice_a_revolution():
    """A circle under J2: J2 R^2 / (4 a) sin^2 i cos 2u about its mean (Kozai 1959), 1.6 km at 45 deg."""
    r, v = integrated(LOW, np.arange(0.0, 20.0 * orbit_period(LOW), 20.0))
    distance = np.linalg.norm(r, axis=1)
    h = np.cross(r, v)
    node = np.stack((-h[:, 1], h[:, 0], np.zeros(len(h))), 1)
    node /= np.linalg.norm(node, axis=1)[:, None]
    across = np.cross(h / np.linalg.norm(h, axis=1)[:, None], node)
    u = np.arctan2(np.sum(r * across, 1), np.sum(r * node, 1))
    columns = [np.ones_like(u), np.cos(u), np.sin(u), np.cos(2 * u), np.sin(2 * u)]
    mean, _, _, twice, quarter = np.linalg.lstsq(np.stack(columns, 1), distance, rcond=None)[0]
    expected = 0.25 * EARTH_J2 * EARTH_RADIUS**2 / mean * math.sin(LOW.inclination) ** 2
    assert twice == pytest.approx(expected, rel=0.01)
    assert abs(quarter) < 0.01 * expected


def test_the_node_drifts_as_in_the_secular_theory():
    r, v = integrated(LOW, np.array([0.0, 16.0 * orbit_period(LOW)]))
    h = np.cross(r, v)
    node = np.unwrap(np.arctan2(h[:, 0], -h[:, 1]))
    rate = secular_rates(LOW._replace(j2=EARTH_J2))[1]
    assert node[1] - node[0] == pytest.approx(rate * 16.0 * orbit_period(LOW), rel=0.01)


def test_an_instant_is_the_same_whatever_was_asked_for_before():
    leg_s = LEG_STEPS * STEP_S
    times = np.array([-20.0, 0.0, 0.3, 7.0, 4321.9, leg_s - 0.5, leg_s, leg_s + 10.0, 2.5 * leg_s])
    all_r, all_v = integrated(LOW, times)
    order = np.array([8, 3, 0, 6, 2, 5, 1, 7, 4])
    other = keplerian_orbit(6_778_137.0, 0.0, 45.0, 60.0 - 360.0)  # the same, and not in the cache of the first
    for i in order:
        r, v = integrated(LOW, times[i])
        np.testing.assert_array_equal((r[0], v[0]), (all_r[i], all_v[i]))
    np.testing.assert_allclose(integrated(other, times[order])[0], all_r[order], atol=1e-3)


def test_times_before_the_epoch_are_reached_backward():
    r, v = integrated(LOW, np.array([-30.0, 0.0, 30.0]))
    flown = solve_ivp(force, (0.0, -30.0), [*r[1], *v[1]], "DOP853", rtol=1e-13, atol=1e-8).y[:, -1]
    np.testing.assert_allclose(np.concatenate((r[0], v[0])), flown, atol=1e-5)


def test_the_truth_alone_may_be_integrated():
    """A section of one node: flight software goes on by elements that drift, and is off by tens of kilometres."""
    mission = load_mission("okeefe_sun_filter", ["dynamics.orbit.model=j2_integrated", "orbit.j2=true"])
    true, known = (
        MissionEnvironment(mission.node(name).values, field=False).at(5550.0) for name in ("dynamics", "sun_filter")
    )
    assert 40e3 < np.linalg.norm(np.subtract(true.r_n, known.r_n)) < 50e3
    mission = load_mission("okeefe_sun_filter", ["orbit.model=j2_integrated"])
    same = MissionEnvironment(mission.node("sun_filter").values, field=False).at(5550.0)
    assert same.r_n == true.r_n
