# SPDX-License-Identifier: Apache-2.0
"""Inertia and plates of a box with panels against sums over many small masses, and words for directions."""

import math

import numpy as np
import pytest

from css_design.errors import DesignError
from css_design.new_mission.body import PANEL_DENSITY, inertia_of, panels_of, plates_of
from css_design.new_mission.directions import direction

SIZE = (0.1, 0.2, 0.34)


def points_of_box(extent, count=24):
    axes = [(np.arange(count) + 0.5) / count * e - 0.5 * e if e else np.zeros(1) for e in extent]
    return np.stack([a.ravel() for a in np.meshgrid(*axes, indexing="ij")], axis=1)


def summed_inertia(masses_and_points):
    points = np.concatenate([p for _, p in masses_and_points])
    masses = np.concatenate([np.full(len(p), m / len(p)) for m, p in masses_and_points])
    middle = masses @ points / masses.sum()
    off = points - middle
    squares = np.sum(off**2, axis=1)
    return np.einsum(
        "i,ijk->jk", masses, squares[:, None, None] * np.eye(3) - off[:, :, None] * off[:, None, :]
    ), middle


def test_a_box_has_the_inertia_of_a_box():
    inertia, centre = inertia_of(SIZE, 6.0, ())
    a, b, c = SIZE
    assert np.allclose(inertia, np.diag([b * b + c * c, a * a + c * c, a * a + b * b]) * 0.5, rtol=1e-12)
    assert np.allclose(centre, 0.0)


def test_panels_add_their_masses_where_they_are():
    panels = panels_of("+y:+x:0.3 -z:+x:0.2:2")
    inertia, centre = inertia_of(SIZE, 6.0, panels)
    first, second = PANEL_DENSITY * 0.3 * 0.34, PANEL_DENSITY * 0.2 * 0.2
    parts = [
        (6.0 - first - second, points_of_box(SIZE)),
        (first, points_of_box((0.0, 0.3, 0.34)) + np.array([0.05, 0.25, 0.0])),
        (second, points_of_box((0.0, 0.2, 0.2)) + np.array([0.05, 0.0, -0.27])),
    ]
    summed, middle = summed_inertia(parts)
    assert np.allclose(inertia, summed, rtol=3e-3, atol=1e-6)  # of small cubes, each with an inertia of its own
    assert np.allclose(centre, -middle, atol=1e-9)


def test_plates_close_the_box_and_have_two_sides_each():
    panels = panels_of("+y:+x:0.3")
    plates = plates_of(SIZE, np.array([0.0, -0.01, 0.0]), panels)
    # nothing pushes a closed surface in a uniform pressure
    assert np.allclose(plates.areas @ plates.normals, 0.0)
    assert len(plates.areas) == 8
    assert plates.areas[6] == pytest.approx(0.3 * 0.34)
    assert np.allclose(plates.centres[6], (0.05, 0.24, 0.0))
    assert np.allclose(plates.centres[0], (0.05, -0.01, 0.0))


@pytest.mark.parametrize(
    "word",
    ["+y:+x", "+y:+y:0.3", "+q:+x:0.3", "+y:0/1/1:0.3", "+y:+x:-1", "+y:+x:nan", "+y:+x:0.3:99", "+y:+x:0.3:1:2"],
)
def test_what_is_no_panel_is_refused(word):
    with pytest.raises(DesignError, match=r"--panels: .*expected"):
        panels_of(word)


def test_panels_heavier_than_half_the_spacecraft_are_refused():
    with pytest.raises(DesignError, match=r"--panels: .* kg at 3 kg/m\^2, expected at most 50%"):
        inertia_of(SIZE, 1.0, panels_of("+y:+x:2"))


def test_directions():
    assert direction("-z") == (0.0, 0.0, -1.0)
    assert direction("3/0/4") == (0.6, 0.0, 0.8)
    assert math.hypot(*direction("1/1/1")) == pytest.approx(1.0, abs=1e-15)
    for word in ("", "z", "1/2", "0/0/0", "nan/0/1", "inf/0/1", "1/2/3/4"):
        with pytest.raises(DesignError, match="expected a face"):
            direction(word)
