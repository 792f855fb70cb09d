# SPDX-License-Identifier: Apache-2.0
"""What Rerun is given of markers and frames, by a stand-in for it that keeps what it gets."""

import sys
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Point, TransformStamped
from listing import ROOT
from visualization_msgs.msg import Marker

from css_viewers.commands import view
from css_viewers.rerun_file import _Drawing

REFERENCE = ROOT / "bags" / "reference"


class Rerun:
    """Every archetype is its name and what it was made with; a stream keeps all that is logged."""

    def __init__(self):
        self.logged: list[tuple[str, Any]] = []
        self.stamps: list[Any] = []
        self.saved = None

    def __getattr__(self, name):
        return lambda text="", **given: SimpleNamespace(kind=name, text=text, **given)

    def log(self, path, archetype):
        self.logged.append((path, archetype))

    def RecordingStream(self, application, recording_id):
        self.called = (application, recording_id)
        return self

    def save(self, path):
        self.saved = path
        path.write_bytes(b"rrd")

    def set_time(self, timeline, timestamp):
        self.stamps.append((timeline, timestamp))

    def flush(self):
        """All is kept already."""

    def disconnect(self):
        """Nothing is connected."""


@pytest.fixture
def rerun():
    return Rerun()


def marker(kind, points=(), text=""):
    made = Marker(type=kind, ns="cells", id=3, text=text)
    made.header.frame_id = "bus"
    made.scale.x, made.scale.y, made.scale.z = 0.2, 0.4, 0.6
    made.pose.position.x, made.pose.position.y, made.pose.position.z = 1.0, 2.0, 3.0
    made.pose.orientation.x, made.pose.orientation.w = 0.6, 0.8
    made.color.r, made.color.g, made.color.b, made.color.a = 1.0, 0.4, 0.0, 0.2
    made.points = [Point(x=x, y=y, z=z) for x, y, z in points]
    return made


def drawn(rerun, made):
    _Drawing(rerun, rerun).draw([made])
    ((path, archetype),) = rerun.logged
    assert path == "bus/cells/3"
    return archetype


@pytest.mark.parametrize(
    ("kind", "name", "sizes"),
    [
        (Marker.CUBE, "Boxes3D", {"sizes": [[0.2, 0.4, 0.6]]}),
        (Marker.SPHERE, "Ellipsoids3D", {"half_sizes": [[0.1, 0.2, 0.3]]}),
        (Marker.CYLINDER, "Cylinders3D", {"lengths": [0.6], "radii": [0.1]}),
    ],
)
def test_a_body_has_its_size_and_pose(rerun, kind, name, sizes):
    made = drawn(rerun, marker(kind))
    assert (made.kind, made.fill_mode) == (name, "solid")
    for size, expected in sizes.items():
        np.testing.assert_allclose(getattr(made, size), expected)
    assert made.centers == [(1.0, 2.0, 3.0)] and made.colors == [[255, 102, 0, 51]]
    assert made.quaternions[0].xyzw == (0.6, 0.0, 0.0, 0.8)


def test_an_arrow_goes_from_its_first_point_to_the_second(rerun):
    made = drawn(rerun, marker(Marker.ARROW, [(1.0, 0.0, 2.0), (1.5, -1.0, 2.0)]))
    assert made.kind == "Arrows3D" and made.radii == [0.1] and made.colors == [[255, 102, 0, 51]]
    np.testing.assert_array_equal(made.origins, [(1.0, 0.0, 2.0)])
    np.testing.assert_array_equal(made.vectors, [(0.5, -1.0, 0.0)])


def test_triangles_have_three_corners_each(rerun):
    corners = [(float(i), 0.0, 1.0) for i in range(6)]
    made = drawn(rerun, marker(Marker.TRIANGLE_LIST, corners))
    assert (made.kind, made.albedo_factor) == ("Mesh3D", [255, 102, 0, 51])
    np.testing.assert_array_equal(made.vertex_positions, corners)
    np.testing.assert_array_equal(made.triangle_indices, [(0, 1, 2), (3, 4, 5)])


def test_words_are_words(rerun):
    made = drawn(rerun, marker(Marker.TEXT_VIEW_FACING, text="12.3 s"))
    assert (made.kind, made.text) == ("TextDocument", "12.3 s")


def test_frames_are_a_tree_and_the_spacecraft_stays_in_its_middle(rerun):
    def link(parent, child):
        made = TransformStamped(child_frame_id=child)
        made.header.frame_id = parent
        made.transform.translation.x, made.transform.translation.y = 4.0, 5.0
        made.transform.rotation.z, made.transform.rotation.w = 0.6, 0.8
        return made

    drawing = _Drawing(rerun, rerun)
    drawing.turn([link("eci", "bus"), link("bus", "cell")])
    drawing.draw([marker(Marker.CUBE)])
    (outer, turned), (inner, placed), (path, _) = rerun.logged
    assert (outer, inner, path) == ("eci/bus", "eci/bus/cell", "eci/bus/cells/3")
    assert turned.translation == (0.0, 0.0, 0.0) and placed.translation == (4.0, 5.0, 0.0)
    assert turned.quaternion.xyzw == placed.quaternion.xyzw == (0.0, 0.0, 0.6, 0.8)


def test_what_is_taken_away_is_cleared_once_and_only_if_it_was_there(rerun):
    drawing, gone = _Drawing(rerun, rerun), marker(Marker.CUBE)
    gone.action = Marker.DELETE
    drawing.draw([gone])
    assert rerun.logged == []
    drawing.draw([marker(Marker.CUBE), gone, gone])
    assert [archetype.kind for _, archetype in rerun.logged] == ["Boxes3D", "Clear"]
    assert rerun.logged[1][0] == "bus/cells/3" and rerun.logged[1][1].recursive


def test_a_recording_becomes_a_file_with_its_stamps(rerun, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "rerun", rerun)
    file = tmp_path / "flight.rrd"
    assert view.main([str(REFERENCE), "--rerun", str(file), "--every", "500"]) == 0
    assert file.read_bytes() == b"rrd" and list(tmp_path.iterdir()) == [file]
    assert rerun.called[0] == "sunpoint" and str(file) in capsys.readouterr().out
    (timelines, stamps) = zip(*rerun.stamps, strict=True)
    assert set(timelines) == {"flight"} and list(stamps) == sorted(stamps) and len(set(stamps)) == 3
    kinds = {archetype.kind for _, archetype in rerun.logged}
    assert {"Transform3D", "Boxes3D", "Arrows3D", "Mesh3D"} <= kinds
