# SPDX-License-Identifier: Apache-2.0
"""Serialised markers against rclpy, and what a node and a recording give of them."""

import json
import math
import re
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from presence import present
from rclpy.serialization import deserialize_message
from scipy.spatial.transform import Rotation
from visualization_msgs.msg import Marker, MarkerArray

from css_common.codec import Sample, codec_of, type_name
from css_common.component import Component
from css_common.mission import load_mission
from css_common.testing import Bench
from css_common.tree_codec import TreeCodec, encoder_of, named_only
from css_msgs.msg import SpacecraftState, SunEstimate
from css_recording.bag_reader import BagReader
from css_viewers.commands import view
from css_viewers.nodes.visualizer import Visualizer
from css_viewers.shapes import ARROW, CUBE, TEXT, Shape
from css_viewers.viewer_messages import marker_array, transforms

ROOT = Path(__file__).parents[3]
REFERENCE = ROOT / "bags" / "reference"
STAMP = 1_370_044_800_123_456_789


@pytest.fixture
def mission():
    return load_mission("okeefe_2013").with_node(("css_viewers", "visualizer", "visualizer"), {"divider": "2"})


def encoded(message, message_type=MarkerArray):
    return encoder_of(message_type).encode(Sample(STAMP, "bus", message=message))


def test_markers_are_what_rclpy_reads():
    shapes = [
        Shape("body", 0, CUBE, "bus", (0.1, 0.2, 0.3, 1.0), (1.0, 2.0, 3.0), (4.0, 5.0, 6.0), (0.5, -0.5, 0.5, 0.5)),
        Shape("sun", 7, ARROW, "eci", (1.0, 1.0, 0.0, 0.5), points=np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 2.0]])),
        Shape("text", 0, TEXT, "eci", (1.0, 1.0, 1.0, 1.0), text="eclipse, 3 deg"),
    ]
    array = deserialize_message(encoded(marker_array(STAMP, shapes, [("gone", 3)])), MarkerArray)
    cube, arrow, text, gone = array.markers
    assert (cube.header.stamp.sec, cube.header.stamp.nanosec) == divmod(STAMP, 10**9)
    assert (cube.header.frame_id, cube.ns, cube.id, cube.type) == ("bus", "body", 0, Marker.CUBE)
    assert (cube.scale.x, cube.scale.y, cube.scale.z) == (1.0, 2.0, 3.0)
    assert (cube.pose.position.z, cube.pose.orientation.y, cube.color.g) == (6.0, -0.5, pytest.approx(0.2))
    assert arrow.type == Marker.ARROW and arrow.points[1].z == 2.0 and arrow.id == 7
    assert text.type == Marker.TEXT_VIEW_FACING and text.text == "eclipse, 3 deg"
    assert (gone.ns, gone.id, gone.action) == ("gone", 3, Marker.DELETE)


def test_equal_messages_are_equal_bytes_in_whole_words():
    shapes = [Shape("text", 0, TEXT, "eci", (1.0, 1.0, 1.0, 1.0), text="odd")]
    once, again = (encoded(marker_array(STAMP, shapes)) for _ in range(2))
    assert once == again
    assert len(once) % 4 == 0


def test_a_number_that_is_none_is_found_by_its_path():
    shape = Shape("body", 0, CUBE, "bus", (0.1, 0.2, 0.3, 1.0), position=(0.0, math.nan, 0.0))
    sample = Sample(STAMP, "bus", message=marker_array(STAMP, [shape]))
    assert TreeCodec.first_not_finite([], sample) == "markers[0].pose.position.y"


def test_a_type_that_nobody_knows_is_refused():
    with pytest.raises(TypeError, match="no_msgs/msg/Nothing"):
        encoder_of(named_only("no_msgs/msg/Nothing"))


def test_transforms_turn_vectors_of_the_body_to_those_of_its_parent():
    turn = Rotation.from_rotvec([0.3, -0.2, 0.9])
    message = transforms(STAMP, [("spacecraft", "bus", (1.0, 2.0, 3.0), tuple(turn.as_quat()))])
    (link,) = message.transforms
    rotation = link.transform.rotation
    read = Rotation.from_quat([rotation.x, rotation.y, rotation.z, rotation.w])
    np.testing.assert_allclose(read.as_matrix(), turn.as_matrix())


def given_truth(stamp_ns, sigma_bn=(0.1, -0.2, 0.3)):
    fields = {"r_n": np.array([7e6, 1e5, 0.0]), "sun_n": np.array([0.0, 1.0, 0.0]), "illumination": 1.0}
    return codec_of(SpacecraftState).sample(stamp_ns, "eci", sigma_bn=np.array(sigma_bn), **fields)


def test_the_pose_is_the_attitude_of_the_truth(mission):
    component: Component = Visualizer("visualizer", mission.node("visualizer").values)
    given: Any = component.cycle(component.epoch_ns, {"truth": given_truth(component.epoch_ns)})
    pose = given["pose"].pose
    # scipy's MRP is the rotation of vectors from body to inertial axes
    expected = Rotation.from_mrp([0.1, -0.2, 0.3])
    np.testing.assert_allclose(Rotation.from_quat(pose[3:]).as_matrix(), expected.as_matrix(), atol=1e-12)
    np.testing.assert_array_equal(pose[:3], (7e6, 1e5, 0.0))


