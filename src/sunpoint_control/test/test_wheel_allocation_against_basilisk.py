# SPDX-License-Identifier: Apache-2.0
"""Allocation against Basilisk's rwMotorTorque, against numpy's pseudo-inverse, and in its saturation."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from okeefe_spacecraft import okeefe_values

from css_common.actuator_sections import WHEELS
from css_common.vectors import vector_of
from sunpoint_control import wheel_allocation
from sunpoint_control.wheel_allocation import WHEEL, allocate, limit_torques, pseudo_inverse, wheel_momentum

PARITY = json.loads((Path(__file__).parent / "data" / "rw_motor_torque.json").read_text())
PAPER_AXES = np.asarray(okeefe_values(WHEELS).wheels.axes)
LIMIT = float(okeefe_values(WHEELS).wheels.max_torque)
torque = st.floats(-0.2, 0.2)


def allocation(axes=None, out=(), **changes):
    """Parameters, also for axes that are no unit vectors."""
    p = wheel_allocation.parameters(okeefe_values(WHEELS + wheel_allocation.PARAMETERS, **changes))
    axes = PAPER_AXES if axes is None else np.asarray(axes)
    wheels = np.zeros(len(axes), WHEEL)
    wheels["gx"], wheels["gy"], wheels["gz"] = axes.T
    wheels["mx"], wheels["my"], wheels["mz"] = pseudo_inverse(axes, out).T
    wheels["inertia"], wheels["max_torque"] = p.wheels["inertia"][0], p.wheels["max_torque"][0]
    return p._replace(wheels=wheels)


def allocated(p, torque_b):
    out = np.full(p.wheels.size, np.nan)
    allocate(p, vector_of(np.asarray(torque_b)), out)
    return out


@pytest.mark.parametrize("case", PARITY["cases"])
def test_parity(case):
    """Basilisk restricts torque and axes to its control axes; where the wheels cannot span them it gives up."""
    control = np.array([a for a in case["controlAxes_B"] if np.any(a)])
    away = case["wheelAvailability"] or [0] * len(PARITY["GsHat_B"])
    out = [i for i, unavailable in enumerate(away) if unavailable]
    # the same problem within the span of the control axes, which are orthonormal
    projection = control.T @ control
    p = allocation(np.array(PARITY["GsHat_B"]) @ projection, out)
    u = allocated(p, case["torqueRequestBody"])
    kept = [i for i, unavailable in enumerate(away) if not unavailable]
    if np.linalg.matrix_rank(np.array(PARITY["GsHat_B"])[kept] @ projection) < len(control):
        assert case["motorTorque"] == [0.0] * len(away)
        assert not np.any(u[out])
        return
    np.testing.assert_allclose(u, case["motorTorque"], rtol=0.0, atol=1e-15)


def test_parity_covers_what_it_should():
    assert len(PARITY["cases"]) == 40
    np.testing.assert_allclose(PARITY["GsHat_B"], PAPER_AXES, atol=1e-15)


def test_map_of_the_paper_wheels():
    """Gs Gs^T = diag(1, 2, 1), so Gs^+ = Gs^T diag(1, 1/2, 1); the null space is (1, 1, 1, 1)."""
    np.testing.assert_allclose(pseudo_inverse(PAPER_AXES), PAPER_AXES * (1.0, 0.5, 1.0), atol=1e-15)
    np.testing.assert_allclose(np.ones(4) @ PAPER_AXES, 0.0, atol=1e-15)


@given(st.tuples(torque, torque, torque))
def test_reaction_of_the_wheels_is_the_wanted_torque(torque_b):
    u = allocated(allocation(), torque_b)
    np.testing.assert_allclose(-PAPER_AXES.T @ u, torque_b, atol=1e-15)


@given(
    st.lists(st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(-1, 1)), min_size=3, max_size=9),
    st.tuples(torque, torque, torque),
    st.sets(st.integers(0, 8), max_size=2),
)
def test_any_wheels_give_the_least_norm(rows, torque_b, out):
    axes = np.array(rows)
    length = np.linalg.norm(axes, axis=1)
    if length.min() < 0.1:
        return
    axes /= length[:, None]
    out = sorted(i for i in out if i < len(axes))
    kept = [i for i in range(len(axes)) if i not in out]
    if len(kept) < 3 or np.linalg.svd(axes[kept])[1][2] < 0.05:
        return
    u = allocated(allocation(axes, out), torque_b)
    assert not np.any(u[out])
    np.testing.assert_allclose(-axes.T @ u, torque_b, atol=1e-12)
    np.testing.assert_allclose(u[kept], -np.linalg.pinv(axes[kept].T) @ torque_b, atol=1e-12)
    # any other solution is longer: the least one has no part in the null space
    null = np.linalg.svd(axes[kept].T)[2][3:]
    np.testing.assert_allclose(null @ u[kept], 0.0, atol=1e-12)


def test_two_wheels_give_the_nearest_torque_they_can():
    u = allocated(allocation(out=(2, 3)), (0.01, 0.01, 0.0))
    # wheels 0 and 1 span the y-z plane
    np.testing.assert_allclose(-PAPER_AXES.T @ u, (0.0, 0.01, 0.0), atol=1e-15)


@given(st.tuples(torque, torque, torque))
def test_scaling_keeps_the_direction_and_the_limit(torque_b):
    p = allocation()
    wanted = allocated(p, torque_b)
    u = wanted.copy()
    mask = limit_torques(p, u)
    assert np.abs(u).max() <= LIMIT * (1.0 + 1e-12)
    assert mask == sum(1 << i for i in range(4) if abs(wanted[i]) > LIMIT)
    np.testing.assert_allclose(np.cross(-PAPER_AXES.T @ u, torque_b), 0.0, atol=1e-16)
    if mask == 0:
        np.testing.assert_array_equal(u, wanted)
    else:
        assert np.abs(u).max() == pytest.approx(LIMIT)


@given(st.tuples(torque, torque, torque))
def test_clipping_is_element_wise(torque_b):
    p = allocation(wheel_saturation="clip")
    wanted = allocated(p, torque_b)
    u = wanted.copy()
    limit_torques(p, u)
    np.testing.assert_allclose(u, np.clip(wanted, -LIMIT, LIMIT), rtol=1e-15)


@pytest.mark.parametrize(("axis", "authority"), [(0, 0.0424), (1, 0.0849), (2, 0.0424)])
def test_authority_of_the_paper_wheels(axis, authority):
    """Largest torque about a body axis that the 30 mNm wheels give."""
    p = allocation()
    u = allocated(p, np.eye(3)[axis])
    limit_torques(p, u)
    assert (-PAPER_AXES.T @ u)[axis] == pytest.approx(authority, abs=5e-5)


def test_no_torque_without_authority():
    p = allocation(wheels__max_torque=0.0)
    u = allocated(p, (0.1, 0.0, 0.0))
    assert limit_torques(p, u) != 0
    assert not np.any(u)


def test_momentum_of_the_wheels_counts_the_body_rate():
    speeds = np.array([100.0, -50.0, 20.0, 7.0])
    omega = (0.1, -0.2, 0.05)
    expected = PAPER_AXES.T @ (0.001 * (speeds + PAPER_AXES @ omega))
    np.testing.assert_allclose(wheel_momentum(allocation().wheels, speeds, omega), expected, rtol=1e-12)
    assert math.isclose(np.linalg.norm(PAPER_AXES[0]), 1.0)
