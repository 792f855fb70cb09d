# SPDX-License-Identifier: Apache-2.0
"""Where each message finds its time, and what is counted on the way."""

import pytest

from css_recording.bag_metadata import Topic
from css_recording.bag_reader import BagReader
from css_recording.bag_writer import BagWriter
from css_recording.errors import BagError
from css_recording.flight_recorder import FlightRecorder, stamp_place

STATUS = Topic("/status", "std_msgs/msg/String")
EVENTS = Topic("/parameter_events", "rcl_interfaces/msg/ParameterEvent")
TEXT = b"\0\1\0\0\2\0\0\0a\0\0\0"


@pytest.fixture
def recorder(flight, tmp_path):
    writer = BagWriter(tmp_path / "bag", [*flight.topics, STATUS, EVENTS])
    return FlightRecorder(writer, {"/css/voltages": 100_000_000})


def recorded(recorder):
    recorder.close()
    with BagReader(recorder.writer.folder) as reader:
        return [(m.topic, m.stamp_ns, m.data) for m in reader.messages()]


@pytest.mark.parametrize(
    ("name", "type_name", "place"),
    [
        *[
            (f"/{name}", f"css_msgs/msg/{name}", 4)
            for name in ("CssVoltages", "ControlStatus", "SunEstimate", "SpacecraftState", "WheelState")
        ],
        ("/imu", "sensor_msgs/msg/Imu", 4),
        ("/header", "std_msgs/msg/Header", 4),
        ("/clock", "rosgraph_msgs/msg/Clock", 4),
        ("/pose", "geometry_msgs/msg/Pose", None),
        ("/text", "std_msgs/msg/String", None),
        ("/empty", "std_msgs/msg/Empty", None),
        ("/markers", "visualization_msgs/msg/MarkerArray", 8),
        ("/points", "geometry_msgs/msg/Polygon", None),
        ("/parameter_events", "rcl_interfaces/msg/ParameterEvent", None),
        ("/rosout", "rcl_interfaces/msg/Log", None),
    ],
)
def test_where_the_stamp_of_a_message_lies(name, type_name, place):
    assert stamp_place(Topic(name, type_name)) == place


def test_a_type_that_is_not_installed_is_named():
    with pytest.raises(BagError, match=r"no_msgs.*not installed"):
        stamp_place(Topic("/transforms", "no_msgs/msg/Nothing"))


def test_log_time_is_the_stamp_of_the_header(flight, recorder):
    for topic, _, data in flight.messages(25):
        recorder.receive(topic, data)
    assert recorder.message_count == 75
    assert recorder.counts["/gyro/imu"] == 25
    assert recorded(recorder) == flight.messages(25)
    assert not recorder.counters


def test_messages_without_a_stamp_get_the_latest(flight, recorder):
    messages = flight.messages(4)
    recorder.receive("/status", TEXT)  # before anything has a stamp
    for topic, _, data in messages[:6]:
        recorder.receive(topic, data)
    recorder.receive("/parameter_events", messages[11][2])
    for topic, _, data in messages[6:]:
        recorder.receive(topic, data)
    seen = recorded(recorder)
    first_ns, second_ns = messages[0][1], messages[3][1]
    assert ("/status", first_ns, TEXT) in seen
    assert ("/parameter_events", second_ns, messages[11][2]) in seen
    assert recorder.counters == {"unstamped": 2}


@pytest.mark.parametrize("stamp", [bytes(8), b"\xff\xff\xff\xff" + bytes(4), b"\0"])
def test_empty_negative_and_missing_stamps_do_no_harm(flight, recorder, stamp):
    topic, stamp_ns, data = flight.messages(1)[0]
    broken = data[:4] + stamp + data[12:] if len(stamp) == 8 else b"\0\1\0\0"
    recorder.receive(topic, data)
    recorder.receive(topic, broken)
    assert recorder.counters == {"unstamped": 1}
    assert recorded(recorder) == [(topic, stamp_ns, data), (topic, stamp_ns, broken)]


def test_without_any_stamp_the_wall_clock_counts(recorder):
    for _ in range(1500):
        recorder.receive("/status", TEXT)
    stamps = [stamp for _, stamp, _ in recorded(recorder)]
    assert len(stamps) == 1500
    assert stamps == sorted(stamps)
    assert stamps[0] > 1_700_000_000_000_000_000


def test_gaps_and_stamps_that_do_not_go_forward_are_counted(flight, recorder):
    for step in (0, 1, 2, 5, 6, 6, 4, 5):
        recorder.receive(*flight.messages(1, first=step)[0][::2])
    assert recorder.counters == {"gaps": 1, "repeated": 1, "back": 1}
    for step in (0, 7, 3):  # a topic without a fixed spacing
        recorder.receive(*flight.messages(1, first=step)[1][::2])
    assert recorder.counters == {"gaps": 1, "repeated": 1, "back": 1}
    assert len(recorded(recorder)) == 11
