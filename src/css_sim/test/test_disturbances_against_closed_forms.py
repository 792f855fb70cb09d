# SPDX-License-Identifier: Apache-2.0
"""Environmental torques: symmetric bodies feel none, simple ones what a hand calculation gives."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from okeefe_spacecraft import okeefe_values

from css_common.attitude import mrp_to_dcm
from css_environment.constants import EARTH_MU, EARTH_RADIUS, EARTH_ROTATION_RATE
from css_environment.ephemeris import EnvironmentState
from css_environment.gravity_gradient import gravity_gradient_torque
from css_sim import disturbances
from css_sim.disturbances import (
    SOLAR_PRESSURE,
    aerodynamic_torque,
    conflicts,
    disturbance_torque,
    solar_pressure_torque,
)
from css_sim.rigid_body import RotationState, propagate, rigid_body

IDENTITY = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
CUBE_FACES = [s * v for axis in range(3) for s in (1.0, -1.0) for v in np.eye(3)[axis]]
INERTIA = ((10.5, 0.0, 0.0), (0.0, 8.0, 0.0), (0.0, 0.0, 6.75))
ENVIRONMENT = EnvironmentState(
    r_n=(6.778e6, 0.0, 0.0),
    v_n=(0.0, 5.4e3, 5.4e3),
    sun_n=(0.0, 0.6, 0.8),
    solar_flux=0.97,
    illumination=1.0,
    field_n=(1e-5, -2e-5, 3e-5),
    dcm_en=IDENTITY,
)


def build(**changes):
    return disturbances.parameters(okeefe_values(disturbances.PARAMETERS, **changes))


def panels(areas, normals, centres):
    return build(panels__areas=areas, panels__normals=normals, panels__centres=centres).panels


@st.composite
def directions(draw):
    z = draw(st.floats(-1, 1))
    a = draw(st.floats(-math.pi, math.pi))
    r = math.sqrt(1 - z * z)
    return (r * math.cos(a), r * math.sin(a), z)


CUBE = panels([0.5] * 6, CUBE_FACES, [0.4 * x for x in CUBE_FACES])


@given(directions())
def test_a_cube_about_its_centre_feels_neither_air_nor_sunlight(direction):
    velocity = tuple(7500.0 * x for x in direction)
    assert np.linalg.norm(aerodynamic_torque(CUBE, 2.2, velocity, 1e-11)) < 1e-18
    assert np.linalg.norm(solar_pressure_torque(CUBE, 0.3, 0.3, direction, 4.56e-6)) < 1e-20


@given(directions())
def test_equal_moments_feel_no_gravity_gradient(direction):
    inertia = ((5.0, 0.0, 0.0), (0.0, 5.0, 0.0), (0.0, 0.0, 5.0))
    assert np.linalg.norm(gravity_gradient_torque(inertia, tuple(6.8e6 * x for x in direction))) < 1e-20


@given(directions())
def test_gravity_gradient_has_no_part_along_the_vertical(direction):
    torque = gravity_gradient_torque(INERTIA, tuple(6.8e6 * x for x in direction))
    assert abs(np.dot(torque, direction)) < 1e-20


def test_gravity_gradient_at_45_deg():
    r = 6.778e6
    torque = gravity_gradient_torque(INERTIA, (0.0, r * math.sqrt(0.5), r * math.sqrt(0.5)))
    assert torque[0] == pytest.approx(1.5 * EARTH_MU / r**3 * (6.75 - 8.0), rel=1e-12)
    assert torque[1:] == (0.0, 0.0)


def test_libration_in_pitch_has_the_period_of_the_closed_form():
    # in a circular orbit the long axis swings about the vertical with w^2 = 3 n^2 (I_roll - I_yaw) / I_pitch
    roll, pitch, yaw = 12.0, 14.0, 4.0
    body = rigid_body(np.diag([roll, pitch, yaw]))
    r = 6.778e6
    n = math.sqrt(EARTH_MU / r**3)
    period = 2 * math.pi / (n * math.sqrt(3 * (roll - yaw) / pitch))
    # frame n is the orbital frame at the start, z to the centre of the Earth; it turns about y
    angle, dt = math.radians(0.5), 1.0
    state = RotationState((0.0, math.tan(angle / 4), 0.0), (0.0, n, 0.0))
    angles, t = [], 0.0
    while t < 1.2 * period:
        nadir_n = (math.sin(n * t), 0.0, math.cos(n * t))
        dcm = np.array(mrp_to_dcm(state.sigma_bn))
        nadir_b = dcm @ nadir_n
        angles.append(math.atan2(nadir_b[0], nadir_b[2]))
        torque = gravity_gradient_torque(body.inertia, tuple(-r * nadir_b))
        state, _, _ = propagate(body, state, np.zeros(0), np.zeros(0), torque, dt, np.zeros(0))
        t += dt
    crossings = [k for k in range(1, len(angles)) if angles[k - 1] * angles[k] <= 0]
    half = (crossings[1] - crossings[0]) * dt
    assert half == pytest.approx(0.5 * period, rel=2e-3)


def test_drag_on_one_offset_plate():
    plate = panels([2.0], [1.0, 0.0, 0.0], [0.0, 0.3, 0.0])
    force = 0.5 * 3e-12 * 2.2 * 7500.0**2 * 2.0
    torque = aerodynamic_torque(plate, 2.2, (7500.0, 0.0, 0.0), 3e-12)
    np.testing.assert_allclose(torque, (0.0, 0.0, 0.3 * force), rtol=1e-12)
    # inclined by 60 deg it catches half the air; from behind nothing
    v = (7500.0 * 0.5, 0.0, 7500.0 * math.sqrt(0.75))
    torque = aerodynamic_torque(plate, 2.2, v, 3e-12)
    expected = np.cross([0, 0.3, 0], -0.5 * force * np.array([0.5, 0, math.sqrt(0.75)]))
    np.testing.assert_allclose(torque, expected, rtol=1e-12)
    assert aerodynamic_torque(plate, 2.2, (-7500.0, 0.0, 0.0), 3e-12) == (0.0, 0.0, 0.0)


def test_drag_meets_the_air_that_turns_with_the_earth_at_its_altitude():
    p = build(
        disturbances__aerodynamic=True,
        panels__areas=[2.0],
        panels__normals=[0.0, 1.0, 0.0],
        panels__centres=[0.3, 0.0, 0.0],
        air__density=4e-12,
        air__altitude=400e3,
        air__scale_height=60e3,
    )
    r, v = EARTH_RADIUS + 430e3, 7600.0
    above_the_equator = ENVIRONMENT._replace(r_n=(r, 0.0, 0.0), v_n=(0.0, v, 0.0))
    wind = v - EARTH_ROTATION_RATE * r
    force = 0.5 * 4e-12 * math.exp(-0.5) * 2.2 * 2.0 * wind**2
    torque = disturbance_torque(p, INERTIA, IDENTITY, above_the_equator)
    np.testing.assert_allclose(torque, (0.0, 0.0, -0.3 * force), rtol=1e-12)


@pytest.mark.parametrize(
    ("specular", "diffuse", "factor"), [(0, 0, 1.0), (1, 0, 2.0), (0, 1, 1 + 2 / 3), (0.3, 0.2, 1.3 + 0.4 / 3)]
)
def test_sunlight_square_on_a_plate(specular, diffuse, factor):
    plate = panels([2.0], [0.0, 0.0, 1.0], [0.5, 0.0, 0.0])
    torque = solar_pressure_torque(plate, float(specular), float(diffuse), (0.0, 0.0, 1.0), 4.56e-6)
    # force along -z at x = 0.5 turns about +y
    np.testing.assert_allclose(torque, (0.0, 0.5 * factor * 4.56e-6 * 2.0, 0.0), rtol=1e-12)


def test_sunlight_on_a_slanted_mirror_pushes_along_its_normal():
    plate = panels([1.0], [0.0, 0.0, 1.0], [0.5, 0.0, 0.0])
    c = math.cos(1.0)
    torque = solar_pressure_torque(plate, 1.0, 0.0, (math.sin(1.0), 0.0, c), 4.56e-6)
    np.testing.assert_allclose(torque, (0.0, 0.5 * 2.0 * c * c * 4.56e-6, 0.0), rtol=1e-12)
    assert solar_pressure_torque(plate, 1.0, 0.0, (1.0, 0.0, -0.1), 4.56e-6) == (0.0, 0.0, 0.0)


def test_each_torque_is_an_option_and_all_add_up():
    dcm = mrp_to_dcm((0.1, 0.2, -0.3))
    shape = {"panels__areas": [1.0, 0.5], "panels__normals": [1.0, 0, 0, 0, 1.0, 0], "panels__centres": [0.1] * 6}
    shape = {k: [float(x) for x in v] for k, v in shape.items()}
    options: list[dict[str, Any]] = [
        {"disturbances__gravity_gradient": True},
        {"disturbances__aerodynamic": True},
        {"disturbances__solar_pressure": True},
        {"disturbances__dipole": [0.1, 0.0, -0.2]},
    ]
    singles = [np.array(disturbance_torque(build(**shape, **o), INERTIA, dcm, ENVIRONMENT)) for o in options]
    assert all(np.linalg.norm(t) > 1e-9 for t in singles)
    everything = {k: v for o in options for k, v in o.items()}
    total = disturbance_torque(build(**shape, **everything), INERTIA, dcm, ENVIRONMENT)
    np.testing.assert_allclose(np.array(total), sum(singles), rtol=1e-12)
    assert disturbance_torque(build(**shape), INERTIA, dcm, ENVIRONMENT) == (0.0, 0.0, 0.0)


def test_dipole_turns_like_a_compass_needle():
    dcm = mrp_to_dcm((0.1, 0.2, -0.3))
    torque = disturbance_torque(build(disturbances__dipole=[0.1, 0.0, -0.2]), INERTIA, dcm, ENVIRONMENT)
    field_b = np.array(dcm) @ ENVIRONMENT.field_n
    np.testing.assert_allclose(torque, np.cross([0.1, 0, -0.2], field_b), rtol=1e-13)


def test_no_sunlight_pressure_in_eclipse_and_less_far_from_the_sun():
    shape = {"panels__areas": [1.0], "panels__normals": [0.0, 0.6, 0.8], "panels__centres": [0.2, 0.0, 0.0]}
    p = build(**shape, disturbances__solar_pressure=True, panels__specular=0.0, panels__diffuse=0.0)
    dark = ENVIRONMENT._replace(illumination=0.0)
    assert disturbance_torque(p, INERTIA, IDENTITY, dark) == (0.0, 0.0, 0.0)
    half = disturbance_torque(p, INERTIA, IDENTITY, ENVIRONMENT._replace(illumination=0.5))
    force = -0.5 * 0.97 * SOLAR_PRESSURE * np.array([0.0, 0.6, 0.8])
    np.testing.assert_allclose(half, np.cross([0.2, 0, 0], force), rtol=1e-12)


def test_conflicts_are_named():
    values = okeefe_values(
        disturbances.PARAMETERS,
        disturbances__aerodynamic=True,
        panels__normals=[1.0, 1.0, 0.0],
        panels__specular=0.7,
        panels__diffuse=0.5,
    )
    found = "\n".join(conflicts(values))
    for part in ("panels.normals: 1 rows", "row 0 has length 1.41421", "1.2 given", "without panels"):
        assert part in found
    assert list(conflicts(okeefe_values(disturbances.PARAMETERS))) == []
