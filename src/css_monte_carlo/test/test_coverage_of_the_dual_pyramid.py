# SPDX-License-Identifier: Apache-2.0
"""Coverage of the eight cells of O'Keefe & Schaub 2013, to the last digit of an independent numpy computation.

Also anchored to the paper's text: a band near the equator with errors above 30 deg, and errors below 10 deg
within 19 deg of the array normal.
"""

import numpy as np
import pytest
from okeefe_spacecraft import okeefe_values

from css_estimation.nodes.wavg import Wavg
from css_monte_carlo.coverage import grid_about, layout_of, map_cells
from css_monte_carlo.coverage_statistics import holes, seen_fractions, wavg_errors
from css_sim.nodes.css_array import CssArray

Z = (0.0, 0.0, 1.0)


def layout(**changes):
    """The default layout with changes to its cells, or to the gate of the average."""
    gate = {name: changes.pop(name) for name in ("gate", "gate_kind") if name in changes}
    return layout_of(okeefe_values(CssArray.table(), **changes), okeefe_values(Wavg.table(), **changes, **gate))


@pytest.fixture(scope="module")
def grid():
    return grid_about(Z)


@pytest.fixture(scope="module")
def ideal(grid):
    return map_cells(layout(), grid)


@pytest.fixture(scope="module")
def warped(grid):
    return map_cells(layout(), grid, warp=True)


@pytest.fixture(scope="module", params=["ideal", "warped"])
def both(request, grid):
    return request.param, wavg_errors(grid, request.getfixturevalue(request.param))


def percent(fractions):
    return [f"{100.0 * fraction:.2f}" for fraction in fractions]


def test_share_of_the_sphere_by_cells_in_view(grid, ideal, warped):
    assert percent(seen_fractions(grid, ideal)) == ["0.00", "35.08", "51.45", "9.38", "4.08"]
    np.testing.assert_array_equal(ideal.seen_by, warped.seen_by)
    assert holes(grid, ideal) == []


def test_the_same_without_the_clipping_plane(grid):
    result = map_cells(layout(cells__clip_normal=(0.0, 0.0, 0.0)), grid)
    assert percent(seen_fractions(grid, result)) == ["0.00", "17.53", "69.00", "9.38", "4.08"]


def test_mean_and_largest_error(both):
    kind, errors = both
    assert f"{errors.mean_deg:.2f}" == {"ideal": "23.84", "warped": "23.87"}[kind]
    assert f"{errors.max_deg:.1f}" == "59.7"


def test_large_errors(both):
    kind, errors = both
    assert f"{100.0 * errors.fraction_above_30:.2f}" == {"ideal": "35.91", "warped": "35.75"}[kind]
    # rings of the grid lie at 0.125 + 0.25 k deg
    assert errors.polar_max_above_30 == pytest.approx((65.375, 114.625))
    mean_limits = {"ideal": (69.125, 110.875), "warped": (69.375, 110.625)}
    assert errors.polar_mean_above_30 == pytest.approx(mean_limits[kind])
    assert errors.polar_all_above_30 == pytest.approx((75.125, 104.875))


def test_largest_error_near_the_array_normal(both):
    kind, errors = both
    within = errors.max_within_deg
    expected = {
        "ideal": ("4.90", "7.31", "9.17", "15.6", "15.6", "18.9", "25.5", "39.6"),
        "warped": ("4.28", "6.49", "8.09", "15.6", "15.6", "19.1", "25.2", "39.6"),
    }[kind]
    cones = ("10", "15", "19", "20", "30", "45", "60", "75")
    digits = (2, 2, 2, 1, 1, 1, 1, 1)
    assert tuple(f"{within[c]:.{d}f}" for c, d in zip(cones, digits, strict=True)) == expected


def test_below_ten_degrees_within_nineteen(both):
    _, errors = both
    # two opposite cells lose the Sun at once where sin(theta) = 1/3: 19.471 deg
    assert errors.first_polar_above_10 == pytest.approx(19.625)


@pytest.mark.parametrize(("theta", "error"), [(5.0, 2.50), (10.0, 4.96), (15.0, 7.37)])
def test_all_four_cells_pull_towards_the_pole(theta, error):
    # sum of n n^T over one side is diag(1, 1, 2): the tangent of the angle is halved
    exact = theta - np.degrees(np.arctan(np.tan(np.radians(theta)) / 2.0))
    assert f"{exact:.2f}" == f"{error:.2f}"
    rings = round(90.0 / theta)  # the first ring of the grid lies on theta
    grid = grid_about(Z, rings, 8)
    assert np.degrees(grid.polar[0]) == pytest.approx(theta)
    result = map_cells(layout(), grid)
    np.testing.assert_allclose(np.degrees(result.wavg_error[0]), exact, atol=1e-9)
