# SPDX-License-Identifier: Apache-2.0
"""Error MRP and feedback law of O'Keefe & Schaub 2013, Eqs. 18-20: signs, limits, and the flight that follows."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from okeefe_spacecraft import okeefe_values
from scipy.integrate import solve_ivp

from css_common.attitude import mrp_rate, mrp_shadow, mrp_to_dcm
from css_common.sections import SPACECRAFT
from css_common.vectors import cross, dot, multiply, norm, unit
from sunpoint_control import mrp_sun_pointing
from sunpoint_control.mrp_sun_pointing import (
    Reference,
    damping_torque,
    error_mrp,
    integrate_error,
    pointing_torque,
    spin_reference,
    tracking_torque,
)

INERTIA = np.diag((10.5, 8.0, 6.75))
Z = (0.0, 0.0, 1.0)
component = st.floats(-1.0, 1.0)
directions = st.tuples(component, component, component).filter(lambda v: norm(v) > 0.1).map(unit)


def parameters(**changes):
    return mrp_sun_pointing.parameters(okeefe_values(SPACECRAFT + mrp_sun_pointing.PARAMETERS, **changes))


@given(directions, directions)
def test_error_is_equation_20(sun_b, normal_b):
    sigma, angle = error_mrp(sun_b, normal_b)
    axis = cross(sun_b, normal_b)
    if norm(axis) < 1e-3:
        return
    np.testing.assert_allclose(sigma, np.multiply(math.tan(angle / 4.0), unit(axis)), rtol=1e-9, atol=1e-15)
    assert angle == pytest.approx(math.acos(max(-1.0, min(1.0, dot(sun_b, normal_b)))), abs=1e-7)


@given(directions, directions)
def test_error_turns_the_reference_frame_into_the_body(sun_b, normal_b):
    """sigma_br of the frame r in which the array normal lies on the Sun: dcm_br carries its normal onto it."""
    sigma, _ = error_mrp(sun_b, normal_b)
    # components in b of the vector that r holds where b holds its array normal
    np.testing.assert_allclose(multiply(mrp_to_dcm(sigma), normal_b), sun_b, atol=1e-6)
    assert norm(sigma) <= 1.0 + 1e-12


@given(directions.filter(lambda s: 1e-3 < math.acos(s[2]) < math.pi - 1e-3))
def test_torque_turns_the_array_to_the_sun(sun_b):
    """At rest the body accelerates about the axis that moves the array normal toward the Sun."""
    sigma, _ = error_mrp(sun_b, Z)
    torque_b, _ = pointing_torque(parameters(), sigma, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    # a body-fixed vector c moves by omega x c; toward the Sun means a positive component along it
    assert dot(cross(torque_b, Z), sun_b) > 0.0


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-8, 1e-4])
def test_alignment_is_no_singularity(angle):
    sigma, error = error_mrp((math.sin(angle), 0.0, math.cos(angle)), Z)
    assert error == pytest.approx(angle, abs=1e-20)
    np.testing.assert_allclose(sigma, (0.0, -angle / 4.0, 0.0), rtol=1e-6, atol=1e-20)


@pytest.mark.parametrize("normal_b", [(0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, -1.0, 0.0), unit((1.0, 1.0, 1.0))])
def test_opposite_sun_takes_an_axis_normal_to_the_array_normal(normal_b):
    sigma, angle = error_mrp(tuple(-c for c in normal_b), normal_b)
    assert angle == pytest.approx(math.pi)
    assert norm(sigma) == pytest.approx(1.0)
    assert abs(dot(sigma, normal_b)) < 1e-12


def test_law_is_equation_18():
    """All terms, in matrices, for a reference at rest; the gyroscopic term has the paper's minus."""
    p = parameters(gains__ki=0.02)
    sigma, omega, integral, h = (0.1, -0.2, 0.05), (0.02, 0.01, -0.03), (1.0, -2.0, 0.5), (0.3, -0.1, 0.2)
    z = np.add(integral, INERTIA @ omega)
    kz = 0.02 * z
    omega_r = np.zeros(3)
    bracket = np.cross(omega_r, np.eye(3)) - np.array(
        [[0.0, -kz[2], kz[1]], [kz[2], 0.0, -kz[0]], [-kz[1], kz[0], 0.0]]
    )
    gs_us = 0.148 * np.array(sigma) + 0.9 * np.array(omega) + 0.9 * kz - bracket @ (INERTIA @ omega + h)
    torque_b, z_out = pointing_torque(p, sigma, omega, integral, h)
    np.testing.assert_allclose(torque_b, -gs_us, rtol=1e-12)
    np.testing.assert_allclose(z_out, z, rtol=1e-12)


