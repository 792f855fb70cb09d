# SPDX-License-Identifier: Apache-2.0
"""Starts are uniform over attitudes and rates (significance 1e-4), reproducible, and physical when dispersed."""

import math

import numpy as np
import pytest
from okeefe_spacecraft import okeefe_values
from scipy import stats

from css_common.actuator_sections import WHEELS
from css_common.attitude import mrp_to_dcm
from css_common.mission_section import MISSION
from css_common.random_streams import random_key
from css_common.sections import SPACECRAFT
from css_sim import disturbances, initial_conditions
from css_sim.rigid_body import wheel_speed

SIGNIFICANCE = 1e-4
CASES = 20_000


def build(**changes):
    return okeefe_values(
        MISSION + SPACECRAFT + WHEELS + initial_conditions.PARAMETERS + disturbances.PARAMETERS, **changes
    )


@pytest.fixture(scope="module")
def attitudes():
    return np.array([mrp_to_dcm(initial_conditions.random_attitude(random_key(3, c))) for c in range(CASES)])


def test_rotation_angles_have_the_haar_density(attitudes):
    angles = np.arccos(np.clip((np.trace(attitudes, axis1=1, axis2=2) - 1) / 2, -1, 1))
    # density (1 - cos a) / pi on [0, pi]
    assert stats.kstest(angles, lambda a: (a - np.sin(a)) / math.pi).pvalue > SIGNIFICANCE


def test_every_axis_points_everywhere_alike(attitudes):
    for i in range(3):
        for j in range(3):
            # a component of a vector uniform on the sphere is uniform (Archimedes)
            assert stats.kstest(attitudes[:, i, j], "uniform", (-1, 2)).pvalue > SIGNIFICANCE
    # azimuth of the body z axis, and of the body x axis about it
    turn = ("uniform", (-math.pi, 2 * math.pi))
    azimuths = np.arctan2(attitudes[:, 2, 1], attitudes[:, 2, 0])
    assert stats.kstest(azimuths, *turn).pvalue > SIGNIFICANCE
    clocks = np.arctan2(attitudes[:, 0, 2], attitudes[:, 1, 2])
    assert stats.kstest(clocks, *turn).pvalue > SIGNIFICANCE


def test_a_dipole_is_spread_about_its_mean():
    values = build(disturbances__dipole=[0.01, 0.0, -0.02], dispersion__dipole=0.005)
    drawn = np.array([initial_conditions.dispersed_dipole(values, random_key(3, c)) for c in range(2000)])
    for i, mean in enumerate((0.01, 0.0, -0.02)):
        assert stats.kstest(drawn[:, i], "norm", (mean, 0.005)).pvalue > SIGNIFICANCE
    assert np.abs(np.corrcoef(drawn.T) - np.eye(3)).max() < 0.1
    given = build(disturbances__dipole=[0.01, 0.0, -0.02])
    assert initial_conditions.dispersed_dipole(given, random_key(3, 1)) == (0.01, 0.0, -0.02)


def test_a_tip_off_has_its_rate_in_every_direction():
    p = initial_conditions.parameters(build(initial__rate="direction", initial__rate_deg_s=10.0))
    rates = np.array([initial_conditions.initial_state(p, random_key(3, c)).omega_bn_b for c in range(CASES)])
    np.testing.assert_allclose(np.linalg.norm(rates, axis=1), math.radians(10.0), rtol=1e-12)
    for i in range(3):
        assert stats.kstest(rates[:, i] / math.radians(10.0), "uniform", (-1, 2)).pvalue > SIGNIFICANCE
    azimuths = np.arctan2(rates[:, 1], rates[:, 0])
    assert stats.kstest(azimuths, "uniform", (-math.pi, 2 * math.pi)).pvalue > SIGNIFICANCE


def test_uniform_distribution_is_unchanged_by_a_fixed_rotation(attitudes):
    turn = np.array(mrp_to_dcm((0.2, -0.3, 0.1)))
    turned = attitudes @ turn
    angles = np.arccos(np.clip((np.trace(turned, axis1=1, axis2=2) - 1) / 2, -1, 1))
    assert stats.kstest(angles, lambda a: (a - np.sin(a)) / math.pi).pvalue > SIGNIFICANCE


