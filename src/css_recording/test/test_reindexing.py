# SPDX-License-Identifier: Apache-2.0
"""Folders whose index is lost or wrong: `recover` makes them readable or says in one line why it cannot."""

import random
import shutil

import pytest
import yaml
from mcap.writer import Writer
from presence import present
from rosbags.highlevel import AnyReader

from css_recording.bag_metadata import Topic
from css_recording.bag_reader import BagReader
from css_recording.bag_writer import BagWriter
from css_recording.errors import BagError
from css_recording.recovery import recover
from css_recording.schemas import MessageSchema, schema_of

STEPS = 30


def read(path):
    with BagReader(path) as reader:
        return [(m.topic, m.stamp_ns, m.data) for m in reader.messages()], reader.notes


@pytest.fixture
def split(flight, tmp_path):
    """A recording in twelve files and without metadata."""
    folder = tmp_path / "split"
    folder.mkdir()
    messages = flight.messages(STEPS)
    for number in range(12):
        part = messages[number * len(messages) // 12 : (number + 1) * len(messages) // 12]
        with BagWriter(tmp_path / "part", flight.topics, {"mission": "m: 1"}, overwrite=True) as writer:
            for message in part:
                writer.write(*message)
        shutil.move(writer.path, folder / f"split_{number}.mcap")
    return folder


def test_a_split_recording_gets_metadata_that_names_its_files_in_order(flight, split):
    with pytest.raises(BagError, match="unfinished"):
        BagReader(split)
    report = recover(split)
    assert not report.was_complete and not report.losses
    assert report.messages == {topic.name: STEPS for topic in flight.topics}
    assert read(split) == (flight.messages(STEPS), [])
    information = yaml.safe_load((split / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert information["relative_file_paths"] == [f"split_{number}.mcap" for number in range(12)]
    assert [file["message_count"] for file in information["files"]] == [7, 8, 7, 8, 7, 8, 7, 8, 7, 8, 7, 8]
    assert information["message_count"] == 3 * STEPS
    assert information["starting_time"]["nanoseconds_since_epoch"] == flight.messages(1)[0][1]
    assert information["duration"]["nanoseconds"] == (STEPS - 1) * 10**8
    with AnyReader([split]) as reader:
        assert sum(1 for _ in reader.messages()) == 3 * STEPS
    assert recover(split).was_complete


def test_the_torn_file_of_a_split_recording_is_mended_and_the_others_are_left(flight, split):
    torn = split / "split_11.mcap"
    torn.write_bytes(torn.read_bytes()[:-100])
    before = (split / "split_3.mcap").stat().st_mtime_ns
    report = recover(split)
    assert report.torn_bytes > 0
    messages, notes = read(split)
    assert messages == flight.messages(STEPS)
    assert any("split_11.mcap had no end: up to a second may be missing" in note for note in notes)
    assert (split / "split_3.mcap").stat().st_mtime_ns == before


def test_a_file_that_is_gone_is_remembered_by_the_recording(flight, split):
    recover(split)
    (split / "split_4.mcap").unlink()
    with pytest.raises(BagError, match=r"names split_4\.mcap, which is not there"):
        BagReader(split)
    report = recover(split)
    assert "metadata.yaml named split_4.mcap, which is not there; written anew" in report.notes
    messages, notes = read(split)
    assert notes == ["it was recovered; lost or in doubt: split_4.mcap, which was not there"]
    assert set(messages) < set(flight.messages(STEPS)) and len(messages) == 3 * STEPS - 7
    assert recover(split).was_complete
    (split / "split_5.mcap").unlink()
    recover(split)
    assert read(split)[1] == [
        "it was recovered; lost or in doubt: split_4.mcap, which was not there; split_5.mcap, which was not there"
    ]


def test_a_renamed_file_is_found_again(flight, tmp_path):
    folder = flight.record(tmp_path / "bag", STEPS)
    (folder / "bag_0.mcap").rename(folder / "other.mcap")
    with pytest.raises(BagError, match=rf"names bag_0\.mcap, which is not there.*recover {folder}"):
        BagReader(folder)
    report = recover(folder)
    assert "metadata.yaml named bag_0.mcap, which is not there; written anew" in report.notes
    assert read(folder) == (flight.messages(STEPS), [])
    assert recover(folder).was_complete


def test_what_metadata_say_wrongly_is_said_and_put_right(flight, tmp_path):
    folder = flight.record(tmp_path / "bag", STEPS)
    path = folder / "metadata.yaml"
    right = path.read_text()
    path.write_text(right.replace("message_count: 90", "message_count: 91"))
    assert read(folder) == (
        flight.messages(STEPS),
        ["metadata.yaml speaks of 91 messages, the files hold 90"],
    )
    assert not recover(folder).was_complete
    assert path.read_text() == right
    path.write_text(right.replace("  - bag_0.mcap\n", "  - bag_0.mcap\n  - ./bag_0.mcap\n"))
    assert read(folder)[0] == flight.messages(STEPS)
    path.write_text(right + "  pilot: me\nother: [1]\n")
    assert read(folder) == (flight.messages(STEPS), [])
    assert recover(folder).was_complete


def test_a_file_that_metadata_do_not_name_is_left_out_and_named(flight, tmp_path):
    folder = flight.record(tmp_path / "bag", STEPS)
    shutil.copyfile(folder / "bag_0.mcap", folder / "copy.mcap")
    assert read(folder) == (flight.messages(STEPS), ["metadata.yaml does not name copy.mcap: left out"])
    assert recover(folder).was_complete


def with_foreign_topics(flight, path, finished):
    """A file that also has a topic defined in IDL alone and one that is not of ROS."""
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2")
        cells = writer.register_schema(
            "css_msgs/msg/CssVoltages", "ros2msg", schema_of(flight.topics[0].type).text.encode()
        )
        text = "module lab { module msg { struct Lamp { double power; }; }; };"
        lamp = writer.register_schema("lab/msg/Lamp", "ros2idl", text.encode())
        blob = writer.register_schema("lab.Blob", "protobuf", b"\x0a\xff\xfe\x00")
        channels = [
            writer.register_channel("/css/voltages", "cdr", cells),
            writer.register_channel("/lamp", "cdr", lamp),
            writer.register_channel("/blob", "protobuf", blob),
        ]
        for step in range(10):
            stamp_ns, data = flight.messages(1, first=step)[0][1:]
            for channel, body in zip(channels, (data, b"\0\1\0\0" + bytes(8), b"\x01"), strict=True):
                writer.add_message(channel, stamp_ns, body, stamp_ns)
        if finished:
            writer.finish()
        else:
            writer.flush()
    return path


def test_topics_in_idl_and_topics_that_are_not_of_ros_survive_a_recovery(flight, tmp_path):
    torn = with_foreign_topics(flight, tmp_path / "torn.mcap", finished=False)
    whole = with_foreign_topics(flight, tmp_path / "whole.mcap", finished=True)
    report = recover(torn)
    assert report.messages == {"/css/voltages": 10, "/lamp": 10, "/blob": 10}
    for path in (torn, whole):
        with BagReader(path) as reader:
            assert {entry.topic.name: entry.count for entry in reader.topics} == {"/css/voltages": 10, "/lamp": 10}
            lamp = reader.topics[1].topic
            assert present(lamp.schema).encoding == "ros2idl" and "double power" in present(lamp.schema).text
            assert len(list(reader.messages())) == 20
            assert any("/blob is encoded as 'protobuf'" in note for note in reader.notes)
            with pytest.raises(BagError, match="/blob is encoded as 'protobuf'"):
                next(reader.messages(["/blob"]))
    assert b"\x0a\xff\xfe\x00" in torn.read_bytes()


def test_messages_without_a_type_are_left_out_only_when_an_output_is_named(flight, tmp_path):
    torn = tmp_path / "torn.mcap"
    with torn.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2")
        channel = writer.register_channel("/plain", "cdr", 0)
        writer.add_message(channel, 5, b"\0\1\0\0", 5)
        writer.flush()
    with pytest.raises(BagError, match="1 messages are not of ROS 2; name an output"):
        recover(torn)
    assert recover(torn, tmp_path / "saved").refused_messages == 1


DAMAGES = {
    "metadata cut": lambda bag, dice: _cut(bag / "metadata.yaml", dice),
    "metadata gone": lambda bag, dice: (bag / "metadata.yaml").unlink(),
    "metadata of another": lambda bag, dice: (bag / "metadata.yaml").write_text("rosbag2_bagfile_information: 7\n"),
    "file cut": lambda bag, dice: _cut(_file(bag, dice), dice),
    "file renamed": lambda bag, dice: _file(bag, dice).rename(bag / "renamed.mcap"),
    "file gone": lambda bag, dice: _file(bag, dice).unlink(),
    "bits flipped": lambda bag, dice: _flip(_file(bag, dice), dice),
    "file empty": lambda bag, dice: _file(bag, dice).write_bytes(b""),
}


def _file(bag, dice):
    return dice.choice(sorted(bag.glob("*.mcap")))


def _cut(path, dice):
    path.write_bytes(path.read_bytes()[: dice.randrange(path.stat().st_size)])


def _flip(path, dice):
    data = bytearray(path.read_bytes())
    data[dice.randrange(len(data))] ^= 1 << dice.randrange(8)
    path.write_bytes(data)


@pytest.mark.parametrize("damage", DAMAGES)
def test_recover_makes_it_readable_or_says_why_not_and_never_sends_anyone_in_a_circle(flight, tmp_path, damage):
    folder = flight.record(tmp_path / "bag", STEPS)
    shutil.copyfile(folder / "bag_0.mcap", tmp_path / "whole.mcap")
    known = set(flight.messages(STEPS))
    dice = random.Random(damage)
    for number in range(6):
        bag = shutil.copytree(folder, tmp_path / str(number) / "bag")
        DAMAGES[damage](bag, dice)
        try:
            recover(bag)
        except BagError as error:
            assert "\n" not in str(error)
            if "name an output" not in str(error):
                continue
            bag = recover(bag, tmp_path / str(number) / "saved").recording
        messages, notes = read(bag)
        assert set(messages) <= known
        assert len(messages) == len(known) or notes
        assert recover(bag).was_complete


def test_files_of_one_folder_that_contradict_each_other_are_refused(flight, split):
    with BagWriter(split.parent / "other", [Topic("/css/voltages", "std_msgs/msg/Header")]) as writer:
        pass
    shutil.copyfile(writer.path, split / "split_12.mcap")
    with pytest.raises(BagError, match="topic /css/voltages has two types"):
        recover(split)
    schema = MessageSchema("css_msgs/msg/CssVoltages", "float32 x\n", "")
    with BagWriter(split.parent / "third", [Topic("/css/voltages", schema.type_name, schema=schema)]) as writer:
        pass
    shutil.copyfile(writer.path, split / "split_12.mcap")
    with pytest.raises(BagError, match="topic /css/voltages has two definitions"):
        recover(split)
    assert not (split / "metadata.yaml").exists()
