# SPDX-License-Identifier: Apache-2.0
"""The error of a layout against brute force and closed forms; what a structure blocks against its shadow."""

import math

import numpy as np
import pytest
from scipy.optimize import minimize

from css_common.direction_grid import SIZE, grid_cell, grid_directions
from css_common.mission import load_mission
from css_design.errors import DesignError
from css_design.layout.heading_error import Knowledge, heading_error, tail_mean
from css_design.layout.judge import Aims, LayoutJudge
from css_design.layout.placements import FACES, allowed, candidates, faces_of
from css_design.layout.readings import Cells, Readings
from css_design.layout.scenes import Scenes, spread_over
from css_design.layout.structure import Blocking, read_structure

FACES_B = np.array(list(FACES.values()))


def scenes_at(suns):
    suns = np.asarray(suns, dtype=np.float64)
    count = len(suns)
    places = np.zeros(count, np.int64)
    return Scenes(suns, np.zeros((count, 3, 3)), places, np.zeros((1, 192)), np.ones(1), np.full(count, 1 / count))


def cosines(normals, suns, error=0.0):
    outputs = np.asarray(normals) @ np.asarray(suns).T
    return Readings(outputs > 0.0, outputs + error)


def error_at(normals, sun, error=0.0, sigma=0.02, prior=0.3):
    suns = np.array([sun])
    readings = cosines(normals, suns, error)
    return heading_error(
        np.asarray(normals), readings, scenes_at(suns), Knowledge(sigma, prior), np.arange(len(normals))
    )


def test_perfect_readings_leave_the_covariance_alone():
    """Three faces with the Sun on their diagonal: sum g g^T = I across it, as each g has 2/3 of a square."""
    found = error_at(FACES_B[::2], np.ones(3) / math.sqrt(3.0))
    assert found.mean == pytest.approx(math.sqrt(2.0 / (1.0 / 0.3**2 + 1.0 / 0.02**2)), rel=1e-12)
    # with one dead the rest has eigenvalues 1 and 1/3
    rest = [1.0 / 0.3**2 + share / 0.02**2 for share in (1.0, 1.0 / 3.0)]
    assert found.failed == pytest.approx(math.sqrt(sum(1.0 / j for j in rest)), rel=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_the_shift_is_that_of_the_smallest_sum_of_squares(seed):
    """Against a general minimiser on the sphere, with readings that err by up to 0.1."""
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(6, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    sun = rng.normal(size=3)
    sun /= np.linalg.norm(sun)
    wrong = rng.uniform(-0.1, 0.1, size=(6, 1))
    readings = cosines(normals, [sun], wrong)
    sigma, prior = 0.05, 0.2
    lit, outputs = readings.seen[:, 0], readings.outputs[:, 0]

    def squares(x):
        s = x / np.linalg.norm(x)
        return np.sum((outputs - normals @ s)[lit] ** 2) / sigma**2 + np.sum((s - sun) ** 2) / prior**2

    best = minimize(squares, sun, method="Nelder-Mead", options={"xatol": 1e-10, "fatol": 1e-12, "maxiter": 4000}).x
    best /= np.linalg.norm(best)
    shift = math.acos(min(1.0, best @ sun))
    across = np.linalg.svd(best[None])[2][1:]
    g = (normals @ across.T)[lit]
    j = np.eye(2) / prior**2 + g.T @ g / sigma**2
    expected = math.sqrt(shift**2 + np.trace(np.linalg.inv(j)))
    found = heading_error(normals, readings, scenes_at([sun]), Knowledge(sigma, prior), np.arange(6))
    assert found.mean == pytest.approx(expected, rel=1e-2)  # four steps of Gauss-Newton


def test_the_tail_is_the_mean_of_the_worst_twentieth_of_the_weight():
    rng = np.random.default_rng(4)
    errors, times = rng.uniform(size=300), rng.integers(1, 5, size=300)
    # as many copies as its weight has quarters
    copies = np.sort(np.repeat(errors, times))[::-1]
    count = len(copies)
    assert tail_mean(errors, times / count, 60 / count) == pytest.approx(copies[:60].mean(), rel=1e-12)
    assert tail_mean(errors, times / count, 1.0) == pytest.approx(copies.mean(), rel=1e-12)
    found = error_at(FACES_B[::2], np.ones(3) / math.sqrt(3.0))
    assert found.tail == pytest.approx(found.mean, rel=1e-12)


def test_an_unseen_sun_leaves_a_guess():
    found = error_at([[0.0, 0.0, 1.0]], (0.0, 0.0, -1.0))
    assert found.unseen == 1.0 and found.mean == found.failed == pytest.approx(0.5 * math.pi)
    assert error_at([[0.0, 0.0, 1.0]], (0.0, 0.6, 0.8)).failed == pytest.approx(0.5 * math.pi)


def test_directions_are_spread_evenly():
    points = spread_over(400, math.pi, np.array([0.0, 0.6, 0.8]))
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), 1.0, rtol=1e-12)
    np.testing.assert_allclose(points.T @ points / 400, np.eye(3) / 3.0, atol=0.01)
    cone = spread_over(100, math.radians(30.0), np.array([0.0, 0.6, 0.8]))
    assert np.all(cone @ [0.0, 0.6, 0.8] > math.cos(math.radians(30.0)))


