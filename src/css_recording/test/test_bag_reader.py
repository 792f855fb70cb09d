# SPDX-License-Identifier: Apache-2.0
"""Recordings of every origin are read alike; what cannot be read is refused in words that help."""

import random

import pytest
from mcap.writer import CompressionType, IndexType, Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as RosbagsWriter

from css_recording.bag_reader import BagReader, Refused
from css_recording.bag_writer import BagWriter
from css_recording.errors import BagError
from css_recording.schemas import schema_of

STEPS = 23


def read(path, *arguments, **options):
    with BagReader(path, **options) as reader:
        return [(m.topic, m.stamp_ns, m.data) for m in reader.messages(*arguments)]


def write_with_rosbags(flight, folder, plugin, mode=CompressionMode.NONE):
    writer = RosbagsWriter(folder, version=9, storage_plugin=plugin)
    if mode != CompressionMode.NONE:
        writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        connections = {
            topic.name: writer.add_connection(topic.name, topic.type, typestore=flight.typestore)
            for topic in flight.topics
        }
        for topic, stamp_ns, data in flight.messages(STEPS):
            writer.write(connections[topic], stamp_ns, data)
    return folder


def write_foreign(flight, path, messages, profile="", encoding="cdr", chunk_size=700, **options):
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=chunk_size, **options)
        writer.start(profile=profile)
        channels = {}
        for topic in flight.topics:
            schema = writer.register_schema(topic.type, "ros2msg", schema_of(topic.type).text.encode())
            channels[topic.name] = writer.register_channel(topic.name, encoding, schema)
        for topic, stamp_ns, data in messages:
            writer.add_message(channels[topic], stamp_ns, data, stamp_ns)
        writer.finish()
    return path


@pytest.mark.parametrize("plugin", [StoragePlugin.SQLITE3, StoragePlugin.MCAP])
def test_folders_written_by_rosbags(flight, tmp_path, plugin):
    folder = write_with_rosbags(flight, tmp_path / "bag", plugin)
    assert read(folder) == flight.messages(STEPS)
    with BagReader(folder) as reader:
        assert {entry.topic.name: entry.count for entry in reader.topics} == {
            topic.name: STEPS for topic in flight.topics
        }
        assert reader.duration_ns == (STEPS - 1) * 100_000_000
        assert reader.start_ns == flight.messages(1)[0][1]
        assert reader.mission_text is None
        assert reader.description == {}


@pytest.mark.parametrize("mode", [CompressionMode.FILE, CompressionMode.MESSAGE])
def test_compressed_sqlite_folders(flight, tmp_path, mode):
    folder = write_with_rosbags(flight, tmp_path / "bag", StoragePlugin.SQLITE3, mode)
    assert read(folder) == flight.messages(STEPS)


def test_bare_files(flight, tmp_path):
    write_with_rosbags(flight, tmp_path / "sqlite", StoragePlugin.SQLITE3)
    assert read(next((tmp_path / "sqlite").glob("*.db3"))) == flight.messages(STEPS)
    own = flight.record(tmp_path / "own", STEPS)
    assert read(own / "own_0.mcap") == flight.messages(STEPS)


@pytest.mark.parametrize("compression", list(CompressionType))
@pytest.mark.parametrize(
    "options",
    [
        {},
        {"use_chunking": False},
        {"index_types": IndexType.NONE},
        {"use_statistics": False},
        {"repeat_channels": False, "repeat_schemas": False},
        {"repeat_channels": False, "use_statistics": False, "index_types": IndexType.NONE},
        {"enable_crcs": False},
        {"enable_data_crcs": True},
    ],
    ids=str,
)
def test_foreign_files_of_every_make(flight, tmp_path, compression, options):
    path = write_foreign(flight, tmp_path / "x.mcap", flight.messages(STEPS), compression=compression, **options)
    assert read(path) == flight.messages(STEPS)
    with BagReader(path) as reader:
        assert reader.message_count == 3 * STEPS
        assert reader.duration_ns == (STEPS - 1) * 100_000_000


@pytest.mark.parametrize("chunking", [True, False])
def test_files_out_of_order_are_read_in_log_time_order(flight, tmp_path, chunking):
    messages = flight.messages(STEPS)
    random.Random(3).shuffle(messages)
    path = write_foreign(flight, tmp_path / "x.mcap", messages, use_chunking=chunking)
    assert sorted(read(path)) == sorted(messages)
    stamps = [stamp for _, stamp, _ in read(path)]
    assert stamps == sorted(stamps)


def test_messages_of_equal_time_keep_the_order_of_the_file(flight, tmp_path):
    message = flight.messages(1)[0]
    same = [(message[0], message[1], message[2] + bytes([number])) for number in range(50)]
    path = write_foreign(flight, tmp_path / "x.mcap", same, chunk_size=300)
    assert read(path) == same


def test_split_recordings_are_one(flight, tmp_path):
    folder = flight.record(tmp_path / "bag", 20)
    messages = flight.messages(20)
    write_foreign(flight, folder / "bag_0.mcap", messages[:30], profile="ros2")
    write_foreign(flight, folder / "bag_1.mcap", messages[30:], profile="ros2")
    metadata = folder / "metadata.yaml"
    text = metadata.read_text()
    metadata.write_text(text.replace("  - bag_0.mcap\n", "  - bag_0.mcap\n  - bag_1.mcap\n"))
    assert read(folder) == messages
    (folder / "bag_1.mcap").unlink()
    with pytest.raises(BagError, match=r"bag_1\.mcap"):
        BagReader(folder)