def test_law_is_equation_18_for_a_reference_that_turns():
    """All terms, in matrices: reference rate, its acceleration, a known torque."""
    p = parameters(gains__ki=0.02, reference__known_torque=[1e-3, -2e-3, 5e-4])
    sigma, omega, integral, h = (0.1, -0.2, 0.05), (0.02, 0.01, -0.03), (1.0, -2.0, 0.5), (0.3, -0.1, 0.2)
    omega_r, acceleration = np.array((0.03, -0.01, 0.02)), np.array((1e-3, 2e-3, -1e-3))
    reference = Reference(tuple(omega_r.tolist()), tuple(acceleration.tolist()), p.known_torque_b, False)
    relative = omega - omega_r
    z = np.add(integral, INERTIA @ relative)
    kz = 0.02 * z
    gs_us = (
        -INERTIA @ (acceleration - np.cross(omega, omega_r))
        + 0.148 * np.array(sigma)
        + 0.9 * relative
        + 0.9 * kz
        - np.cross(omega_r - kz, INERTIA @ omega + h)
        + np.array(p.known_torque_b)
    )
    torque_b, z_out = tracking_torque(p, sigma, omega, integral, h, reference)
    np.testing.assert_allclose(torque_b, -gs_us, rtol=1e-12)
    np.testing.assert_allclose(z_out, z, rtol=1e-12)


def test_a_reference_at_rest_gives_the_same_bits():
    p = parameters()
    sigma, omega, integral, h = (0.1, -0.0, 0.05), (-0.0, 0.01, -0.03), (0.0, -2.0, 0.5), (0.3, -0.1, -0.0)
    reference, spin = spin_reference(p, (0.6, 0.0, -0.8), 0.0, 0.1)
    assert reference.at_rest and spin == 0.0
    general = tracking_torque(p, sigma, omega, integral, h, reference)
    assert np.array(general).tobytes() == np.array(pointing_torque(p, sigma, omega, integral, h)).tobytes()


def test_the_spin_of_the_reference_grows_as_it_is_told():
    p = parameters(reference__spin_deg_s=-2.0, reference__acceleration_deg_s2=0.5)
    spin, speeds = 0.0, []
    for _ in range(60):
        reference, spin = spin_reference(p, (0.0, 0.6, 0.8), spin, 0.1)
        np.testing.assert_allclose(reference.omega_rn_b, np.multiply(spin, (0.0, 0.6, 0.8)))
        speeds.append(math.degrees(spin))
        growing = -0.5 if len(speeds) <= 40 else 0.0
        expected = np.multiply(math.radians(growing), (0.0, 0.6, 0.8))
        np.testing.assert_allclose(reference.acceleration_b, expected, atol=1e-12)
    np.testing.assert_allclose(speeds, np.maximum(-0.05 * np.arange(1, 61), -2.0), rtol=1e-9)
    assert spin_reference(parameters(reference__spin_deg_s=1.0), Z, 0.0, 0.1)[1] == pytest.approx(math.radians(1.0))


def test_a_spin_about_the_sun_line_is_followed_without_error():
    """The feedforward carries the gyroscopic load of body and wheels: no offset is left for the integral."""
    p = parameters(gains__ki=0.0, reference__spin_deg_s=2.0, reference__acceleration_deg_s2=0.1)
    sun_n, spin_rate = np.array((0.0, 0.6, 0.8)), math.radians(2.0)

    def derivative(t, y):
        sigma, omega, h = (tuple(y[i : i + 3].tolist()) for i in (0, 3, 6))
        sun_b = tuple((np.array(mrp_to_dcm(sigma)) @ sun_n).tolist())
        acceleration = math.radians(0.1) if t < 20.0 else 0.0
        reference = Reference(
            tuple(min(math.radians(0.1) * t, spin_rate) * c for c in sun_b),
            tuple(acceleration * c for c in sun_b), (0.0, 0.0, 0.0), False,
        )  # fmt: skip
        error, _ = error_mrp(sun_b, Z)
        torque_b, _ = tracking_torque(p, error, omega, (0.0, 0.0, 0.0), h, reference)
        total = INERTIA @ omega + h
        omega_dot = np.linalg.solve(INERTIA, torque_b - np.cross(omega, total))
        return np.concatenate((mrp_rate(sigma, omega), omega_dot, np.negative(torque_b)))

    start = np.concatenate(((0.1, 0.05, -0.1), (0.0, 0.0, 0.0), (0.2, -0.3, 0.1)))
    flown = solve_ivp(derivative, (0.0, 400.0), start, rtol=1e-8, atol=1e-10, max_step=1.0).y[:, -1]
    sun_b = np.array(mrp_to_dcm(tuple(flown[:3].tolist()))) @ sun_n
    assert math.acos(min(1.0, sun_b[2])) < 1e-5
    np.testing.assert_allclose(flown[3:6], (0.0, 0.0, spin_rate), atol=1e-6)


def fly(p, sigma0, omega0, duration, momentum0=(0.0, 0.0, 0.0)):
    """Rigid body under the ideal law: wheels that give what is asked; state sigma_br, omega, int(K sigma), Gs h."""

    def derivative(_, y):
        sigma, omega, integral, h = (tuple(y[i : i + 3].tolist()) for i in (0, 3, 6, 9))
        torque_b, _ = pointing_torque(p, sigma, omega, integral, h)
        omega_dot = np.linalg.solve(INERTIA, np.add(torque_b, -np.cross(omega, INERTIA @ omega + h)))
        return np.concatenate((mrp_rate(sigma, omega), omega_dot, np.multiply(p.k, sigma), np.negative(torque_b)))

    return solve_ivp(
        derivative,
        (0.0, duration),
        np.concatenate((sigma0, omega0, np.zeros(3), momentum0)),
        rtol=1e-10,
        atol=1e-12,
        dense_output=True,
    )


