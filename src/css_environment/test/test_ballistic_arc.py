# SPDX-License-Identifier: Apache-2.0
"""Ballistic arcs against what is conserved, and the flight from Andoya against closed forms of the same instant."""

import math

import erfa
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from css_common.epochs import parse_utc
from css_common.mission_section import MISSION
from css_common.orbit_section import ORBIT
from css_common.schema import default_values
from css_environment.ballistic import Launch, ballistic_arc, geodetic_heights, local_direction_n
from css_environment.constants import EARTH_MU
from css_environment.earth_rotation import dcm_en_at
from css_environment.ephemeris import at, build_ephemeris
from css_environment.mission_environment import MissionEnvironment
from css_environment.orbit import orbit_states

EPOCH = parse_utc("2006-07-01T06:39:00Z")
ANDOYA = Launch(math.radians(69.29), math.radians(16.02), 0.0, math.radians(330.0), math.radians(80.0), 169e3)


@settings(max_examples=25, deadline=None)
@given(
    latitude=st.floats(-1.5, 1.5),
    longitude=st.floats(-3.1, 3.1),
    azimuth=st.floats(-3.1, 3.1),
    elevation=st.floats(0.5, math.pi / 2),
    apogee=st.floats(20e3, 1500e3),
)
@example(latitude=0.0, longitude=0.0, azimuth=-0.75, elevation=0.8515625, apogee=36519.0)
def test_the_arc_leaves_the_site_and_reaches_its_apogee(latitude, longitude, azimuth, elevation, apogee):
    launch = Launch(latitude, longitude, 300.0, azimuth, elevation, apogee)
    orbit = ballistic_arc(launch, EPOCH)
    time = np.linspace(0.0, 1500.0, 3001)
    r_n, v_n = orbit_states(orbit, EPOCH, time)
    site = erfa.gd2gc(1, longitude, latitude, 300.0)
    np.testing.assert_allclose(np.asarray(dcm_en_at(EPOCH)) @ r_n[0], site, atol=2e-3)
    potential = EARTH_MU / np.linalg.norm(r_n, axis=1)
    energy = 0.5 * np.sum(v_n**2, axis=1) - potential
    # deep in the Earth, where a shallow ellipse has its perigee, it is the small difference of large numbers
    assert np.all(np.abs(energy - energy[0]) <= 1e-11 * abs(energy[0]) + 1e-13 * potential)
    highest = int(np.argmax(np.linalg.norm(r_n, axis=1)))
    assert 0 < highest < len(time) - 1
    fine = time[highest] + np.linspace(-0.5, 0.5, 1001)
    r_n, _ = orbit_states(orbit, EPOCH, fine)
    top = [int(np.argmax(np.linalg.norm(r_n, axis=1)))]
    # in a millisecond the shallowest arc goes 5 m, over an ellipsoid that slopes by 0.3 % at most
    assert geodetic_heights(EPOCH, fine[top], r_n[top])[0] == pytest.approx(apogee, abs=0.05)


def test_the_first_step_goes_in_the_direction_of_the_launch():
    orbit = ballistic_arc(ANDOYA, EPOCH)
    (r0, r1), _ = orbit_states(orbit, EPOCH, [0.0, 0.01])
    turned = np.asarray(dcm_en_at(EPOCH, 0.01)).T @ (np.asarray(dcm_en_at(EPOCH)) @ r0)  # the site moves on
    direction = (r1 - turned) / np.linalg.norm(r1 - turned)
    np.testing.assert_allclose(direction, local_direction_n(ANDOYA, EPOCH, ANDOYA.azimuth, ANDOYA.elevation), atol=1e-4)


def test_sun_and_field_over_andoya():
    """Azimuth 104.91, elevation 30.24 deg of the Sun; IGRF at 169 km: 49 343 nT, 121.8 deg from the Sun."""
    orbit = ballistic_arc(ANDOYA, EPOCH)
    environment = at(build_ephemeris(orbit, EPOCH, span_s=400.0), 0.0)
    expected = local_direction_n(ANDOYA, EPOCH, math.radians(104.91), math.radians(30.24))
    np.testing.assert_allclose(environment.sun_n, expected, atol=3e-4)
    apogee = at(build_ephemeris(orbit, EPOCH, span_s=400.0), 188.0)
    field = np.array(apogee.field_n)
    assert np.linalg.norm(field) == pytest.approx(49_343e-9, rel=2e-3)
    between = math.degrees(math.acos(field @ apogee.sun_n / np.linalg.norm(field)))
    assert between == pytest.approx(121.8, abs=0.5)


def test_a_site_above_its_apogee_is_refused():
    with pytest.raises(ValueError, match="not above"):
        ballistic_arc(ANDOYA._replace(height=200e3), EPOCH)


def test_a_mission_may_fly_a_ballistic_arc():
    launch = {
        "latitude_deg": 69.29,
        "longitude_deg": 16.02,
        "azimuth_deg": 330.0,
        "elevation_deg": 80.0,
        "apogee": 90e3,
    }
    values = default_values(
        (*MISSION, *ORBIT),
        orbit__source="ballistic",
        mission__epoch="2006-07-01T06:39:00Z",
        **{f"orbit__launch__{key}": value for key, value in launch.items()},
    )
    environment = MissionEnvironment(values, field=False)
    radii = [np.linalg.norm(environment.at(t).r_n) for t in np.arange(0.0, 300.0, 1.0)]
    assert max(radii) - radii[0] == pytest.approx(90e3, abs=100.0)  # the ellipsoid is not quite a sphere
