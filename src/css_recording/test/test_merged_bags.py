# SPDX-License-Identifier: Apache-2.0
"""Several recordings as one."""

import pytest

from css_recording.bag_metadata import Topic
from css_recording.bag_writer import BagWriter
from css_recording.errors import BagError
from css_recording.merged_bags import MergedBags


@pytest.fixture
def parts(flight, tmp_path):
    """Two recordings of one flight: the even steps, and the odd ones without torque."""
    for name, remainder, topics in (("even", 0, flight.topics), ("odd", 1, flight.topics[:2])):
        with BagWriter(tmp_path / name, topics) as writer:
            for step in range(remainder, 30, 2):
                for topic in topics:
                    writer.write(*flight.message(topic, step))
    return [tmp_path / "even", tmp_path / "odd"]


def test_messages_are_merged_by_time(flight, parts):
    with MergedBags(parts) as bags:
        played = [(m.topic, m.stamp_ns, m.data) for m in bags.messages()]
        counts = {entry.topic.name: entry.count for entry in bags.topics}
        span = bags.start_ns, bags.end_ns
    expected = [m for m in flight.messages(30) if m[0] != "/wheels/torque_command" or m[1] // 10**8 % 2 == 0]
    assert played == expected
    assert counts == {"/css/voltages": 30, "/gyro/imu": 30, "/wheels/torque_command": 15}
    assert span == (expected[0][1], expected[-1][1])


def test_a_topic_that_only_one_has_can_be_chosen_and_renamed(flight, parts):
    with MergedBags(parts, {"wheels/torque_command": "torque", "gyro/imu": "rate"}) as bags:
        played = [m.topic for m in bags.messages({"/torque", "/rate"})]
    assert played.count("/torque") == 15
    assert played.count("/rate") == 30
    with pytest.raises(BagError, match="no topic /nonesuch to rename"):
        MergedBags(parts, {"nonesuch": "other"})


def test_two_types_of_one_topic_are_refused_by_name(flight, parts, tmp_path):
    with BagWriter(tmp_path / "other", [Topic("/gyro/imu", "std_msgs/msg/String")]):
        pass
    with pytest.raises(BagError, match=r"topic /gyro/imu is sensor_msgs/msg/Imu in .*even and std_msgs/msg/String in"):
        MergedBags([*parts, tmp_path / "other"])


def test_an_empty_recording_does_not_move_the_beginning(flight, parts, tmp_path):
    with BagWriter(tmp_path / "empty", flight.topics):
        pass
    with MergedBags([tmp_path / "empty", *parts]) as bags:
        assert bags.start_ns == flight.messages(1)[0][1]