def test_what_is_no_more_is_taken_away(mission):
    component: Component = Visualizer("visualizer", mission.node("visualizer").values)
    sun = codec_of(SunEstimate).sample(0, "bus", sun_b=np.array([0.0, 0.0, 1.0]), validity=2)
    stamps = [component.epoch_ns + k * 2 * component.period_ns for k in range(3)]
    heard = [sun, codec_of(SunEstimate).sample(0, "bus"), codec_of(SunEstimate).sample(0, "bus")]
    actions = []
    for stamp_ns, one in zip(stamps, heard, strict=True):
        given: Any = component.cycle(stamp_ns, {"truth": given_truth(stamp_ns), "sun": one})
        actions.append({m.ns: m.action for m in given["markers"].message.markers if m.ns == "sun_estimate"})
    assert actions == [{"sun_estimate": Marker.ADD}, {"sun_estimate": Marker.DELETE}, {}]


def test_only_every_so_many_cycles_are_drawn(mission):
    component: Component = Visualizer("visualizer", mission.node("visualizer").values)
    drawn = [
        bool(component.cycle(stamp_ns, {"truth": given_truth(stamp_ns)}))
        for stamp_ns in (component.epoch_ns + k * component.period_ns for k in range(4))
    ]
    assert drawn == [True, False, True, False]


def test_a_recording_becomes_one_for_viewers(tmp_path, capsys):
    present(REFERENCE)
    out = tmp_path / "drawn"
    assert view.main([str(REFERENCE), "-o", str(out), "--every", "100", "--json"]) == 0
    told = json.loads(capsys.readouterr().out.splitlines()[-1])
    with BagReader(REFERENCE) as reader, BagReader(out) as drawn:
        flown = {entry.topic.name: entry.count for entry in reader.topics}
        counts = {entry.topic.name: entry.count for entry in drawn.topics}
        markers = [m for m in drawn.messages({"/visualizer/markers"})]
        states = {m.stamp_ns for m in reader.messages({"/truth"})}
    assert {name: counts[name] for name in flown} == flown
    assert counts["/visualizer/markers"] == counts["/visualizer/pose"] == counts["/tf"] == 15
    assert told["messages"] == 45 and told["refused"] == 0 and told["notes"] == []
    assert {message.stamp_ns for message in markers} <= states
    first = deserialize_message(markers[0].data, MarkerArray)
    assert {m.ns for m in first.markers} >= {"body", "arrays", "cells", "views", "wheels", "sun", "earth", "text"}


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        ([str(REFERENCE), "--every", "0"], "--every: 0 given"),
        (["no/where"], "no/where"),
        ([str(REFERENCE), "--rerun", "/no/where/file.rrd"], "rerun"),
        ([str(REFERENCE), "-o", "x", "--rerun", "y"], "expected one of them"),
    ],
)
def test_what_cannot_be_drawn_is_said_in_one_line(arguments, reason, capsys):
    code: Any
    try:
        code = view.main(arguments)
    except SystemExit as stopped:
        code = stopped.code
    errors = capsys.readouterr().err.strip().splitlines()
    assert code == 2
    assert reason in errors[-1]


def layout_paths() -> list[tuple[str, str, str]]:
    """File, topic and field of everything that the layouts show."""
    text = (ROOT / "config" / "viewers" / "foxglove.json").read_text()
    found = [("foxglove.json", *path.split(".", 1)) for path in re.findall(r'"value": "([^"]+)"', text)]
    tree = ET.parse(ROOT / "config" / "viewers" / "plotjuggler.xml")
    for curve in tree.iter("curve"):
        topic, _, field = present(curve.get("name")).rpartition("/")
        found.append(("plotjuggler.xml", topic, field))
    return found


@pytest.mark.parametrize(("file", "topic", "field"), layout_paths())
def test_layouts_show_what_there_is(file, topic, field, mission):
    message_type = mission.topics[topic.lstrip("/")]
    name, index = present(re.fullmatch(r"(\w+)(?:\[(\d+)\])?", field)).groups()
    known = {f.name: f.count for f in codec_of(message_type).fields}
    assert name in known, f"{type_name(message_type)} has no {name}"
    lengths = {"voltages": 8, "speed": 4}
    assert (known[name] is None) == (index is None)
    if index is not None:
        assert int(index) < (known[name] or lengths[name])


def test_the_3d_layout_shows_topics_and_frames_of_the_visualizer(mission):
    layout = json.loads((ROOT / "config" / "viewers" / "foxglove.json").read_text())
    scene = layout["configById"]["3D!spacecraft"]
    published = {f"/{output.topic}" for output in mission.node("visualizer").outputs}
    assert scene["topics"].keys() <= published
    assert scene["followTf"] == mission.node("visualizer").values.local_frame

    def panels(part):
        return {part} if isinstance(part, str) else panels(part["first"]) | panels(part["second"])

    assert panels(layout["layout"]) == layout["configById"].keys()


def test_in_a_flight_it_draws(mission):
    with Bench() as bench:
        poses = bench.listen("visualizer/pose", PoseStamped)
        states = bench.listen("truth", SpacecraftState)
        bench.host_all(mission.with_overrides(["mission.duration=3.0", "visualizer.divider=5"]))
        bench.until(lambda: len(poses) == 6 and len(states) == 30, "the flight is over")
    stamps = [state.stamp_ns for state in states]
    assert [pose.stamp_ns for pose in poses] == stamps[::5]
