# SPDX-License-Identifier: Apache-2.0
"""Detumbling and the spin about the Sun line against closed forms, and a body that flies under them."""

import math

import numpy as np
import pytest
from cubesat import control_values
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from css_common.schema import default_values
from css_common.vectors import cross, dot, norm, unit
from sunpoint_control import magnetic_control, magnetic_spin
from sunpoint_control.held_field import HeldField
from sunpoint_control.magnetic_spin import damping_torque, detumbling_gain, spin_torque, wanted_rate
from sunpoint_control.nodes.magnetic_control import MagneticControl
from sunpoint_control.torque_rods import limit_dipoles, rod_dipoles, rod_torque

RODS = np.eye(3)
component = st.floats(-1.0, 1.0)
vectors = st.tuples(component, component, component)
directions = vectors.filter(lambda v: norm(v) > 0.1).map(unit)
ZERO = (0.0, 0.0, 0.0)
STRONG = ("rods.max_dipole=10", "rest_before_measurement=false", "magnetometer.divider=1")


def parameters(*overrides):
    return magnetic_spin.parameters(control_values(*overrides))


def test_gain_is_that_of_avanzini_and_giulietti():
    n = math.sqrt(3.986004418e14 / 6878.137e3**3)
    gain = 2.0 * n * (1.0 + math.sin(math.radians(97.4))) * 0.010
    assert parameters().damping_gain == pytest.approx(gain, rel=1e-5)
    assert parameters().spin_gain == pytest.approx(3.9 * gain, rel=1e-5)
    # the same for an orbit that is flown the other way round
    assert detumbling_gain(n, math.radians(82.6), 0.010) == pytest.approx(gain)
    assert parameters("gains.damping=2e-5").damping_gain == 2e-5


def test_gain_of_a_two_line_element_set():
    first = "1 25544U 98067A   26152.50000000  .00010000  00000-0  18000-3 0  9990"
    second = "2 25544  51.6400 100.0000 0005000 100.0000 260.0000 15.50000000    07"
    p = parameters("orbit.source=tle", f"orbit.tle_line1={first}", f"orbit.tle_line2={second}")
    n = 15.5 * 2.0 * math.pi / 86400.0
    assert p.damping_gain == pytest.approx(2.0 * n * (1.0 + math.sin(math.radians(51.64))) * 0.010)


def test_without_orbit_gains_are_asked_for():
    values = default_values(MagneticControl.table(), rods__fitted=True, gains__spin=1e-4)
    assert [line.split(":")[0] for line in magnetic_control.conflicts(values)] == ["gains.damping"]


@given(vectors, directions, st.floats(0.001, 1.0))
def test_kinetic_energy_falls_by_what_shows_across_the_field(omega, b, limit):
    """The power of the rods is -k |omega across B|^2, and not above zero with dipoles at their limit."""
    p, field_b, dipoles = parameters(), tuple(3e-5 * c for c in b), np.zeros(3)
    across = np.subtract(omega, np.multiply(dot(omega, b), b))
    rod_dipoles(RODS, damping_torque(p, tuple(across.tolist())), field_b, dipoles)
    power = dot(rod_torque(RODS, dipoles, field_b), omega)
    assert power == pytest.approx(-p.damping_gain * across @ across, rel=1e-6, abs=1e-15)
    limit_dipoles(np.full(3, limit), dipoles)
    assert np.abs(dipoles).max() <= limit * (1.0 + 1e-12)
    assert dot(rod_torque(RODS, dipoles, field_b), omega) <= 1e-18


class Flight:
    """A body under the whole control, with the true field and Sun as its measurements."""

    def __init__(self, *overrides, omega, field_n, dt, sun_n=(0.0, 0.0, 0.0)):
        self.values = control_values(*overrides, f"mission.period={dt}")
        self.p = magnetic_control.parameters(self.values)
        self.inertia = np.array(self.values.spacecraft.inertia)
        self.omega, self.attitude = np.array(omega), Rotation.identity()
        self.field_n, self.sun_n, self.dt, self.time = field_n, np.array(sun_n), dt, 0.0
        self.state = magnetic_control.initial_state(self.p)
        self.memory = magnetic_control.initial_memory(self.p)
        self.dipoles = np.zeros(3)

    def in_body(self, vector_n):
        return tuple(self.attitude.inv().apply(vector_n).tolist())

    def step(self):
        field_b = self.in_body(self.field_n(self.time))
        valid = 2 if np.any(self.sun_n) else 0
        self.state, output = magnetic_control.step(
            self.p, self.state, self.memory, self.dt, self.in_body(self.sun_n), valid, 0, ZERO, 0, np.zeros(0),
            HeldField(field_b, True, True), np.zeros(0), self.dipoles,
        )  # fmt: skip
        torque_b = np.cross(self.dipoles, field_b)
        for _ in range(2):  # midpoint rule
            half = self.omega + 0.25 * self.dt * self._acceleration(self.omega, torque_b)
            self.omega = self.omega + 0.5 * self.dt * self._acceleration(half, torque_b)
            self.attitude = self.attitude * Rotation.from_rotvec(0.5 * self.dt * half)
        self.time += self.dt
        return output

    def _acceleration(self, omega, torque_b):
        return np.linalg.solve(self.inertia, torque_b - np.cross(omega, self.inertia @ omega))

    def error_deg(self):
        return math.degrees(math.acos(np.clip(self.in_body(self.sun_n) @ self.values.spacecraft.array_normal, -1, 1)))


