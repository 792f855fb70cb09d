# SPDX-License-Identifier: Apache-2.0
"""Body rate from the turning of the magnetic field: closed forms of a body that spins in a field at rest."""

import math

import numpy as np
import pytest
from cubesat import control_values
from scipy.spatial.transform import Rotation

from sunpoint_control import field_motion
from sunpoint_control.field_motion import field_now, follow_field
from sunpoint_control.held_field import HeldField

FIELD_N = np.array([2.0e-5, -1.0e-5, 3.0e-5])
ZERO = (0.0, 0.0, 0.0)
NAN = (math.nan, 0.0, 3e-5)
DT = 1.0


def parameters(*overrides):
    return field_motion.parameters(control_values(*overrides))


BALL = "spacecraft.inertia=0.02,0,0,0,0.02,0,0,0,0.02"


def field_at(omega, time):
    """The field (3,) in a body that has turned for a time [s] at a constant rate [rad/s]."""
    return tuple(Rotation.from_rotvec(np.multiply(time, omega)).inv().apply(FIELD_N).tolist())


def measured(omega, time):
    return HeldField(field_at(omega, time), True, True)


def followed(p, omega, steps, dt=DT):
    motion = field_motion.initial_state()
    for k in range(steps):
        motion = follow_field(p, motion, dt, measured(omega, k * dt), ZERO)
    return motion


@pytest.mark.parametrize("omega", [(0.01, 0.0, 0.0), (0.0, -0.02, 0.01), (0.005, 0.005, 0.03)])
def test_a_pair_gives_the_rate_across_the_field(omega):
    """b' = b x omega, so that b' x b is the rate across the middle of the two directions."""
    motion = followed(parameters(BALL), omega, 2, dt=0.1)
    b = np.divide(field_at(omega, 0.05), np.linalg.norm(FIELD_N))
    np.testing.assert_allclose(motion.derivative_b, np.cross(b, omega), atol=1e-5 * float(np.linalg.norm(omega)))
    np.testing.assert_allclose(motion.omega_bn_b, omega - b * (b @ omega), atol=1e-5 * float(np.linalg.norm(omega)))


@pytest.mark.parametrize("omega", [(0.05, 0.0, 0.0), (0.0, -0.04, 0.02), (0.03, 0.03, -0.05)])
def test_the_whole_rate_shows_as_the_field_goes_round(omega):
    """The part about the field line too, which no pair shows; without lag."""
    motion = followed(parameters(BALL), omega, 600)
    np.testing.assert_allclose(motion.omega_bn_b, omega, atol=1e-3 * float(np.linalg.norm(omega)))


def test_a_body_that_nutates_is_followed_by_eulers_equation():
    """Free motion of an axisymmetric body: the rate across its axis goes round in the body at (1 - Ia/It) w."""
    p = parameters("spacecraft.inertia=0.04,0,0,0,0.02,0,0,0,0.02", "spacecraft.array_normal=1,0,0")
    spin, across, dt = 0.05, 0.01, 0.25
    turn = (0.04 / 0.02 - 1.0) * spin
    attitude, motion = Rotation.identity(), field_motion.initial_state()
    for k in range(2400):
        field_b = tuple(attitude.inv().apply(FIELD_N).tolist())
        motion = follow_field(p, motion, dt, HeldField(field_b, True, k % 4 == 0), ZERO)
        phase = turn * (k + 0.5) * dt
        attitude = attitude * Rotation.from_rotvec(
            dt * np.array([spin, across * math.cos(phase), across * math.sin(phase)])
        )
    phase = turn * 2399 * dt
    expected = (spin, across * math.cos(phase), across * math.sin(phase))
    np.testing.assert_allclose(motion.omega_bn_b, expected, atol=0.05 * across)


def test_a_torque_of_the_rods_moves_the_rate_before_the_next_measurement():
    p = parameters(BALL)
    motion = followed(p, (0.0, 0.0, 0.02), 300)
    after = follow_field(p, motion, 0.5, HeldField(ZERO, False, False), (1e-5, 0.0, 0.0))
    np.testing.assert_allclose(
        np.subtract(after.omega_bn_b, motion.omega_bn_b), (0.5 * 1e-5 / 0.02, 0.0, 0.0), atol=1e-9
    )


def test_between_measurements_the_field_turns_with_the_body():
    omega, p = (0.0, 0.03, 0.01), parameters(BALL)
    motion = followed(p, omega, 600)
    for _ in range(3):
        motion = follow_field(p, motion, 0.25, HeldField(ZERO, True, False), ZERO)
    np.testing.assert_allclose(field_now(motion), field_at(omega, 599 * DT + 0.75), atol=1e-4 * 4e-5)


@pytest.mark.parametrize("bad", [HeldField(NAN, True, True), HeldField((2.0, 0.0, 0.0), True, True),
                                 HeldField(ZERO, True, True), HeldField(ZERO, False, False)])  # fmt: skip
def test_what_is_no_field_is_passed_over(bad):
    omega, p = (0.0, 0.03, 0.01), parameters(BALL)
    motion = followed(p, omega, 300)
    motion = follow_field(p, motion, DT, bad, ZERO)
    assert motion.known and motion.since == DT
    motion = follow_field(p, motion, DT, measured(omega, 301 * DT), ZERO)
    np.testing.assert_allclose(motion.omega_bn_b, omega, atol=1e-4)


def test_after_a_gap_all_begins_anew():
    omega, p = (0.0, 0.03, 0.01), parameters(BALL, "field.longest_gap=3.0")
    motion = followed(p, omega, 300)
    for _ in range(4):
        motion = follow_field(p, motion, DT, HeldField(ZERO, False, False), ZERO)
    assert not motion.known
    assert not follow_field(p, motion, DT, measured(omega, 0.0), ZERO).known
    again = followed(p, omega, 2)
    assert again.known
    assert again == followed(p, omega, 2)