def test_more_cells_are_no_worse_and_the_paper_is_beaten_by_its_own_measure():
    judge = LayoutJudge(load_mission("okeefe_2013"), Aims(), 0.5)
    own = judge.error_of(judge.own)
    beside = Cells(np.vstack([judge.own.normals_b, judge.own.normals_b[:4]]), np.full(12, 120.0))
    assert judge.error_of(beside).failed < own.failed
    turned = Cells(judge.own.normals_b[:, [1, 0, 2]], judge.own.views_deg)  # the same layout with its numbers exchanged
    assert judge.error_of(turned).mean == pytest.approx(own.mean, rel=0.02)


def test_places_are_on_their_faces_and_clear_of_the_plane():
    places = candidates(faces_of(["+x", "-z"]), (0.0, 45.0), (90.0, 120.0))
    # one place, tilted half-way, is on both faces
    assert places.number == 2 * 17 and set(places.views_deg) == {90.0, 120.0}
    faces = faces_of(["+x", "-z"])
    assert allowed(places.normals_b, faces, 45.0, np.zeros(3))
    assert not allowed(places.normals_b, faces, 40.0, np.zeros(3))
    assert not allowed(places.normals_b, faces, 45.0, np.array([0.0, 0.0, 1.0]))  # +x lies in it
    with pytest.raises(DesignError, match="--faces: up given"):
        faces_of(["up"])


@pytest.fixture
def panel(tmp_path):
    """A cube of 0.1 m with a panel above its +x half."""
    file = tmp_path / "boxes.yaml"
    file.write_text(
        "boxes:\n"
        "  - {centre: [0, 0, 0], size: [0.1, 0.1, 0.1]}\n"
        "  - {centre: [0.5, 0, 0.25], size: [1.0, 4.0, 0.002]}\n"
    )
    return file


def test_blocked_directions_are_those_of_the_shadow(panel):
    blocking = Blocking(read_structure(panel))
    table = blocking.table(np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]]))
    directions = grid_directions()[:, 0]
    assert table.shape == (SIZE,) and table.max() <= 3
    # from (0, 0, 0.05) the panel is 0.199 m up, from x = 0 to 1 m, y = +-2 m; the own face hides all below
    up = directions[:, 2] > 0.0
    with np.errstate(divide="ignore"):
        at = directions[:, :2] * (0.199 / directions[:, 2:])
    shadow = up & (at[:, 0] > 0.0) & (at[:, 0] < 1.0) & (np.abs(at[:, 1]) < 2.0)
    expected = shadow | (directions[:, 2] < 0.0)
    first = (table & 1).astype(bool)
    assert np.mean(first != expected) < 0.02  # cells of the grid that an edge runs through
    assert np.all(first[directions[:, 2] < -0.1]) and not np.any(first[(directions[:, 0] < -0.1) & up])
    # the cell on -x looks away from the panel, and its face hides the other half
    second = (table & 2).astype(bool)
    assert np.mean(second != (directions[:, 0] > 0.0)) < 0.02


def test_each_direction_is_in_its_cell_of_the_grid():
    directions = grid_directions(3)
    found = np.array([[grid_cell(tuple(d)) for d in of_cell] for of_cell in directions[::97]])
    assert np.all(found == np.arange(SIZE)[::97, None])
    assert grid_cell((0.0, 0.0, 1.0)) < 72 and grid_cell((-1.0, -0.0, 0.0)) // 72 == 18


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("boxes: []", "neither boxes nor mesh"),
        ("boxes: [{centre: [0, 0, 0]}]", r"boxes\[0\]: expected"),
        ("boxes: [{centre: [0, 0, 0], size: [0, 1, 1]}]", "three numbers above 0"),
        ("boxes: [{centre: [0, 0, 0], size: [300, 300, 300]}]", "scale: 0.001"),
        ("boxes: [{centre: [0, 0, .nan], size: [1, 1, 1]}]", "expected three numbers"),
        ("walls: 4", "expected some of the keys boxes, cells, mesh, scale"),
        ("mesh: none.stl", "no mesh that can be read"),
        ("a: [", "no YAML"),
    ],
)
def test_what_is_no_structure_is_refused(tmp_path, text, error):
    file = tmp_path / "structure.yaml"
    file.write_text(text)
    with pytest.raises(DesignError, match=error):
        read_structure(file)


def test_a_mesh_blocks_as_the_boxes_that_it_was_made_from(panel, tmp_path):
    import trimesh

    boxes = read_structure(panel)
    mesh = trimesh.Trimesh(vertices=1000.0 * boxes.triangles.reshape(-1, 3), faces=np.arange(72).reshape(-1, 3))
    mesh.export(tmp_path / "body.stl")
    file = tmp_path / "mesh.yaml"
    file.write_text("mesh: body.stl\nscale: 0.001\n")
    place = np.array([0.0, 0.0, 0.0501])
    by_mesh, by_boxes = (Blocking(read_structure(f)).blocked_from(place) for f in (file, panel))
    assert np.mean(by_mesh != by_boxes) < 1e-3