@pytest.mark.parametrize("seed", range(4))
def test_lyapunov_function_of_the_paper_falls_as_it_says(seed):
    """V = w.I w/2 + 2 K ln(1 + s.s) + z.K_I z/2 and V' = -(w + K_I z).P (w + K_I z), along a simulated flight."""
    rng = np.random.default_rng(seed)
    p = parameters(gains__ki=0.01)
    sigma0 = mrp_shadow(tuple(rng.uniform(-0.6, 0.6, 3)))
    flight = fly(p, sigma0, rng.uniform(-0.035, 0.035, 3), 400.0, rng.uniform(-0.5, 0.5, 3))
    t = np.linspace(0.0, 400.0, 4001)
    y = flight.sol(t)
    sigma, omega, integral = y[0:3], y[3:6], y[6:9]
    assert np.max(np.sum(sigma**2, axis=0)) < 1.0  # no shadow switch, which the function does not know
    momentum = INERTIA @ omega
    z = integral + momentum
    v = (
        0.5 * np.sum(omega * momentum, axis=0)
        + 2.0 * p.k * np.log1p(np.sum(sigma**2, axis=0))
        + 0.5 * p.ki * np.sum(z**2, axis=0)
    )
    rate = -p.p * np.sum((omega + p.ki * z) ** 2, axis=0)
    assert np.all(np.diff(v) <= 1e-12)
    numeric = (v[2:] - v[:-2]) / (t[2:] - t[:-2])
    np.testing.assert_allclose(numeric, rate[1:-1], atol=2e-3 * np.abs(rate).max())
    assert v[-1] < 0.01 * v[0]


def test_the_other_sign_of_the_gyroscopic_term_breaks_the_lyapunov_rate():
    """Why the minus matters: with stored wheel momentum the plus leaves a term that the function cannot absorb."""
    p = parameters(gains__ki=0.01)
    sigma, omega, integral, h = (0.1, 0.2, -0.1), (0.02, -0.01, 0.03), (3.0, -1.0, 2.0), (0.5, -0.4, 0.3)
    z = np.add(integral, INERTIA @ omega)

    def lyapunov_rate(torque_b):
        omega_dot = np.linalg.solve(INERTIA, np.add(torque_b, -np.cross(omega, INERTIA @ omega + h)))
        z_dot = np.multiply(p.k, sigma) + INERTIA @ omega_dot
        return omega @ INERTIA @ omega_dot + p.k * np.dot(sigma, omega) + p.ki * z @ z_dot

    torque_b, _ = pointing_torque(p, sigma, omega, integral, h)
    expected = -p.p * np.sum((np.array(omega) + p.ki * z) ** 2)
    assert lyapunov_rate(torque_b) == pytest.approx(expected, rel=1e-12)
    flipped = np.add(torque_b, 2.0 * np.cross(p.ki * z, INERTIA @ omega + h))
    assert abs(lyapunov_rate(flipped) - expected) > 1e-3 * abs(expected)


@pytest.mark.parametrize("axis", range(3))
def test_small_errors_settle_as_the_linearised_loop(axis):
    """I th'' + P th' + K/4 th = 0 about each axis."""
    p = parameters(gains__ki=0.0)
    inertia = INERTIA[axis, axis]
    theta0 = math.radians(1.0)
    sigma0 = np.zeros(3)
    sigma0[axis] = math.tan(theta0 / 4.0)
    flight = fly(p, sigma0, np.zeros(3), 120.0)
    t = np.linspace(0.0, 120.0, 200)
    theta = 4.0 * np.arctan(flight.sol(t)[axis])
    wn = math.sqrt(p.k / 4.0 / inertia)
    zeta = p.p / (2.0 * inertia * wn)
    wd = wn * math.sqrt(1.0 - zeta**2)
    expected = theta0 * np.exp(-zeta * wn * t) * (np.cos(wd * t) + zeta * wn / wd * np.sin(wd * t))
    assert 0.059 <= wn <= 0.075 and 0.72 <= zeta <= 0.91
    np.testing.assert_allclose(theta, expected, atol=2e-4 * theta0)


def test_damping_alone_needs_no_attitude():
    p = parameters()
    np.testing.assert_allclose(
        damping_torque(p, (0.01, -0.02, 0.03), (0.0, 0.01, 0.0)), (-0.009, 0.027, -0.027), rtol=1e-12
    )


def test_integral_is_bounded():
    p = parameters(gains__integral_limit=1.0)
    integral = (0.0, 0.0, 0.0)
    for _ in range(1000):
        integral = integrate_error(p, integral, (1.0, -1.0, 0.001), 0.1)
    assert integral[:2] == (1.0, -1.0)
    assert integral[2] == pytest.approx(0.148 * 0.001 * 100.0)
