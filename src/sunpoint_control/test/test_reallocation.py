# SPDX-License-Identifier: Apache-2.0
"""The pseudo-inverse in closed form against numpy's, over every set of wheels in use."""

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from okeefe_spacecraft import okeefe_values

from css_common.actuator_sections import WHEELS
from css_common.vectors import mat3
from sunpoint_control.pseudo_inverse import pseudo_inverse_of
from sunpoint_control.reallocation import reallocate
from sunpoint_control.wheel_allocation import PARAMETERS, WHEEL, parameters, pseudo_inverse
from sunpoint_control.wheel_tracks import TRACK

AXES = np.asarray(okeefe_values(WHEELS).wheels.axes)


def rows(wheels):
    return np.array([wheels["mx"], wheels["my"], wheels["mz"]]).T


def tracks(gains):
    of_wheels = np.zeros(len(gains), TRACK)
    of_wheels["gain"] = gains
    return of_wheels


@pytest.mark.parametrize("out", [c for k in range(5) for c in combinations(range(4), k)])
def test_every_set_of_wheels_shares_as_numpy_says(out):
    wheels, used = parameters(okeefe_values(WHEELS + PARAMETERS)).wheels, np.zeros(4, WHEEL)
    rank = reallocate(wheels, sum(1 << i for i in out), tracks(np.ones(4)), used)
    in_use = np.where(np.isin(np.arange(4), out)[:, None], 0.0, AXES)
    np.testing.assert_allclose(rows(used), np.linalg.pinv(in_use.T), atol=1e-14)
    np.testing.assert_array_equal(rows(used), pseudo_inverse(AXES, out))
    left = AXES[[i for i in range(4) if i not in out]]
    assert rank == (np.linalg.matrix_rank(left) if len(left) else 0)
    assert not np.any(rows(used)[list(out)])


@given(
    st.lists(st.tuples(*[st.integers(-8, 8)] * 3).filter(any), min_size=1, max_size=6),
    st.floats(0.0, 6.0),
)
def test_any_axes(directions, turn):
    axes = np.array(directions, dtype=float)
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    c, s = np.cos(turn), np.sin(turn)
    axes = axes @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    m = axes.T @ axes
    singular = np.linalg.svd(axes, compute_uv=False)
    expected_rank = int(np.sum(singular > 1e-9))
    inverse, rank = pseudo_inverse_of(mat3(m))
    if singular[expected_rank - 1] > 0.02:
        assert rank == expected_rank
        np.testing.assert_allclose(inverse, np.linalg.pinv(m, rcond=1e-12, hermitian=True), rtol=1e-6, atol=1e-9)


def test_a_wheel_out_of_service_stays_out_and_a_gain_divides_its_row():
    wheels, used = parameters(okeefe_values(WHEELS + PARAMETERS, wheels_out=[1])).wheels, np.zeros(4, WHEEL)
    assert reallocate(wheels, 0, tracks([1.0, 1.0, -1.0, 0.5]), used) == 3
    expected = pseudo_inverse(AXES, [1])
    np.testing.assert_allclose(rows(used), expected / np.array([[1.0], [1.0], [-1.0], [0.5]]), atol=1e-14)
    # what the wheels then give is the torque that was asked for
    torque_b = np.array([0.01, -0.02, 0.005])
    given_torques = rows(used) @ torque_b * np.array([1.0, 1.0, -1.0, 0.5])
    np.testing.assert_allclose(AXES.T @ given_torques, torque_b, atol=1e-15)