def test_topics_are_filtered_and_renamed(flight, tmp_path):
    folder = flight.record(tmp_path / "bag", STEPS)
    voltages = [message for message in flight.messages(STEPS) if message[0] == "/css/voltages"]
    assert read(folder, ["css/voltages"]) == voltages
    renamed = [("/a/b", stamp, data) for _, stamp, data in voltages]
    assert read(folder, ["/a/b"], remap={"css/voltages": "a/b"}) == renamed
    with BagReader(folder, remap={"/css/voltages": "/a/b"}) as reader:
        assert [entry.topic.name for entry in reader.topics] == [
            "/a/b",
            "/gyro/imu",
            "/wheels/torque_command",
        ]
        with pytest.raises(BagError, match="no topic /css/voltages; the recording has /a/b"):
            next(reader.messages(["/css/voltages"]))
    with pytest.raises(BagError, match="no topic /nonesuch to rename"):
        BagReader(folder, remap={"nonesuch": "x"})
    with pytest.raises(BagError, match="two topics"):
        BagReader(folder, remap={"css/voltages": "gyro/imu"})


def test_a_span_of_time(flight, tmp_path):
    folder = flight.record(tmp_path / "bag", STEPS)
    messages = flight.messages(STEPS)
    start_ns, end_ns = messages[12][1], messages[30][1]
    expected = [message for message in messages if start_ns <= message[1] < end_ns]
    assert read(folder, None, start_ns, end_ns) == expected
    assert read(folder, None, end_ns, start_ns) == []


def test_mission_and_events_are_read_in_order(flight, tmp_path):
    with BagWriter(tmp_path / "bag", flight.topics, {"mission": "a: 1\n", "python": "3"}) as writer:
        writer.write(*flight.messages(1)[0])
        writer.add_metadata("event", {"what": "first"})
        writer.add_metadata("event", {"what": "second"})
    with BagReader(writer.folder) as reader:
        assert reader.mission_text == "a: 1\n"
        assert reader.description == {"mission": "a: 1\n", "python": "3"}
        assert [values["what"] for name, values in reader.metadata if name == "event"] == ["first", "second"]


@pytest.mark.parametrize(
    ("head", "words"),
    [
        (b"\0\0\0\0", "it is big-endian; only little-endian CDR can be read"),
        (b"\0\3\0\0", "it is encoded as 0003; only little-endian CDR can be read"),
        (b"\0\7\0\0", "it is encoded as 0007; only little-endian CDR can be read"),
        (b"", "it has 0 bytes, fewer than the head of a message"),
        (b"\0\1\0", "it has 3 bytes, fewer than the head of a message"),
    ],
)
def test_malformed_messages_are_passed_over_counted_and_named(flight, tmp_path, head, words):
    good = flight.messages(STEPS)
    bad = [("/css/voltages", good[0][1] + number, head) for number in (1, 2, 3)]
    path = write_foreign(flight, tmp_path / "x.mcap", [*good[:3], *bad, *good[3:]])
    with BagReader(path, {"/css/voltages": "/cells"}) as reader:
        assert [m.data for m in reader.messages()] == [data for _, _, data in good]
        assert reader.refused == [Refused("/cells", words, 3, bad[0][1])]
        assert str(reader.refused[0]) == f"/cells: 3 messages, the first at {bad[0][1]} ns: {words}"
        assert len(list(reader.messages(["/gyro/imu"]))) == STEPS
        assert reader.refused == []


def test_other_encodings_of_channels_are_refused(flight, tmp_path):
    path = write_foreign(flight, tmp_path / "x.mcap", [], encoding="json")
    with pytest.raises(BagError, match="'json'; only ROS 2"):
        BagReader(path)


def test_unfinished_recordings_name_the_command_that_mends_them(flight, tmp_path, monkeypatch):
    folder = flight.record(tmp_path / "bag", STEPS)
    file = folder / "bag_0.mcap"
    whole = file.read_bytes()
    (folder / "metadata.yaml").unlink()
    monkeypatch.delenv("SUNPOINT_HOME", raising=False)
    with pytest.raises(BagError, match=rf"unfinished.*`ros2 run css_recording recover {folder}`"):
        BagReader(folder)
    monkeypatch.setenv("SUNPOINT_HOME", str(tmp_path))
    with pytest.raises(BagError, match=rf"unfinished.*`\./sunpoint recover {folder}`"):
        BagReader(folder)
    file.write_bytes(whole[:-100])
    with pytest.raises(BagError, match=rf"unfinished.*recover {file}"):
        BagReader(file)


def test_what_is_no_recording_is_refused(tmp_path):
    with pytest.raises(BagError, match="no such recording"):
        BagReader(tmp_path / "nowhere")
    with pytest.raises(BagError, match="is not a recording"):
        BagReader(tmp_path)
    for name, contents in (("a.mcap", b""), ("b.mcap", b"hello"), ("c.db3", b"hello"), ("d.txt", b"hello")):
        (tmp_path / name).write_bytes(contents)
        with pytest.raises(BagError, match=name):
            BagReader(tmp_path / name)


def test_a_damaged_chunk_is_found_by_its_check_sum(flight, tmp_path):
    path = write_foreign(flight, tmp_path / "x.mcap", flight.messages(STEPS), compression=CompressionType.NONE)
    contents = bytearray(path.read_bytes())
    contents[len(contents) // 4] ^= 1
    path.write_bytes(contents)
    with pytest.raises(BagError, match="damaged"):
        read(path)
