# SPDX-License-Identifier: Apache-2.0
"""Momentum dumping with torque rods (Hogan & Schaub 2015): nothing of it must reach the body."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from okeefe_spacecraft import okeefe_values

from css_common.actuator_sections import RODS, WHEELS
from sunpoint_control import momentum_dumping, wheel_allocation
from sunpoint_control.momentum_dumping import add_dumping
from sunpoint_control.torque_rods import rod_dipoles, rod_torque

AXES = np.asarray(okeefe_values(WHEELS).wheels.axes)
component = st.floats(-1.0, 1.0)
vector = st.tuples(component, component, component)
fields = vector.filter(lambda b: np.linalg.norm(b) > 0.05).map(lambda b: tuple(5e-5 * c for c in b))
speed = st.floats(-600.0, 600.0)
speeds4 = st.tuples(speed, speed, speed, speed)


def parameters(**changes):
    table = WHEELS + RODS + wheel_allocation.PARAMETERS + momentum_dumping.PARAMETERS
    values = okeefe_values(table, dumping__enabled=True, rods__fitted=True, **changes)
    return momentum_dumping.parameters(values), wheel_allocation.parameters(values)


def dump(p, wheels, speeds, field_b, torques=(0.0, 0.0, 0.0, 0.0)):
    torques, dipoles = np.array(torques), np.full(len(p.rods.axes_b), np.nan)
    result = add_dumping(p, wheels, np.array(speeds), field_b, torques, dipoles)
    return torques, dipoles, result


@given(speeds4, fields, speeds4, st.floats(0.01, 30.0))
def test_net_torque_on_the_body_is_that_of_the_control_alone(speeds, field_b, control, max_dipole):
    """Also with saturated rods and with wheels near their limit."""
    p, wheels = parameters(rods__max_dipole=max_dipole)
    control = np.multiply(control, wheels.wheels["max_torque"][0] / 600.0)
    torques, dipoles, _ = dump(p, wheels, speeds, field_b, control)
    on_body = -AXES.T @ torques + np.cross(dipoles, field_b)
    np.testing.assert_allclose(on_body, -AXES.T @ control, atol=1e-15)
    assert np.abs(torques).max() <= wheels.wheels["max_torque"][0] * (1.0 + 1e-12)
    assert np.abs(dipoles).max() <= max_dipole * (1.0 + 1e-12)


@given(vector, fields)
def test_three_orthogonal_rods_have_a_closed_form(torque_b, field_b):
    """mu = B x L / B^2, which gives the part of L normal to the field."""
    torque_b = tuple(1e-3 * c for c in torque_b)
    out = np.empty(3)
    rod_dipoles(np.eye(3), torque_b, field_b, out)
    b2 = np.dot(field_b, field_b)
    np.testing.assert_allclose(out, np.cross(field_b, torque_b) / b2, rtol=1e-9, atol=1e-12)
    expected = np.subtract(torque_b, np.multiply(np.dot(torque_b, field_b) / b2, field_b))
    np.testing.assert_allclose(rod_torque(np.eye(3), out, field_b), expected, atol=1e-15)


@given(st.lists(vector, min_size=1, max_size=5), vector, fields)
def test_any_rods_equal_the_pseudo_inverse(rows, torque_b, field_b):
    axes = np.array(rows)
    length = np.linalg.norm(axes, axis=1)
    if length.min() < 0.1:
        return
    axes = axes / length[:, None]
    matrix = np.cross(axes, field_b).T  # columns g_j x B = -[B x] g_j
    singular = np.linalg.svd(matrix, compute_uv=False)
    # at the edge between ranks the pseudo-inverse itself jumps
    if singular[0] < 1e-7 or (singular.size > 1 and 1e-7 < singular[1] / singular[0] < 1e-3):
        return
    out = np.empty(len(axes))
    rod_dipoles(axes, torque_b, field_b, out)
    expected = np.linalg.pinv(matrix, rcond=1e-5) @ torque_b
    np.testing.assert_allclose(out, expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max() + 1e-9)


def test_rods_all_along_the_field_do_nothing():
    out = np.empty(2)
    rod_dipoles(np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]), (1e-3, 1e-3, 0.0), (0.0, 0.0, 4e-5), out)
    assert not np.any(out)


@pytest.mark.parametrize("reference_rpm", [0.0, 250.0])
def test_wheels_come_to_their_reference_speed_under_a_turning_field(reference_rpm):
    """Open-loop flight of a day: wheels start at 100 rad/s, the field turns with the orbit."""
    p, wheels = parameters(dumping__reference_speed_rpm=reference_rpm)
    reference = reference_rpm * np.pi / 30.0
    speeds = np.array([150.0, -80.0, 60.0, -30.0])
    start = np.abs(AXES.T @ (speeds - reference)).max()
    for t in np.arange(0.0, 20_000.0, 5.0):
        phase = 2.0 * np.pi * t / 5550.0
        field_b = (2e-5 * np.cos(phase), 3e-5 * np.sin(phase), 2e-5 * np.sin(2.0 * phase))
        torques, _, _ = dump(p, wheels, speeds, field_b)
        speeds = speeds + 5.0 * torques / wheels.wheels["inertia"]
    # the common speed of all four wheels carries no momentum and is despun without the rods
    assert np.abs(AXES.T @ (speeds - reference)).max() < 0.01 * start
    assert np.abs(speeds - reference).max() < 2.0


def test_wheels_come_to_the_momentum_that_they_shall_keep():
    """A bias as a vector in b, beside a speed that all wheels have in common."""
    bias = np.array((0.02, -0.01, 0.03))
    p, wheels = parameters(dumping__momentum=bias.tolist(), dumping__reference_speed_rpm=100.0)
    speeds = np.array([150.0, -80.0, 60.0, -30.0])
    for t in np.arange(0.0, 20_000.0, 5.0):
        phase = 2.0 * np.pi * t / 5550.0
        field_b = (2e-5 * np.cos(phase), 3e-5 * np.sin(phase), 2e-5 * np.sin(2.0 * phase))
        torques, _, _ = dump(p, wheels, speeds, field_b)
        speeds = speeds + 5.0 * torques / wheels.wheels["inertia"]
    common = 100.0 * np.pi / 30.0
    np.testing.assert_allclose(wheels.wheels["inertia"] * AXES.T @ (speeds - common), bias, atol=0.01 * 0.05)
    np.testing.assert_allclose(speeds, common + np.linalg.pinv(AXES.T) @ bias / wheels.wheels["inertia"], atol=2.0)


def test_without_field_there_is_no_dumping():
    p, wheels = parameters()
    torques, dipoles, (mask, active) = dump(p, wheels, (100.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    assert not np.any(torques) and not np.any(dipoles)
    assert (mask, active) == (0, False)


def test_a_saturated_wheel_leaves_no_room():
    p, wheels = parameters()
    full = np.full(4, -wheels.wheels["max_torque"][0])
    torques, dipoles, (_, active) = dump(p, wheels, (500.0, 400.0, 300.0, 200.0), (0.0, 3e-5, 2e-5), full)
    np.testing.assert_allclose(torques, full, rtol=1e-12)
    assert not np.any(dipoles)
    assert not active


def test_rods_report_saturation():
    p, wheels = parameters(rods__max_dipole=0.1)
    _, dipoles, (mask, active) = dump(p, wheels, (500.0, -400.0, 300.0, 200.0), (1e-5, 3e-5, 2e-5))
    assert mask != 0
    assert active
    assert np.abs(dipoles).max() == pytest.approx(0.1)


def test_a_wheel_out_of_service_stays_untouched():
    p, wheels = parameters(wheels_out=[3])
    torques, dipoles, _ = dump(p, wheels, (100.0, 50.0, -70.0, 400.0), (1e-5, 3e-5, 2e-5))
    assert torques[3] == 0.0
    np.testing.assert_allclose(-AXES.T @ torques + np.cross(dipoles, (1e-5, 3e-5, 2e-5)), 0.0, atol=1e-15)
