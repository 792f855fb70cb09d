# SPDX-License-Identifier: Apache-2.0
"""Coverage and error map of the dual pyramid (O'Keefe & Schaub 2013, Figs. 1b and 2), and Eq. 2's properties.

The paper prints its maps as figures and a few numbers of them; the figures here were computed independently from
Eqs. 1, 2 and 16 on a grid of 720 x 1440 cell centres in polar angle and azimuth, weighted by area.
"""

import math

import numpy as np
import pytest
from ideal_cells import AZIMUTH, POLAR, WEIGHT, direction, ideal_outputs, percent_of_sphere
from okeefe_spacecraft import okeefe_values

from css_common.kernel import kernel
from css_common.vectors import angle_between, unit
from css_estimation.sun import wavg
from css_estimation.sun.cell_layout import brightest, cell_layout
from css_estimation.sun.snapshot import MODE_NO_SUN
from css_estimation.sun.sun_heading import UNAIDED
from css_sensors.cells import CELLS


def wavg_parameters(**changes):
    return wavg.parameters(okeefe_values(CELLS + wavg.PARAMETERS, **changes)).snapshot


@kernel
def map_of_sphere(layout, gate, polar, azimuth, warp, scale, voltages, error, seen):
    """Error [rad] of the weighted average and number of cells that see the Sun, for each Sun direction."""
    for a in range(polar.size):
        for b in range(azimuth.size):
            s = direction(polar[a], azimuth[b])
            seen[a, b] = ideal_outputs(layout, s, warp, scale, voltages)
            s_hat, _, _ = wavg.weighted_average(layout, gate, voltages, brightest(voltages))
            error[a, b] = angle_between(s_hat, s)


def error_map(warp=False, scale=1.0, p=None):
    p = p or wavg_parameters()
    error = np.empty((POLAR.size, AZIMUTH.size))
    seen = np.zeros((POLAR.size, AZIMUTH.size), dtype=np.int64)
    map_of_sphere(p.layout, p.gate, POLAR, AZIMUTH, warp, scale, np.empty(p.layout.cells.size), error, seen)
    return np.degrees(error), seen


@pytest.fixture(scope="module")
def ideal():
    return error_map()


@pytest.fixture(scope="module")
def warped():
    return error_map(warp=True)


def test_coverage_is_that_of_figure_1b(ideal):
    _, seen = ideal
    fractions = [round(percent_of_sphere(seen == n), 2) for n in range(5)]
    assert fractions == [0.0, 35.08, 51.45, 9.38, 4.08]


def test_coverage_without_the_body_plane():
    p = wavg_parameters(cells__clip_normal=[0.0, 0.0, 0.0])
    _, seen = error_map(p=p)
    fractions = [round(percent_of_sphere(seen == n), 2) for n in range(5)]
    assert fractions == [0.0, 17.53, 69.0, 9.38, 4.08]


def test_clocking_of_the_cells_about_z_does_not_matter():
    r = math.sqrt(0.5)
    normals = [
        v
        for z in (r, -r)
        for a in (45, 135, 225, 315)
        for v in (r * math.cos(math.radians(a)), r * math.sin(math.radians(a)), z)
    ]
    error, seen = error_map(p=wavg_parameters(cells__normals=normals))
    assert round(percent_of_sphere(seen == 1), 2) == 35.08
    assert round(WEIGHT @ error.mean(axis=1), 2) == 23.84


@pytest.mark.parametrize(
    ("name", "mean", "largest", "beyond_30"), [("ideal", 23.84, 59.7, 35.9), ("warped", 23.87, 59.7, 35.75)]
)
def test_error_over_the_sphere(request, name, mean, largest, beyond_30):
    error, _ = request.getfixturevalue(name)
    digits = len(str(beyond_30).partition(".")[2])
    assert round(WEIGHT @ error.mean(axis=1), 2) == mean
    assert round(error.max(), 1) == largest
    assert round(percent_of_sphere(error > 30.0), digits) == beyond_30


@pytest.mark.parametrize(
    ("name", "any_azimuth", "azimuth_mean", "all_azimuths"),
    [
        ("ideal", (65.4, 114.6), (69.1, 110.9), (75.1, 104.9)),
        ("warped", (65.4, 114.6), (69.4, 110.6), (75.1, 104.9)),
    ],
)
def test_band_about_the_equator_beyond_30_deg(request, name, any_azimuth, azimuth_mean, all_azimuths):
    error, _ = request.getfixturevalue(name)
    polar = np.degrees(POLAR)
    for rows, band in (
        (error.max(axis=1) > 30.0, any_azimuth),
        (error.mean(axis=1) > 30.0, azimuth_mean),
        (error.min(axis=1) > 30.0, all_azimuths),
    ):
        assert (round(polar[rows].min(), 1), round(polar[rows].max(), 1)) == band