def test_attitude_sets_are_inside_the_unit_ball():
    norms = [np.linalg.norm(initial_conditions.random_attitude(random_key(9, c))) for c in range(2000)]
    assert max(norms) <= 1.0


def test_rates_fill_a_cube_and_are_independent_of_the_attitude():
    p = initial_conditions.parameters(build())
    states = [initial_conditions.initial_state(p, random_key(3, c)) for c in range(5000)]
    rates = np.array([s.omega_bn_b for s in states])
    limit = math.radians(2.0)
    for i in range(3):
        assert stats.kstest(rates[:, i], "uniform", (-limit, 2 * limit)).pvalue > SIGNIFICANCE
        for j in range(3):
            sigma = [s.sigma_bn[j] for s in states]
            assert stats.pearsonr(rates[:, i], sigma).pvalue > SIGNIFICANCE
    # eight octants alike
    octants = np.bincount((rates > 0) @ [1, 2, 4], minlength=8)
    assert stats.chisquare(octants).pvalue > SIGNIFICANCE


def test_fixed_values_are_taken_as_given():
    values = build(
        initial__attitude="fixed",
        initial__sigma_bn=[0.1, -0.2, 0.3],
        initial__rate="fixed",
        initial__omega_deg_s=[1.0, 0.0, -2.0],
    )
    state = initial_conditions.initial_state(initial_conditions.parameters(values), random_key(1, 0))
    assert state.sigma_bn == (0.1, -0.2, 0.3)
    np.testing.assert_allclose(np.degrees(state.omega_bn_b), [1.0, 0.0, -2.0], rtol=1e-15)


def test_wheels_start_at_the_speeds_asked_for():
    values = build()
    body = initial_conditions.dispersed_body(values, random_key(1, 0))
    omega = (0.03, -0.02, 0.01)
    for asked, rpm in [([], [0.0] * 4), ([250.0], [250.0] * 4), ([1.0, -2.0, 3.0, 4.0], [1.0, -2.0, 3.0, 4.0])]:
        momentum = initial_conditions.initial_wheel_momentum(body, omega, asked)
        speeds = [wheel_speed(body.wheels[i], omega, momentum[i]) * 30 / math.pi for i in range(4)]
        np.testing.assert_allclose(speeds, rpm, atol=1e-9)


def test_dispersed_bodies_exist_and_spread_as_asked():
    values = build(dispersion__inertia=0.05, dispersion__wheel_torque=0.1)
    bodies = [initial_conditions.dispersed_body(values, random_key(2, c)) for c in range(1500)]
    moments = np.linalg.eigvalsh([b.inertia for b in bodies])
    assert np.all(moments[:, 2] <= (moments[:, 0] + moments[:, 1]) * (1 + 1e-12))
    # the largest moment, 10.5, is far from its bound 14.75: all three keep their normal spread
    diagonal = np.array([np.diag(b.inertia) for b in bodies])
    for i, nominal in enumerate((10.5, 8.0, 6.75)):
        assert stats.kstest(diagonal[:, i] / nominal - 1, "norm", (0, 0.05)).pvalue > SIGNIFICANCE
    torque = np.array([b.wheels["max_torque"] for b in bodies])
    assert stats.kstest(torque.ravel() / 0.03 - 1, "norm", (0, 0.1)).pvalue > SIGNIFICANCE
    for body in bodies[:100]:
        np.testing.assert_allclose(np.array(body.inertia) @ body.inertia_inverse, np.eye(3), atol=1e-14)


def test_nothing_is_dispersed_unless_asked():
    body = initial_conditions.dispersed_body(build(), random_key(2, 5))
    assert np.array_equal(body.inertia, np.diag([10.5, 8.0, 6.75]))
    assert np.all(body.wheels["max_torque"] == 0.030)