def test_rate_decays_as_the_closed_form_of_a_field_that_turns():
    """J w' = -k (I - b b^T)(w - q) in inertial axes; in those that turn with b at the rate q the matrix is constant."""
    moment, k, q, dt = 0.02, 2e-4, 0.01, 0.5

    def field_n(t):
        return 3e-5 * np.array([math.cos(q * t), math.sin(q * t), 0.0])

    flight = Flight(
        *STRONG, "law=detumble", f"gains.damping={k}", f"spacecraft.inertia={moment},0,0,0,{moment},0,0,0,{moment}",
        omega=(0.03, -0.05, 0.04), field_n=field_n, dt=dt,
    )  # fmt: skip
    for _ in range(800):
        flight.step()
    turning = np.array([[0.0, q, 0.0], [-q, 0.0, 0.0], [0.0, 0.0, 0.0]])
    decay = expm(400.0 * (turning - k / moment * np.diag((0.0, 1.0, 1.0)))) @ np.array([0.03, -0.05, 0.04])
    # the field's own turning is taken for a rate about its axis: that is where detumbling ends
    rest = np.array([0.0, 0.0, q]) * (1.0 - math.exp(-k / moment * 400.0))
    angle = q * 400.0
    back = np.array([[math.cos(angle), -math.sin(angle), 0.0], [math.sin(angle), math.cos(angle), 0.0], [0, 0, 1.0]])
    expected = back @ (decay + rest)
    np.testing.assert_allclose(flight.attitude.apply(flight.omega), expected, atol=0.02 * 0.07)


def test_energy_of_an_uneven_body_falls_under_b_dot():
    def field_n(t):
        return 3e-5 * np.array([math.cos(2e-3 * t), math.sin(2e-3 * t), 0.3])

    flight = Flight(*STRONG, "law=detumble", omega=(0.1, -0.08, 0.12), field_n=field_n, dt=0.5)
    energy = []
    for _ in range(1200):
        flight.step()
        energy.append(0.5 * flight.omega @ flight.inertia @ flight.omega)
    assert np.all(np.diff(energy[::20]) < 0.0)
    assert energy[-1] < 0.6 * energy[0]


@given(directions)
def test_wanted_rate_lies_between_sun_and_array_normal(sun_b):
    p = parameters("spin.rate_deg_s=3.0", "spin.alignment=0.5")
    both = math.radians(3.0) * 0.5 * np.add(sun_b, p.array_normal_b)
    np.testing.assert_allclose(wanted_rate(p, sun_b, True), both, atol=1e-15)
    np.testing.assert_allclose(wanted_rate(p, sun_b, False), np.multiply(math.radians(3.0), p.array_normal_b))
    on_sun = wanted_rate(p, p.array_normal_b, True)
    np.testing.assert_allclose(spin_torque(p, p.array_normal_b, True, on_sun), ZERO, atol=1e-18)


@given(directions.filter(lambda s: abs(s[0]) < 0.99))
def test_a_body_that_spins_as_wanted_is_precessed_to_the_sun(sun_b):
    """The torque moves the momentum along the array normal to the Sun."""
    p = parameters()
    torque_b = spin_torque(p, sun_b, True, wanted_rate(p, sun_b, False))
    across = np.subtract(sun_b, np.multiply(dot(sun_b, p.array_normal_b), p.array_normal_b))
    assert dot(torque_b, tuple(across.tolist())) > 0.0
    assert norm(cross(torque_b, tuple(np.subtract(sun_b, p.array_normal_b).tolist()))) < 1e-12


@pytest.mark.parametrize("angle_deg", [60.0, 120.0, 175.0])
def test_a_spin_goes_to_the_sun_in_a_constant_field(angle_deg):
    """Across a field at rest all of the momentum can be moved; the Sun stands there, the spin begins elsewhere."""
    sun_n = (math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg)), 0.0)
    flight = Flight(
        *STRONG, omega=(math.radians(3.0), 0.001, 0.0), sun_n=sun_n, field_n=lambda t: np.array([0, 0, 3e-5]), dt=1.0,
    )  # fmt: skip
    start = flight.error_deg()
    for _ in range(3000):
        flight.step()
    assert start == pytest.approx(angle_deg)
    assert flight.error_deg() < 2.0
    np.testing.assert_allclose(flight.omega, (math.radians(3.0), 0.0, 0.0), atol=math.radians(0.1))
