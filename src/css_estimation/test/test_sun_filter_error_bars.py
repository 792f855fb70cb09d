# SPDX-License-Identifier: Apache-2.0
"""What an Earth that nobody predicts does to the heading of the Sun filter is part of its error bar, by geometry."""

import math

import numpy as np
import pytest
from cell_layouts import LAYOUTS
from sun_filter_flight import SunFilterFlight, outputs_of

from css_common.matrices import IDENTITY
from css_common.vectors import unit
from css_estimation.sun_filter.reported import LARGEST, by_unknown_earth
from css_estimation.sun_filter.sun_search import look_of, search

SIX = LAYOUTS["six faces"]


def parameters(layout, **values):
    return SunFilterFlight((0.0, 0.0, 1.0), **LAYOUTS[layout], **values).p


def error_matrix(p, sun_b, used=0):
    return np.reshape(by_unknown_earth(p, sun_b, used), (3, 3))


def test_three_cells_at_right_angles_show_every_direction_alike():
    p = parameters("six faces")
    e2 = p.earth.unknown_heading
    sun_b = unit((0.5, 0.6, 0.7))
    # of three axes the sum of n n^T is the identity, and that of g g^T what is left of it across the Sun line
    expected = e2 / (1.0 + e2 / (2.0 * p.earth.unknown)) * (np.eye(3) - np.outer(sun_b, sun_b))
    assert error_matrix(p, sun_b) == pytest.approx(expected, abs=1e-15)


def test_a_cell_that_faces_the_sun_shows_it_by_its_curvature_alone():
    p = parameters("six faces")
    theta2 = 2.0 * p.earth.unknown
    assert error_matrix(p, (0.0, 0.0, 1.0), 1 << 4) == pytest.approx(np.diag([theta2, theta2, 0.0]), abs=1e-15)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_it_is_the_inverse_of_what_cells_in_use_show(layout):
    p = parameters(layout)
    e2 = p.earth.unknown_heading
    dice = np.random.default_rng(5)
    normals = np.column_stack([p.cells["nx"], p.cells["ny"], p.cells["nz"]])
    for used in (0, 0b1011):
        for sun_b in dice.normal(size=(40, 3)):
            sun_b /= np.linalg.norm(sun_b)
            in_use = np.array([used == 0 or used >> i & 1 == 1 for i in range(len(normals))])
            seen = in_use & (outputs_of(p, sun_b) > 0.0)
            across = np.eye(3) - np.outer(sun_b, sun_b)
            slopes = normals[seen] @ across
            shown = slopes.T @ slopes
            shown = shown / max(1.0, np.trace(shown) / 2.0) + e2 / (2.0 * p.earth.unknown) * across
            assert error_matrix(p, tuple(sun_b), used) == pytest.approx(e2 * np.linalg.pinv(shown), abs=1e-12)


def test_without_light_of_the_earth_there_is_none_of_it():
    p = parameters("six faces", albedo__unknown=0.0, albedo__unknown_heading_deg=0.0)
    assert not error_matrix(p, (0.0, 0.0, 1.0)).any()
    p = parameters("six faces", albedo__unknown=0.0)
    assert np.trace(error_matrix(p, (0.0, 0.0, 1.0), 1 << 4)) == pytest.approx(2.0 * LARGEST)


@pytest.mark.parametrize("height_deg", [20.0, 45.0, 63.0])
def test_of_two_suns_that_cells_in_a_plane_cannot_tell_neither_wins_by_patience(height_deg):
    p = parameters("four coplanar")
    grid, height = np.zeros(500), math.radians(height_deg)
    for azimuth_deg in range(0, 90, 7):
        azimuth = math.radians(azimuth_deg)
        sun_b = np.array([math.cos(height) * math.cos(azimuth), math.cos(height) * math.sin(azimuth), math.sin(height)])
        normals = np.column_stack([p.cells["nx"], p.cells["ny"], p.cells["nz"]])
        outputs = np.maximum(normals @ sun_b, 0.0) + 0.5 * p.earth.unknown
        grid[:] = 0.0
        for k in range(600):
            share = look_of(0.1, 0.1 * k, 0.0)
            mean, variance = search(p, grid, IDENTITY, outputs, 1.0, 1.0, share)
        off = math.acos(min(1.0, abs(float(np.dot(mean, sun_b)))))
        assert off < 3.0 * math.sqrt(variance)
        assert abs(mean[2]) < math.sin(height)


def test_a_look_is_a_second_or_a_turn():
    assert sum(look_of(0.1, 0.1 * k, 0.0) for k in range(600)) == pytest.approx(1.0, abs=0.11)
    assert look_of(0.1, 30.0, 0.014) == pytest.approx(0.01)
    assert look_of(0.1, 30.0, 1.0) == pytest.approx(0.1)