@pytest.mark.parametrize(
    ("name", "limits"),
    [
        ("ideal", {10: "4.90", 15: "7.31", 19: "9.17", 20: "15.6", 30: "15.6", 45: "18.9", 60: "25.5", 75: "39.6"}),
        ("warped", {10: "4.28", 15: "6.49", 19: "8.09", 20: "15.6", 30: "15.6", 45: "19.1", 60: "25.2", 75: "39.6"}),
    ],
)
def test_largest_error_about_the_array_normal(request, name, limits):
    error, _ = request.getfixturevalue(name)
    polar = np.degrees(POLAR)
    for within, printed in limits.items():
        digits = len(printed.partition(".")[2])
        assert f"{error[polar < within].max():.{digits}f}" == printed, within


def test_error_stays_below_10_deg_within_19_deg_of_z(ideal):
    """The paper's statement, and where it ends: two opposite cells lose the Sun at sin(theta) = 1/3."""
    error, _ = ideal
    first = np.degrees(POLAR[np.argmax(error.max(axis=1) > 10.0)])
    assert round(first, 1) == 19.6
    assert first - 0.25 <= math.degrees(math.asin(1.0 / 3.0)) + 0.25 <= first + 0.25


@pytest.mark.parametrize(("theta", "error"), [(5.0, 2.495), (10.0, 4.962), (15.0, 7.369)])
def test_bias_toward_the_pole_has_a_closed_form(theta, error):
    """All four cells of one side lit: sum n n^T = diag(1, 1, 2), so tan(theta_hat) = tan(theta) / 2."""
    p = wavg_parameters()
    t = math.radians(theta)
    s = np.array([math.sin(t), 0.0, math.cos(t)])
    normals = np.stack([p.layout.cells[c] for c in ("nx", "ny", "nz")], axis=1)
    voltages = np.where(normals[:, 2] > 0.0, np.maximum(normals @ s, 0.0), 0.0)
    s_hat, mask, mode = wavg.weighted_average(p.layout, p.gate, voltages, brightest(voltages))
    assert mask == 0b1111
    assert mode == wavg.MODE_AVERAGE
    assert math.degrees(math.atan2(s_hat[0], s_hat[2])) == pytest.approx(theta - error, abs=0.0005)
    assert math.atan2(s_hat[0], s_hat[2]) == pytest.approx(math.atan(0.5 * math.tan(t)), abs=1e-14)


@pytest.mark.parametrize("scale", [0.25, 0.74, 1.3])
def test_a_common_scale_changes_nothing_with_the_relative_gate(ideal, scale):
    error, _ = error_map(scale=scale)
    np.testing.assert_allclose(error, ideal[0], rtol=0.0, atol=1e-6)


def test_a_common_scale_matters_with_an_absolute_gate(ideal):
    """Why the gate is relative: 0.74 is 0.8 of scale error, 5 % of degradation and the Sun of June together."""
    p = wavg_parameters(gate_kind="absolute", gate=0.4)
    error, _ = error_map(scale=0.74, p=p)
    assert percent_of_sphere(np.abs(error - ideal[0]) > 1.0) > 5.0


