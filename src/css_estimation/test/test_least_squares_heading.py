# SPDX-License-Identifier: Apache-2.0
"""Least-squares heading: exact where it can be, of known error where it cannot, sane where it is singular."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ideal_cells import AZIMUTH, POLAR, WEIGHT, direction, ideal_outputs, percent_of_sphere
from okeefe_spacecraft import okeefe_values
from scipy import stats

from css_common.kernel import outer_kernel
from css_common.vectors import angle_between, vector_of
from css_estimation.sun import least_squares as wls
from css_estimation.sun import sun_patterns
from css_estimation.sun.cell_layout import brightest
from css_estimation.sun.snapshot import MODE_NO_SUN
from css_estimation.sun.sun_heading import NO_COVARIANCE
from css_sensors.cells import CELLS

OPEN = {"cells__clip_normal": [0.0, 0.0, 0.0]}
R = math.sqrt(0.5)


def parameters(normals=None, **changes):
    if normals is not None:
        changes |= {"cells__normals": np.ravel(normals).tolist()} | OPEN
    return wls.parameters(okeefe_values(CELLS + wls.PARAMETERS, **changes))


def normals_of(p):
    cells = p.snapshot.layout.cells
    return np.stack([cells[c] for c in ("nx", "ny", "nz")], axis=1)


def heading(p, voltages):
    voltages = np.asarray(voltages, dtype=np.float64)
    return wls.least_squares(p, voltages, brightest(voltages))


def degrees(a, b):
    return math.degrees(angle_between(vector_of(np.asarray(a)), vector_of(np.asarray(b))))


@outer_kernel
def map_of_sphere(p, polar, azimuth, warp, scale, error, squared, mode, trace):
    """Error [rad], squared chord [-], mode and trace of the covariance for each Sun direction."""
    voltages = np.zeros(p.snapshot.layout.cells.size)
    for a in range(polar.size):
        for b in range(azimuth.size):
            s = direction(polar[a], azimuth[b])
            ideal_outputs(p.snapshot.layout, s, warp, scale, voltages)
            h = wls.least_squares(p, voltages, brightest(voltages))
            e, c = h.sun_b, h.covariance
            error[a, b] = angle_between(e, s)
            squared[a, b] = (e[0] - s[0]) ** 2 + (e[1] - s[1]) ** 2 + (e[2] - s[2]) ** 2
            mode[a, b] = h.mode
            trace[a, b] = c[0] + c[4] + c[8]


def maps(warp=False, scale=1.0, **changes):
    error, squared, trace = (np.empty((POLAR.size, AZIMUTH.size)) for _ in range(3))
    mode = np.zeros(error.shape, dtype=np.int64)
    map_of_sphere(parameters(**changes), POLAR, AZIMUTH, warp, scale, error, squared, mode, trace)
    return np.degrees(error), squared, mode, trace


@pytest.fixture(scope="module")
def least_norm():
    return maps()


@pytest.fixture(scope="module")
def dark():
    return maps(use_dark_cells=True)


def test_three_and_four_cells_give_the_exact_sun(least_norm, dark):
    error, _, mode, _ = least_norm
    exact = mode == wls.MODE_SPACE
    # the 9.38 and 4.08 % that three and four cells see
    assert round(percent_of_sphere(exact), 1) == 13.5
    assert error[exact].max() < 1e-6
    assert np.array_equal(dark[2] == wls.MODE_SPACE, exact)
    assert np.array_equal(dark[0][exact], error[exact])


@pytest.mark.parametrize("weights", ["output", "equal"])
def test_one_and_two_cells_err_by_the_angle_of_the_sun_from_their_span(weights):
    p = parameters(weights=weights)
    normals = normals_of(p)
    rng = np.random.default_rng(4)
    voltages = np.zeros(8)
    seen = {1: 0, 2: 0}
    for s in rng.normal(size=(2000, 3)):
        s /= np.linalg.norm(s)
        if ideal_outputs(p.snapshot.layout, tuple(s), False, 1.0, voltages) > 2:
            continue
        lit = normals[voltages > 0.0]
        expected = degrees(lit[0], s)
        if len(lit) == 2:
            expected = math.degrees(math.asin(abs(s @ np.cross(*lit)) / np.linalg.norm(np.cross(*lit))))
        found = heading(p, voltages)
        assert found.mode == len(lit)
        assert found.lit_mask == sum(1 << int(i) for i in np.flatnonzero(voltages))
        # the lit cells' span has two Suns or a ring of them: so far from it, or further by the cells' own error
        covariance = np.reshape(found.covariance, (3, 3))
        outside = math.sin(math.radians(expected)) ** 2
        further = 1.0 - max(0.0, math.cos(math.radians(expected)) - p.cell_sigma) ** 2
        across = np.trace(covariance) - np.array(found.sun_b) @ covariance @ found.sun_b
        assert outside < across < further + 10.0 * p.cell_sigma**2
        assert degrees(found.sun_b, s) == pytest.approx(expected, abs=1e-6)
        seen[len(lit)] += 1
    assert min(seen.values()) > 500


@pytest.mark.parametrize(
    ("name", "mean", "largest", "beyond_30"), [("least_norm", 21.341, 59.68, 34.56), ("dark", 13.323, 46.49, 5.46)]
)
def test_error_over_the_sphere(request, name, mean, largest, beyond_30):
    """Figures of an independent program on the same grid, which takes the patterns' moments from that grid too.

    The weighted average has 23.84, 59.7, 35.9.
    """
    error, _, _, _ = request.getfixturevalue(name)
    assert WEIGHT @ error.mean(axis=1) == pytest.approx(mean, abs=0.002)
    # the table's finite number of directions scatters the means of patterns by up to 0.1 deg
    assert error.max() == pytest.approx(largest, abs=0.15)
    assert percent_of_sphere(error > 30.0) == pytest.approx(beyond_30, abs=0.02)


def test_moments_of_patterns_are_those_of_unit_vectors_that_stand_for_patches():
    """Of unit vectors tr C = 1 - |m|^2; a patch of the sphere adds its area / 4 pi about each axis."""
    table, patch = parameters(use_dark_cells=True).patterns, 1.0 / len(sun_patterns._sphere())
    mean = np.stack([table[name] for name in "xyz"], axis=1)
    covariance = np.stack([table["".join(sorted(a + b))] for a in "xyz" for b in "xyz"], axis=1).reshape(-1, 3, 3)
    trace = np.trace(covariance, axis1=1, axis2=2)
    np.testing.assert_allclose(trace, 1.0 - np.sum(mean**2, axis=1) + 3.0 * patch, atol=1e-12)
    assert np.linalg.eigvalsh(covariance).min() > patch * (1.0 - 1e-6)


def test_dark_cells_help_warped_cells_as_much():
    means = [WEIGHT @ maps(warp=True, use_dark_cells=use)[0].mean(axis=1) for use in (False, True)]
    assert [round(mean, 2) for mean in means] == [21.64, 13.5]


@pytest.mark.parametrize("use_dark_cells", [False, True])
def test_a_common_scale_changes_nothing(request, use_dark_cells):
    error, _, mode, _ = request.getfixturevalue("dark" if use_dark_cells else "least_norm")
    scaled_error, _, scaled_mode, _ = maps(scale=0.74, use_dark_cells=use_dark_cells)
    assert np.array_equal(scaled_mode, mode)
    np.testing.assert_allclose(scaled_error, error, atol=1e-6)


def test_covariance_from_dark_cells_is_the_mean_square_error(dark):
    """Over all directions of the Sun with one or two lit cells; in the mean the covariance must be their spread."""
    _, squared, mode, trace = dark
    for used in (wls.MODE_LINE_AND_DARK, wls.MODE_PLANE_AND_DARK):
        weight = WEIGHT[:, None] * (mode == used)
        ratio = (weight * squared).sum() / (weight * trace).sum()
        assert 0.9 < ratio < 1.1


@pytest.mark.parametrize("weights", ["output", "equal"])
def test_covariance_of_three_cells_is_that_of_their_noise(weights):
    p = parameters(weights=weights, cell_sigma=0.002)
    rng = np.random.default_rng(9)
    s = np.array([math.sin(0.2), 0.0, math.cos(0.2)])
    voltages = np.zeros(8)
    assert ideal_outputs(p.snapshot.layout, tuple(s), False, 1.0, voltages) == 4
    lit = voltages > 0.0
    across = np.linalg.svd(s[None])[2][1:]
    nees = []
    for _ in range(2000):
        found = heading(p, voltages + 0.002 * lit * rng.normal(size=8))
        covariance = across @ np.reshape(found.covariance, (3, 3)) @ across.T
        error = across @ np.subtract(found.sun_b, s)
        nees.append(error @ np.linalg.solve(covariance, error))
    assert stats.kstest(nees, "chi2", (2,)).pvalue > 1e-4


def test_solution_is_that_of_weighted_least_squares():
    rng = np.random.default_rng(3)
    for _ in range(50):
        normals = rng.normal(size=(5, 3))
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        voltages = rng.uniform(0.5, 1.0, 5)
        for weights, w in (("output", voltages), ("equal", np.ones(5))):
            p = parameters(normals, weights=weights, largest_condition=1000.0)
            x = np.linalg.lstsq(np.sqrt(w)[:, None] * normals, np.sqrt(w) * voltages)[0]
            assert heading(p, voltages).sun_b == pytest.approx(x / np.linalg.norm(x), abs=1e-8)


def test_coplanar_sets_give_the_projection_on_their_plane():
    """The three lit cells of a layout whose normals lie in a plane, where the normal equations are singular."""
    normals = [[math.sin(a), 0.0, math.cos(a)] for a in (-0.8, -0.1, 0.9)]
    s = np.array([0.2, 0.5, 0.0])
    s[2] = math.sqrt(1.0 - s @ s)
    found = heading(parameters(normals), normals @ s)
    assert found.mode == wls.MODE_PLANE
    assert found.sun_b == pytest.approx(np.array([s[0], 0.0, s[2]]) / math.hypot(s[0], s[2]), abs=1e-12)


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_nearly_coplanar_sets_do_not_amplify_errors(noise):
    """Out of the plane by 1 mrad: full rank to the letter, and 0.01 of error would become ten."""
    s = np.array([0.2, 0.5, math.sqrt(0.71)])
    normals = np.array([[math.sin(a), y, math.cos(a)] for a, y in ((-0.8, 1e-3), (-0.1, -1e-3), (0.9, 1e-3))])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    found = heading(parameters(normals), normals @ s + noise * np.array([1.0, -1.0, 1.0]))
    assert found.mode == wls.MODE_PLANE
    assert degrees(found.sun_b, np.array([0.2, 0.0, s[2]])) < 1.0


OPPOSITE_OF_THE_PYRAMID = [[R, 0.0, R], [-R, 0.0, R], [R, 0.0, -R], [-R, 0.0, -R]]


@pytest.mark.parametrize(
    ("voltages", "expected", "mode"),
    [
        ([0.8, 0.6, 0.0, 0.0], [0.1, 0.0, 0.7], wls.MODE_PLANE),  # opposite cells of one side
        ([0.9, 0.0, 0.0, 0.5], [R, 0.0, R], wls.MODE_LINE),  # opposite normals: only along them
        ([0.9, 0.5, 0.5, 0.0], [R, 0.0, R], wls.MODE_PLANE),  # three and four of a plane
        ([0.9, 0.5, 0.5, 0.5], [R, 0.0, R], wls.MODE_PLANE),
        ([1.0, 0.9, 0.6, 0.5], [0.1, 0.0, 0.4], wls.MODE_PLANE),
    ],
)
def test_singular_sets_of_the_dual_pyramid(voltages, expected, mode):
    p = parameters(OPPOSITE_OF_THE_PYRAMID, weights="equal")
    found = heading(p, voltages)
    assert found.mode == mode
    assert found.sun_b == pytest.approx(np.array(expected) / np.linalg.norm(expected), abs=1e-12)


@pytest.mark.parametrize("voltages", [[0.7, 0.0, 0.0, 0.7], [0.7, 0.7, 0.7, 0.7], [0.7, 0.0, 0.0, 0.65]])
def test_cells_that_contradict_each_other_are_no_sun(voltages):
    assert heading(parameters(OPPOSITE_OF_THE_PYRAMID), voltages) == ((0.0, 0.0, 0.0), NO_COVARIANCE, 0, MODE_NO_SUN)


def test_outputs_that_no_sun_explains_get_the_least_norm():
    """Cells of both sides of the body plane never see the Sun together."""
    plain, dark = parameters(), parameters(use_dark_cells=True)
    voltages = [0.7, 0.0, 0.0, 0.0, 0.7, 0.0, 0.0, 0.0]
    assert heading(dark, voltages) == heading(plain, voltages)
    assert heading(dark, voltages).sun_b == pytest.approx((1.0, 0.0, 0.0), abs=1e-12)


def test_a_cell_below_an_absolute_gate():
    found = heading(parameters(gate_kind="absolute", gate=0.4), [0.3] + 7 * [0.0])
    assert (found.lit_mask, found.mode) == (1, wls.MODE_BELOW_GATE)
    assert found.sun_b == pytest.approx((R, 0.0, R))


unit_vectors = st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)).filter(
    lambda v: np.linalg.norm(v) > 0.1
)


@settings(max_examples=200, deadline=None)
@given(st.lists(unit_vectors, min_size=1, max_size=8), unit_vectors, st.booleans(), st.sampled_from([3.0, 10.0, 1e3]))
def test_any_layout_sees_a_true_sun_within_what_its_cells_can_know(normals, s, use_dark_cells, condition):
    """How far the condition test can turn the heading away has a bound.

    With M = sum w n n^T, l1 its largest eigenvalue and n.s >= 1/2, s.M s >= tr(M) / 4 >= l1 / 4. Dropped are directions
    of eigenvalues below l1 / c^2, so the part k of s in the others has k^2 + (1 - k^2) / c^2 >= 1 / 4.
    """
    normals = np.array([np.array(n) / np.linalg.norm(n) for n in normals])
    s = np.array(s) / np.linalg.norm(s)
    p = parameters(normals, use_dark_cells=use_dark_cells, largest_condition=condition)
    voltages = np.zeros(len(normals))
    seen = ideal_outputs(p.snapshot.layout, tuple(s), False, 1.0, voltages)
    found = heading(p, voltages)
    assert (found.mode == MODE_NO_SUN) == (seen == 0)
    if seen:
        assert math.isclose(np.linalg.norm(found.sun_b), 1.0, rel_tol=1e-12)
        if not use_dark_cells:
            least = math.sqrt((0.25 - condition**-2) / (1.0 - condition**-2))
            assert degrees(found.sun_b, s) <= math.degrees(math.acos(least)) + 1e-6
