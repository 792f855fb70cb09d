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


def with_chord(expected, normals, sun_b, e2):
    """The same with the error on the way to the span of the cells, where they leave something open."""
    if not len(normals):
        return expected
    values, vectors = np.linalg.eigh(normals.T @ normals)
    inside = vectors[:, values >= 1e-2 * values[-1]]
    top = inside @ inside.T @ sun_b
    top /= np.linalg.norm(top)
    way = top - (top @ sun_b) * sun_b
    if inside.shape[1] == 3 or np.linalg.norm(way) < 1e-6:
        return expected
    way /= np.linalg.norm(way)
    change = np.sum((normals @ (top - sun_b)) ** 2)
    variance = np.arccos(min(1.0, top @ sun_b)) ** 2 / max(1.0, change / e2)
    return expected + max(0.0, variance - way @ expected @ way) * np.outer(way, way)


@pytest.mark.parametrize("off_deg", [2.0, 10.0, 18.0, 25.0, 40.0])
def test_light_of_three_error_bars_moves_the_sun_no_further_than_three_of_its_own(off_deg):
    """Of two cells, towards the plane in which they are: there the slope of their outputs ends."""
    p = parameters("six faces")
    sigma = math.sqrt(p.earth.unknown_heading)
    between, beside = np.array([1.0, 1.0, 0.0]) / math.sqrt(2.0), np.array([0.0, 0.0, 1.0])

    def sun_at(angle):
        return math.cos(angle) * between + math.sin(angle) * beside

    off, used = math.radians(off_deg), 0b11
    sun_b = sun_at(off)
    normals = np.column_stack([p.cells[name] for name in ("nx", "ny", "nz")])[[0, 1]]
    along = math.cos(off) * beside - math.sin(off) * between
    bar = math.sqrt(along @ error_matrix(p, tuple(sun_b), used) @ along)
    for angle in np.linspace(0.0, off, 200):
        if np.linalg.norm(normals @ (sun_at(angle) - sun_b)) <= 3.0 * sigma:
            assert off - angle <= 3.0 * bar * (1.0 + 1e-9)


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
            alike = max(1.0, np.trace(shown) / 2.0)
            expected = e2 * np.linalg.pinv(shown / alike + e2 / (2.0 * p.earth.unknown) * across)
            expected = with_chord(expected, normals[seen], sun_b, alike * e2)
            assert error_matrix(p, tuple(sun_b), used) == pytest.approx(expected, abs=1e-12)


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
