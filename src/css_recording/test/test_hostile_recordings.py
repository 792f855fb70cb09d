# SPDX-License-Identifier: Apache-2.0
"""Small files that unpack to much, and times at the limits: bounded in memory, in the right order, in words."""

import struct
import subprocess
import sys
import zlib

import lz4.frame
import pytest
import yaml
import zstandard
from mcap.writer import Writer

from css_recording.bag_reader import BagReader
from css_recording.bag_writer import BagWriter
from css_recording.errors import BagError
from css_recording.flight_recorder import FlightRecorder
from css_recording.mcap_chunk import CHUNK_HEAD, MAX_CHUNK_BYTES, RECORD_HEAD, ChunkError, unpack, walk
from css_recording.recovery import recover
from css_recording.schemas import schema_of

LAST_NS = (1 << 63) - 1
BIG = 64 << 20


def chunk_body(packed: bytes, size: int, compression: str = "zstd", crc: int = 0) -> bytes:
    head = CHUNK_HEAD.pack(0, 10, size, crc, len(compression))
    return head + compression.encode() + struct.pack("<Q", len(packed)) + packed


def without_size(data: bytes) -> bytes:
    return zstandard.ZstdCompressor(write_content_size=False).compress(data)


@pytest.mark.parametrize(
    ("compression", "pack"), [("zstd", zstandard.compress), ("zstd", without_size), ("lz4", lz4.frame.compress)]
)
def test_a_chunk_unpacks_to_what_it_states_and_no_further(compression, pack):
    data = bytes(range(256)) * 40
    assert unpack(chunk_body(pack(data), len(data), compression, zlib.crc32(data))) == data
    for stated in (0, 1, len(data) - 1, len(data) + 1, MAX_CHUNK_BYTES):
        with pytest.raises(ChunkError):
            unpack(chunk_body(pack(data), stated, compression))
    for stated in (MAX_CHUNK_BYTES + 1, 1 << 40, (1 << 64) - 1):
        with pytest.raises(ChunkError, match=f"states {stated} bytes, more than"):
            unpack(chunk_body(pack(data), stated, compression))


MEASURE = """
import resource, sys
from css_recording.mcap_chunk import ChunkError, unpack
body = open(sys.argv[1], "rb").read()
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
try:
    unpack(body)
    sys.exit("it was taken")
except ChunkError:
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
"""


@pytest.mark.parametrize(
    ("compression", "pack"), [("zstd", zstandard.compress), ("zstd", without_size), ("lz4", lz4.frame.compress)]
)
def test_a_bomb_takes_no_memory(tmp_path, compression, pack):
    path = tmp_path / "body"
    path.write_bytes(chunk_body(pack(bytes(4 * BIG)), 1 << 20, compression))
    run = subprocess.run([sys.executable, "-c", MEASURE, str(path)], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    assert int(run.stdout) < BIG >> 10  # kB; it would be four times as much


def test_a_chunk_of_nothing_ends_at_once_and_one_of_too_many_records_ends(monkeypatch):
    with pytest.raises(ChunkError, match="a record of type 0"):
        walk(bytes(BIG), lambda *_: None)
    message = RECORD_HEAD.pack(5, 22) + bytes(22)
    monkeypatch.setattr("css_recording.mcap_chunk.MAX_RECORDS", 1000)
    assert len(walk(message * 999, lambda *_: None)) == 999
    with pytest.raises(ChunkError, match="more than 1000 records"):
        walk(message * 1001, lambda *_: None)
    with pytest.raises(ChunkError, match="a message is cut short"):
        walk(RECORD_HEAD.pack(5, 21) + bytes(21) + message, lambda *_: None)


def test_a_chunk_that_ends_within_a_record_is_refused_wherever_it_ends():
    records = [RECORD_HEAD.pack(kind, size) + bytes(size) for kind, size in ((3, 14), (4, 8), (5, 22), (5, 29), (3, 3))]
    whole, ends = b"".join(records), {sum(map(len, records[:n])) for n in range(len(records) + 1)}
    for end in range(len(whole) + 1):
        if end in ends:
            walk(whole[:end], lambda *_: None)
        else:
            with pytest.raises(ChunkError, match="a record is cut short"):
                walk(whole[:end], lambda *_: None)


def foreign(path, messages, chunk_size=1 << 20):
    """A recording of the standard times, made by the library."""
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=chunk_size)
        writer.start(profile="ros2")
        name = "builtin_interfaces/msg/Time"
        schema = writer.register_schema(name, "ros2msg", schema_of(name).text.encode())
        channel = writer.register_channel("/t", "cdr", schema)
        for stamp_ns, data in messages:
            writer.add_message(channel, stamp_ns, data, stamp_ns)
        writer.finish()
    return path


