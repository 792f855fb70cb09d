# SPDX-License-Identifier: Apache-2.0
"""Recordings are what other readers take for one: `rosbags`, `mcap` with ROS 2 support, `pymcap-cli`."""

from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from presence import present
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader

from css_recording.bag_metadata import Topic
from css_recording.bag_reader import BagReader
from css_recording.bag_writer import BagWriter

STEPS = 57


@pytest.fixture(scope="module")
def recording(flight, tmp_path_factory):
    return flight.record(tmp_path_factory.mktemp("flights") / "flight", STEPS)


def test_rosbags_decodes_the_values_with_the_recorded_definitions(flight, recording):
    # AnyReader knows css_msgs only from the schema inside the file
    with AnyReader([recording]) as reader:
        seen: list[tuple[str, int, Any]] = [
            (connection.topic, stamp, reader.deserialize(data, connection.msgtype))
            for connection, stamp, data in reader.messages()
        ]
    assert len(seen) == 3 * STEPS
    for (topic, stamp, message), (name, expected_stamp, _) in zip(seen, flight.messages(STEPS), strict=True):
        assert (topic, stamp) == (name, expected_stamp)
        header = message.header.stamp
        assert header.sec * 10**9 + header.nanosec == stamp
        step = (stamp - flight.messages(1)[0][1]) // 100_000_000
        if topic == "/css/voltages":
            assert np.array_equal(message.voltages, np.linspace(0.0, 1.0, 8) * step)
        elif topic == "/gyro/imu":
            assert message.angular_velocity.x == 1e-3 * step
        else:
            assert np.array_equal(message.torque, np.full(4, 1e-3 * step))


def test_mcap_ros2_support_decodes_the_values(flight, recording):
    with (recording / "flight_0.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        seen = list(reader.iter_decoded_messages())
    assert [(entry.channel.topic, entry.message.log_time, entry.message.data) for entry in seen] == [
        message for message in flight.messages(STEPS)
    ]
    for entry in seen:
        stamp = entry.decoded_message.header.stamp
        assert stamp.sec * 10**9 + stamp.nanosec == entry.message.log_time == entry.message.publish_time
        if entry.channel.topic == "/wheels/torque_command":
            step = (entry.message.log_time - flight.messages(1)[0][1]) // 100_000_000
            assert list(entry.decoded_message.torque) == [1e-3 * step] * 4


def test_doctor_finds_neither_error_nor_warning(recording, doctor):
    report = doctor(recording / "flight_0.mcap")
    assert "passed" in report
    assert "warning" not in report.lower()


def test_doctor_accepts_events_attachments_and_late_messages(flight, tmp_path, doctor):
    with BagWriter(tmp_path / "bag", flight.topics, {"mission": ""}) as writer:
        messages = flight.messages(60)
        for message in messages[30:]:
            writer.write(*message)
        writer.add_metadata("event", {"name": "gyro off"})
        for message in messages[:30]:
            writer.write(*message)
        writer.attach("mission.yaml", "text/yaml", b"name: test\n", messages[-1][1])
        assert writer.late_messages > 0
    assert "passed" in doctor(writer.path)
    with BagReader(writer.folder) as reader:
        assert [(m.topic, m.stamp_ns, m.data) for m in reader.messages()] == messages
        assert ("event", {"name": "gyro off"}) in reader.metadata
    with Reader(writer.folder) as reader:
        stamps = [stamp for _, stamp, _ in reader.messages()]
        assert stamps == sorted(stamp for _, stamp, _ in messages)


def test_empty_recording_is_readable(flight, tmp_path, doctor):
    with BagWriter(tmp_path / "empty", flight.topics) as writer:
        pass
    doctor(writer.path)
    with Reader(writer.folder) as reader:
        assert reader.message_count == 0
        assert sorted(connection.topic for connection in reader.connections) == sorted(
            topic.name for topic in flight.topics
        )
    with BagReader(writer.folder) as reader:
        assert list(reader.messages()) == []
        assert (reader.start_ns, reader.end_ns, reader.duration_ns) == (0, 0, 0)


def test_topic_without_messages_and_topic_added_in_flight(flight, tmp_path, doctor):
    extra = Topic("extra", "std_msgs/msg/Header")
    with BagWriter(tmp_path / "bag", flight.topics[:1]) as writer:
        for message in flight.messages(30):
            if message[0] == flight.topics[0].name:
                writer.write(*message)
        writer.add_topic(extra)
        writer.add_topic(extra)
    doctor(writer.path)
    with BagReader(writer.folder) as reader:
        assert {entry.topic.name: entry.count for entry in reader.topics} == {
            "/css/voltages": 30,
            "/extra": 0,
        }
        assert present(reader.topics[1].topic.schema).type_name == "std_msgs/msg/Header"
    with Reader(writer.folder) as reader:
        assert {connection.topic: connection.msgcount for connection in reader.connections} == {
            "/css/voltages": 30,
            "/extra": 0,
        }


def test_own_reader_gives_what_was_written(flight, recording):
    with BagReader(recording) as reader:
        assert [(m.topic, m.stamp_ns, m.data) for m in reader.messages()] == flight.messages(STEPS)
        assert {entry.topic.name: entry.topic.type for entry in reader.topics} == {
            topic.name: topic.type for topic in flight.topics
        }
        assert reader.mission_text == "name: test\n"
        assert reader.duration_ns == (STEPS - 1) * 100_000_000
        assert reader.message_count == 3 * STEPS