def test_albedo_light_below_the_gate_has_no_effect():
    p = wavg_parameters()
    direct = np.array([0.9, 0.6, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    lit_by_earth = direct.copy()
    lit_by_earth[4:] = 0.4
    clean = wavg.weighted_average(p.layout, p.gate, direct, 0)
    assert wavg.weighted_average(p.layout, p.gate, lit_by_earth, 0) == clean


def test_modes():
    p = wavg_parameters()
    dark = np.zeros(8)
    assert wavg.weighted_average(p.layout, p.gate, dark, brightest(dark)) == ((0.0, 0.0, 0.0), 0, MODE_NO_SUN)
    single = dark.copy()
    single[3] = 0.6
    s_hat, mask, mode = wavg.weighted_average(p.layout, p.gate, single, brightest(single))
    assert (mask, mode) == (1 << 3, wavg.MODE_SINGLE_CELL)
    cell = p.layout.cells[3]
    np.testing.assert_allclose(s_hat, (cell["nx"], cell["ny"], cell["nz"]), rtol=1e-15)
    absolute = wavg_parameters(gate_kind="absolute", gate=0.4)
    dim = 0.5 * single
    assert wavg.weighted_average(absolute.layout, absolute.gate, dim, 3)[1:] == (1 << 3, wavg.MODE_BELOW_GATE)
    assert wavg.weighted_average(absolute.layout, absolute.gate, 0.15 * single, 3)[2] == MODE_NO_SUN


def test_normals_that_cancel_leave_no_direction():
    p = wavg_parameters(cells__normals=[1.0, 0.0, 0.0, -1.0, 0.0, 0.0], cells__clip_normal=[0.0, 0.0, 0.0])
    voltages = np.array([0.7, 0.7])
    assert wavg.weighted_average(p.layout, p.gate, voltages, 0) == ((0.0, 0.0, 0.0), 0, MODE_NO_SUN)


def test_layout_of_the_mission_is_the_dual_pyramid():
    layout = cell_layout(okeefe_values(CELLS))
    np.testing.assert_allclose(np.abs(layout.cells["nz"]), math.sqrt(0.5), rtol=1e-12)
    assert layout.cos_half_view == pytest.approx(0.5)


def one_cell(theta_deg, azimuth=0.3, scale=1.0):
    """Heading of cell 0 alone with the Sun at an angle to its normal, on any side."""
    p = wavg.parameters(okeefe_values(CELLS + wavg.PARAMETERS))
    voltages = np.zeros(8)
    voltages[0] = scale * math.cos(math.radians(theta_deg))
    _, heading = wavg.step(p, wavg.initial_state(p), None, 0.1, voltages, UNAIDED)
    n = np.array(heading.sun_b)
    across = np.cross(n, (0.0, 1.0, 0.0))
    across /= np.linalg.norm(across)
    t = math.radians(theta_deg)
    side = math.cos(azimuth) * across + math.sin(azimuth) * np.cross(n, across)
    return heading, math.cos(t) * n + math.sin(t) * side, n


@pytest.mark.parametrize("theta_deg", [5.0, 20.0, 40.0, 59.0])
def test_one_cell_gives_the_measure_of_its_error(theta_deg):
    """The output is the cosine of the error: NEES of each axis is 1 on average, less by the cell's own error."""
    heading, _, n = one_cell(theta_deg)
    covariance = np.array(heading.covariance).reshape(3, 3)
    squared = []
    for azimuth in np.arange(12) * math.pi / 6.0:
        error = one_cell(theta_deg, azimuth)[1] - n
        error -= n * (n @ error)
        squared.append(error @ np.linalg.pinv(covariance - n[:, None] * n * (n @ covariance @ n), rcond=1e-9) @ error)
    exact = math.sin(math.radians(theta_deg)) ** 2
    assumed = 1.0 - max(0.5, math.cos(math.radians(theta_deg)) - 0.1) ** 2
    assert np.mean(squared) / 2.0 == pytest.approx(exact / assumed, rel=1e-6)
    assert exact <= assumed


def test_the_measure_knows_the_view_and_no_more_than_the_sun():
    """A dim cell is at the edge of its view, a bright one is not better than its own error."""
    edge = one_cell(59.9, scale=0.5)[0].covariance
    assert sum(edge[::4]) == pytest.approx(0.75 + 0.5 * 0.75**2, rel=1e-9), "sin^2 of 60 deg"
    facing = sum(one_cell(0.0)[0].covariance[::4])
    assert facing == pytest.approx(0.19 + 0.5 * 0.19**2, rel=1e-9), "sin^2 of acos(0.9)"
    assert sum(one_cell(0.0, scale=1.3)[0].covariance[::4]) == facing


def test_an_average_of_two_cells_knows_that_the_sun_may_be_on_either_side_of_their_plane():
    """Second moment about the average of the two Suns that give these outputs, the cells' own error aside."""
    p = wavg.parameters(okeefe_values(CELLS + wavg.PARAMETERS, cell_sigma=1e-6))
    normals = np.array([[p.snapshot.layout.cells[i][c] for c in ("nx", "ny", "nz")] for i in (0, 1)])
    across = np.cross(*normals) / np.linalg.norm(np.cross(*normals))
    for off_deg in (0.0, 10.0, 25.0):
        inside = 0.6 * normals[0] + 0.5 * normals[1]
        inside /= np.linalg.norm(inside)
        suns = [
            math.cos(math.radians(off_deg)) * inside + side * math.sin(math.radians(off_deg)) * across
            for side in (-1.0, 1.0)
        ]
        voltages = np.zeros(8)
        voltages[:2] = normals @ suns[0]
        np.testing.assert_allclose(voltages[:2], normals @ suns[1], atol=1e-12)
        _, heading = wavg.step(p, wavg.initial_state(p), None, 0.1, voltages, UNAIDED)
        n = np.array(heading.sun_b)
        tangent = np.eye(3) - np.outer(n, n)
        expected = np.mean([np.outer(tangent @ (s - n), tangent @ (s - n)) for s in suns], axis=0)
        found = tangent @ np.reshape(heading.covariance, (3, 3)) @ tangent
        np.testing.assert_allclose(found, expected, atol=1e-5)


def test_an_average_of_cells_that_span_space_knows_its_bias():
    p = wavg.parameters(okeefe_values(CELLS + wavg.PARAMETERS, cell_sigma=1e-6))
    normals = np.array([[p.snapshot.layout.cells[i][c] for c in ("nx", "ny", "nz")] for i in range(8)])
    sun_b = np.array(unit((0.1, 0.15, 1.0)))
    voltages = np.where(normals[:, 2] > 0.0, normals @ sun_b, 0.0)
    _, heading = wavg.step(p, wavg.initial_state(p), None, 0.1, voltages, UNAIDED)
    off = sun_b - heading.sun_b
    assert np.degrees(np.linalg.norm(off)) > 4.0
    variances, axes = np.linalg.eigh(np.reshape(heading.covariance, (3, 3)))
    assert variances[-1] == pytest.approx(off @ off, rel=0.01)
    assert abs(axes[:, -1] @ off) > 0.99 * np.linalg.norm(off)
