# SPDX-License-Identifier: Apache-2.0
"""Recordings of several files, read by others and by Sunpoint."""

import shutil
from collections import deque
from itertools import starmap

import pytest
import yaml
from rosbags.rosbag2 import Reader

from css_recording.bag_reader import BagReader
from css_recording.errors import BagError
from css_recording.recovery import recover
from css_recording.split_bag_writer import FileLimits, SplitBagWriter

SECOND = 1_000_000_000


def record(flight, folder, steps, files):
    with SplitBagWriter(folder, flight.topics, {"mission": "name: test\n"}, files=files) as writer:
        for message in flight.messages(steps):
            writer.write(*message)


def messages(path):
    with BagReader(path) as reader:
        return [(m.topic, m.stamp_ns, m.data) for m in reader.messages()]


def information(folder):
    return yaml.safe_load((folder / "metadata.yaml").read_text())["rosbag2_bagfile_information"]


@pytest.fixture
def split(flight, tmp_path):
    """25 s in files of 10 s."""
    record(flight, tmp_path / "bag", 250, FileLimits(longest_ns=10 * SECOND))
    return tmp_path / "bag"


def test_by_duration_each_file_holds_its_time(flight, split, doctor):
    names = ["bag_0.mcap", "bag_1.mcap", "bag_2.mcap"]
    assert sorted(path.name for path in split.glob("*.mcap")) == names
    assert messages(split) == flight.messages(250)
    for number, name in enumerate(names):
        own = flight.messages(min(100, 250 - 100 * number), first=100 * number)
        assert messages(split / name) == own
        doctor(split / name)


def test_metadata_tells_of_the_whole_and_of_each_file(flight, split):
    found = information(split)
    start = flight.messages(1)[0][1]
    assert found["relative_file_paths"] == ["bag_0.mcap", "bag_1.mcap", "bag_2.mcap"]
    assert found["message_count"] == 750
    assert found["starting_time"]["nanoseconds_since_epoch"] == start
    assert found["duration"]["nanoseconds"] == 249 * SECOND // 10
    counts = {t["topic_metadata"]["name"]: t["message_count"] for t in found["topics_with_message_count"]}
    assert counts == {"/css/voltages": 250, "/gyro/imu": 250, "/wheels/torque_command": 250}
    assert [
        (
            file["path"],
            file["starting_time"]["nanoseconds_since_epoch"] - start,
            file["duration"]["nanoseconds"],
            file["message_count"],
        )
        for file in found["files"]
    ] == [
        ("bag_0.mcap", 0, 99 * SECOND // 10, 300),
        ("bag_1.mcap", 10 * SECOND, 99 * SECOND // 10, 300),
        ("bag_2.mcap", 20 * SECOND, 49 * SECOND // 10, 150),
    ]


def test_rosbags_reads_the_whole(flight, split):
    with Reader(split) as reader:
        read = [(c.topic, stamp, bytes(data)) for c, stamp, data in reader.messages()]
        assert reader.message_count == 750
    assert sorted(read) == sorted(flight.messages(250))


def test_each_file_is_whole_by_itself(split, tmp_path):
    for path in split.glob("*.mcap"):
        alone = tmp_path / path.name
        shutil.copy(path, alone)
        with BagReader(alone) as reader:
            assert reader.mission_text == "name: test\n"
            own = [values for name, values in reader.metadata if name == "rosbag2"]
        assert len(own) == 1
        assert yaml.safe_load(own[0]["serialized_metadata"])["relative_file_paths"] == [path.name]
        assert recover(alone).was_complete


def test_by_size_the_next_file_begins_when_one_has_reached_it(flight, tmp_path):
    record(flight, tmp_path / "bag", 400, FileLimits(most_bytes=20_000))
    files = information(tmp_path / "bag")["relative_file_paths"]
    assert len(files) > 2
    sizes = [(tmp_path / "bag" / name).stat().st_size for name in files]
    assert all(size >= 20_000 for size in sizes[:-1])
    assert messages(tmp_path / "bag") == flight.messages(400)


def test_without_limits_the_bytes_are_those_of_one_file(flight, tmp_path):
    record(flight, tmp_path / "split" / "bag", 60, FileLimits())
    flight.record(tmp_path / "one" / "bag", 60)
    for name in ("bag_0.mcap", "metadata.yaml"):
        assert (tmp_path / "split" / "bag" / name).read_bytes() == (tmp_path / "one" / "bag" / name).read_bytes()


def test_a_topic_that_comes_later_is_in_the_files_from_there_on(flight, tmp_path):
    voltages, imu, _ = flight.topics
    with SplitBagWriter(tmp_path / "bag", [voltages], files=FileLimits(longest_ns=SECOND)) as writer:
        for step in range(40):
            if step == 20:
                writer.add_topic(imu)
            writer.write(*flight.message(voltages, step))
            if step >= 20:
                writer.write(*flight.message(imu, step))
    counts = {t["topic_metadata"]["name"]: t["message_count"] for t in
              information(tmp_path / "bag")["topics_with_message_count"]}  # fmt: skip
    assert counts == {"/css/voltages": 40, "/gyro/imu": 20}
    with BagReader(tmp_path / "bag") as reader:
        assert sum(1 for m in reader.messages(["/gyro/imu"])) == 20


def test_a_full_disk_between_two_files_ends_the_recording_with_what_it_has(flight, tmp_path, monkeypatch):
    def refuse(path):
        raise BagError(f"{path}: cannot create the recording: No space left on device")

    with SplitBagWriter(tmp_path / "bag", flight.topics, files=FileLimits(longest_ns=SECOND)) as writer:
        for message in flight.messages(5):
            writer.write(*message)
        monkeypatch.setattr("css_recording.split_bag_writer.McapOutput", refuse)
        with pytest.raises(BagError, match="No space left"):
            deque(starmap(writer.write, flight.messages(60, first=5)))
        assert writer.closed
    assert messages(tmp_path / "bag" / "bag_0.mcap") == flight.messages(10)


def test_of_a_folder_that_is_deleted_the_file_being_written_is_saved(flight, tmp_path):
    folder, saved = tmp_path / "bag", tmp_path / "bag_rescued"
    writer = SplitBagWriter(folder, flight.topics, {"mission": "m: 1"}, files=FileLimits(longest_ns=2 * 10**9))
    written = flight.messages(50)
    for message in written:
        writer.write(*message)
    shutil.rmtree(folder)
    with pytest.raises(BagError, match=rf"was deleted .*; the last 90 of 150 messages until then are in {saved}"):
        writer.close()
    kept = messages(saved)
    assert kept == written[-len(kept) :]
    assert len(kept) == 90  # of the file that began at 2 s
    with BagReader(saved) as reader:
        assert reader.notes == []
        assert reader.mission_text == "m: 1"
