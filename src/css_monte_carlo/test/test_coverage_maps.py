# SPDX-License-Identifier: Apache-2.0
"""Coverage maps against independent numpy, closed forms of holes, and what the command prints."""

import itertools
import json

import numpy as np
import pytest
from figure_checks import checked_figures
from matplotlib import image
from okeefe_spacecraft import okeefe_values
from scipy.spatial.transform import Rotation

from css_estimation.nodes.wavg import Wavg
from css_monte_carlo.commands.coverage import main
from css_monte_carlo.coverage import CellMap, Grid, grid_about, layout_of, map_cells
from css_monte_carlo.coverage_figures import write_coverage_figures
from css_monte_carlo.coverage_statistics import coverage_object, holes, seen_fractions, wavg_errors
from css_sim.nodes.css_array import CssArray

__all__ = ["checked_figures"]  # every figure that is written is looked at

Z = (0.0, 0.0, 1.0)
COARSE = grid_about(Z, 90, 180)
NORMALS = okeefe_values(CssArray.table()).cells.normals
NO_CLIP = (0.0, 0.0, 0.0)


def layout(**changes):
    """The default layout with changes to its cells, or to the gate of the average."""
    gate = {name: changes.pop(name) for name in ("gate", "gate_kind") if name in changes}
    return layout_of(okeefe_values(CssArray.table(), **changes), okeefe_values(Wavg.table(), **changes, **gate))


def directions(grid: Grid) -> np.ndarray:
    polar, azimuth = np.meshgrid(grid.polar, grid.azimuth, indexing="ij")
    at = np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], axis=-1)
    return at @ np.array(grid.axes)


def ungated_sum(grid: Grid, normals_b: np.ndarray) -> CellMap:
    """The map by plain numpy: the weighted sum over all cells that have the Sun in view, no gate."""
    sun_b = directions(grid)
    cosine = sun_b @ normals_b.T
    seen = (cosine >= np.cos(np.pi / 3.0)) & (np.sign(sun_b[..., 2:]) == np.sign(normals_b[:, 2]))
    heading = (cosine * seen) @ normals_b
    error = np.arctan2(np.linalg.norm(np.cross(heading, sun_b), axis=-1), np.sum(heading * sun_b, axis=-1))
    return CellMap(seen.sum(axis=-1), error)


def test_the_relative_gate_leaves_the_map_of_all_cells_in_view():
    result = map_cells(layout(), COARSE)
    expected = ungated_sum(COARSE, NORMALS)
    np.testing.assert_array_equal(result.seen_by, expected.seen_by)
    np.testing.assert_allclose(result.wavg_error, expected.wavg_error, atol=1e-12)


@pytest.mark.parametrize("warp", [False, True])
def test_with_and_without_gate_the_maps_are_equal(warp):
    gated, ungated = (map_cells(layout(gate=gate), COARSE, warp) for gate in (0.45, 0.0))
    np.testing.assert_array_equal(gated.wavg_error, ungated.wavg_error)


def test_an_absolute_gate_above_the_edge_of_view_changes_the_map():
    values = layout(gate=0.7, gate_kind="absolute")
    assert np.any(map_cells(values, COARSE).wavg_error != map_cells(layout(), COARSE).wavg_error)


def test_layout_and_grid_turned_together_give_the_same_numbers():
    turn = Rotation.from_rotvec([0.4, -1.1, 0.7])
    normals = turn.apply(NORMALS)
    normal = turn.apply(Z)
    turned = layout(cells__normals=normals.ravel(), cells__clip_normal=normal)
    grid = grid_about(tuple(normal), 180, 360)
    axes = np.array(grid.axes)
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(axes) == pytest.approx(1.0)
    straight = grid_about(Z, 180, 360)
    a = wavg_errors(grid, map_cells(turned, grid))
    b = wavg_errors(straight, map_cells(layout(), straight))
    # the azimuth of the cells against the grid differs: agreement to the resolution of the grid
    assert a.mean_deg == pytest.approx(b.mean_deg, abs=0.05)
    assert a.max_within_deg["10"] == pytest.approx(b.max_within_deg["10"], abs=0.1)


def test_weights_are_solid_angles():
    assert COARSE.ring_weight.sum() == pytest.approx(1.0)
    inside = COARSE.polar < np.radians(60.0)
    assert COARSE.ring_weight[inside].sum() == pytest.approx(0.25, abs=1e-4)