def test_chunks_of_one_time_are_not_held_without_limit(tmp_path, monkeypatch):
    stamps = [second * 10**9 for pair in zip(range(30), range(59, 29, -1), strict=True) for second in pair]
    path = foreign(tmp_path / "x.mcap", [(stamp_ns, b"\0\1\0\0" + bytes(500)) for stamp_ns in stamps], 1000)
    monkeypatch.setattr("css_recording.mcap_storage.MAX_CHUNK_BYTES", 20_000)
    with BagReader(path) as reader, pytest.raises(BagError, match=r"chunks of one time state \d+ bytes, more than"):
        list(reader.messages())
    saved = recover(path, tmp_path / "saved")  # in it the chunks are in the order of time
    with BagReader(saved.recording) as reader:
        assert [m.stamp_ns for m in reader.messages()] == sorted(stamps)


STAMPS = [0, 1, LAST_NS - 1, LAST_NS, 1 << 63, (1 << 64) - 1]


@pytest.mark.parametrize("chunk_size", [10, 1 << 20])
def test_log_times_at_the_limits(tmp_path, chunk_size):
    messages = [(stamp_ns, b"\0\1\0\0" + struct.pack("<q", number)) for number, stamp_ns in enumerate(STAMPS)]
    path = foreign(tmp_path / "x.mcap", [*messages[3:], *messages[:3]], chunk_size)
    with BagReader(path) as reader:
        assert [(m.stamp_ns, m.data) for m in reader.messages()] == messages[:4]
        ((topic, reason, count, first_ns),) = reader.refused
        assert (topic, count, first_ns) == ("/t", 2, 1 << 63)
        assert "no time of ROS" in reason
        assert (reader.start_ns, reader.end_ns, reader.duration_ns) == (0, LAST_NS, LAST_NS)
        assert [m.stamp_ns for m in reader.messages(None, 1, LAST_NS)] == [1, LAST_NS - 1]
    saved = recover(path, tmp_path / "saved")
    assert saved.losses == ["2 messages that are not of ROS 2"]
    information = yaml.safe_load((tmp_path / "saved" / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert information["starting_time"]["nanoseconds_since_epoch"] == 0
    assert information["duration"]["nanoseconds"] == LAST_NS
    with BagReader(saved.recording) as reader:
        assert [(m.stamp_ns, m.data) for m in reader.messages()] == messages[:4]


@pytest.mark.parametrize("stamp_ns", [-1, LAST_NS + 1, (1 << 64) - 1])
def test_the_writer_takes_only_times_of_ros(flight, tmp_path, stamp_ns):
    topic, _, data = flight.messages(1)[0]
    with BagWriter(tmp_path / "bag", flight.topics) as writer:
        writer.write(topic, 0, data)
        writer.write(topic, LAST_NS, data)
        with pytest.raises(BagError, match=f"stamp {stamp_ns}"):
            writer.write(topic, stamp_ns, data)
    with BagReader(tmp_path / "bag") as reader:
        assert [m.stamp_ns for m in reader.messages()] == [0, LAST_NS]


@pytest.mark.parametrize(
    ("sec", "nanosec"), [(-1, 999_999_999), (-(1 << 31), 0), (0, 0), (7, 1_000_000_000), (7, 0xFFFFFFFF)]
)
def test_stamps_that_cannot_be_are_filed_at_the_latest_one_and_counted(flight, tmp_path, sec, nanosec):
    good = flight.messages(1)[0]
    recorder = FlightRecorder(BagWriter(tmp_path / "bag", flight.topics))
    recorder.receive(good[0], good[2])
    recorder.receive(good[0], good[2][:4] + struct.pack("<iI", sec, nanosec) + good[2][12:])
    recorder.close()
    assert recorder.counters["unstamped"] == 1
    with BagReader(tmp_path / "bag") as reader:
        assert [m.stamp_ns for m in reader.messages()] == [good[1], good[1]]