@pytest.mark.parametrize(
    "normal", [(0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (-1.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.6, 0.8)]
)
def test_one_cell_leaves_one_hole_around_its_back(normal):
    grid = grid_about(Z, 360, 720)
    result = map_cells(layout(cells__normals=normal, cells__clip_normal=NO_CLIP), grid)
    (hole,) = holes(grid, result)
    # outside of a 60 deg cone lies three quarters of the sphere
    assert hole.fraction == pytest.approx(0.75, abs=1e-3)
    assert hole.solid_angle_sr == pytest.approx(3.0 * np.pi, rel=2e-3)
    assert hole.half_angle_deg == pytest.approx(120.0, abs=0.1)
    np.testing.assert_allclose(hole.centre_b, -np.array(normal), atol=2e-3)
    fractions = seen_fractions(grid, result)
    assert fractions[0] == pytest.approx(hole.fraction)
    errors = wavg_errors(grid, result)
    # a single cell answers with its own normal: the largest error is half of its view
    assert errors.max_deg == pytest.approx(60.0, abs=0.5)
    # mean polar angle in a cone: (sin a - a cos a) / (1 - cos a)
    half = np.pi / 3.0
    expected = np.degrees((np.sin(half) - half * np.cos(half)) / (1.0 - np.cos(half)))
    assert errors.mean_deg == pytest.approx(expected, abs=0.1)


def test_narrow_cells_on_a_cube_leave_its_corners_open():
    normals = np.vstack([np.eye(3), -np.eye(3)])
    # the corner is 54.7 deg from each face, the views end at 50
    values = layout(cells__normals=normals.ravel(), cells__clip_normal=NO_CLIP, cells__field_of_view_deg=100.0)
    grid = grid_about(Z, 360, 720)
    result = map_cells(values, grid)
    found = holes(grid, result)
    corners = np.array(list(itertools.product((-1.0, 1.0), repeat=3))) / np.sqrt(3.0)
    assert len(found) == 8
    nearest = [int(np.argmax(corners @ np.array(hole.centre_b))) for hole in found]
    assert sorted(nearest) == list(range(8))
    for hole, corner in zip(found, nearest, strict=True):
        np.testing.assert_allclose(hole.centre_b, corners[corner], atol=1e-2)
    assert sum(hole.fraction for hole in found) == pytest.approx(seen_fractions(grid, result)[0])


def test_a_belt_without_cells_has_no_middle():
    normals = (0.0, 0.0, 1.0, 0.0, 0.0, -1.0)
    values = layout(cells__normals=normals, cells__clip_normal=NO_CLIP)
    (hole,) = holes(COARSE, map_cells(values, COARSE))
    assert hole.fraction == pytest.approx(0.5, abs=2e-2)
    assert hole.centre_b == (0.0, 0.0, 0.0)


def test_numbers_are_plain_data_also_with_holes_everywhere():
    # a gate of the output that no cell reaches: no estimate anywhere but in the middle of the view
    values = layout(cells__normals=Z, cells__clip_normal=NO_CLIP, cells__field_of_view_deg=1.0)
    result = map_cells(values, COARSE)
    numbers = coverage_object(COARSE, result, result)
    assert numbers["seen_by_fraction"] == [pytest.approx(1.0)]
    assert json.loads(json.dumps(numbers, allow_nan=False)) is not None


def test_maps_are_pictures(tmp_path):
    values = layout(cells__clip_normal=NO_CLIP, cells__field_of_view_deg=80.0)
    result = map_cells(values, COARSE)
    files = write_coverage_figures(COARSE, result, result, NORMALS, "narrow", tmp_path / "new")
    assert [file.name for file in files] == ["cells_in_view.png", "wavg_error.png", "wavg_error_warped.png"]
    for file in files:
        pixels = image.imread(file)
        assert min(pixels.shape[:2]) > 300 and pixels[..., :3].std() > 0.05


def test_the_command(capsys, tmp_path):
    assert main(["okeefe_2013", "--json", "--figures", str(tmp_path)]) == 0
    out = capsys.readouterr().out
    assert "holes: none" in out and "51.45" in out and "23.84" in out
    numbers = json.loads(out.splitlines()[-1])
    assert numbers["mission"] == "okeefe_2013" and numbers["cells"] == 8
    assert numbers["wavg_warped"]["mean_deg"] == pytest.approx(23.87, abs=0.005)
    files = sorted(tmp_path.glob("*.png"))
    assert len(files) == 3
    assert sorted(line for line in out.splitlines() if line.startswith("figure:")) == [f"figure: {f}" for f in files]


def test_the_command_names_holes(capsys):
    assert main(["--set", "cells.field_of_view_deg=80"]) == 0
    assert "hole: about (" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["okeefe_2103"], "okeefe_2013"),
        (["--set", "cells.field_of_veiw_deg=80"], "cells.field_of_view_deg"),
        (["--set", "cells.field_of_view_deg=wide"], "cells.field_of_view_deg"),
        (["--set", "cells.field_of_view_deg=200"], "at most 180"),
        (["--figures", "/proc/nowhere"], "/proc/nowhere"),
        (["esprit_2006"], "no cells to map: graph.nodes has no css_sim/css_array"),
    ],
)
def test_what_the_user_got_wrong_is_one_line(arguments, expected, capsys):
    assert main(arguments) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1 and expected in err
