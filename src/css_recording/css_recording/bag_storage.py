# SPDX-License-Identifier: Apache-2.0
"""Where the messages of a recording come from: MCAP files, read here, or anything else `rosbags` can read."""

import heapq
import os
from collections.abc import Iterator
from operator import itemgetter
from pathlib import Path
from typing import NamedTuple, Protocol

from rosbags.rosbag2 import Reader, ReaderError

from css_recording.bag_metadata import METADATA_FILE, Topic, absolute, parse_qos, read_metadata
from css_recording.errors import BagError
from css_recording.mcap_file import Chunk, McapFile
from css_recording.schemas import MessageSchema

StoredMessage = tuple[int, str, str, bytes]
"""Log time [ns], topic, type, serialised message."""

_LOG_TIME = itemgetter(0)


class TopicCount(NamedTuple):
    """A topic of a recording and how many messages it has."""

    topic: Topic
    count: int  # type: ignore[assignment]  # the method of tuples that it hides is not missed


class BagStorage(Protocol):
    """What the reader needs of a storage; topics by their recorded, absolute names."""

    def topics(self) -> list[TopicCount]:
        """Topics in the order of the recording."""

    def time_span(self) -> tuple[int, int]:
        """Log times [ns] of the earliest and the latest message; zeros when there is none."""

    def metadata(self) -> list[tuple[str, dict[str, str]]]:
        """Named sets of texts in the order of the recording."""

    def messages(self, topics: frozenset[str], start_ns: int, end_ns: int) -> Iterator[StoredMessage]:
        """Messages of these topics with log times in [start_ns, end_ns), in log-time order."""

    def close(self) -> None:
        """Release the files."""


def open_storage(path: Path) -> BagStorage:
    """Open a rosbag2 folder or a file; `BagError` when it is none, or unfinished."""
    if not path.exists():
        raise BagError(f"{path}: there is no such recording")
    if path.is_file():
        return McapStorage([path]) if path.suffix == ".mcap" else RosbagsStorage(path)
    information = read_metadata(path)
    if information is None:
        if any(path.glob("*.mcap")):
            raise unfinished(path, f"it has no readable {METADATA_FILE}")
        raise BagError(f"{path}: is not a recording: it has neither {METADATA_FILE} nor an .mcap file")
    compressed_as_a_whole = str(information.get("compression_mode") or "").lower() not in ("", "none")
    if information.get("storage_identifier") != "mcap" or compressed_as_a_whole:
        return RosbagsStorage(path)
    files = [path / Path(str(name)).name for name in information.get("relative_file_paths") or ()]
    missing = [file.name for file in files if not file.is_file()]
    if missing or not files:
        raise BagError(f"{path}: incomplete: {METADATA_FILE} names {missing[0] if missing else 'no file'}")
    return McapStorage(files)


def unfinished(path: Path, reason: str) -> BagError:
    """The error for a recording whose recorder did not close it."""
    recover = "./sunpoint recover" if os.environ.get("SUNPOINT_HOME") else "ros2 run css_recording recover"
    return BagError(f"{path}: the recording is unfinished: {reason}; mend it with `{recover} {path}`")


def topic_of(file: McapFile, channel_id: int) -> Topic:
    """Topic of a channel, with its definition as recorded; `BagError` when it cannot be a ROS 2 topic."""
    channel = file.channels[channel_id]
    schema = file.schemas.get(channel.schema_id)
    if channel.message_encoding != "cdr" or schema is None:
        encoding = f"encoded as '{channel.message_encoding}'" if schema else "without a type"
        raise BagError(f"{file.path}: topic {channel.topic} is {encoding}; only ROS 2 messages can be read")
    definition = None
    if schema.encoding == "ros2msg":
        type_hash = channel.metadata.get("topic_type_hash", "")
        definition = MessageSchema(schema.name, schema.data.decode(errors="replace"), type_hash)
    qos = parse_qos(channel.metadata.get("offered_qos_profiles", ""))
    return Topic(absolute(channel.topic), schema.name, qos, definition)


class McapStorage:
    """The MCAP files of one recording."""

    def __init__(self, paths: list[Path]) -> None:
        self._files: list[McapFile] = []
        try:
            for path in paths:
                file = McapFile(path)
                self._files.append(file)
                if not file.complete:
                    raise unfinished(path, f"its last {file.torn_bytes} bytes are torn or it has no end")
                file.learn_channels()
        except BagError:
            self.close()
            raise

    def topics(self) -> list[TopicCount]:
        """Topics in the order of the recording."""
        counts: dict[str, TopicCount] = {}
        for file in self._files:
            numbers = self._numbers(file)
            for channel_id in sorted(file.channels):
                topic = topic_of(file, channel_id)
                before = counts.get(topic.name, TopicCount(topic, 0))
                if before.topic.type != topic.type:
                    raise BagError(f"{file.path}: topic {topic.name} has two types")
                counts[topic.name] = before._replace(count=before.count + numbers.get(channel_id, 0))
        return list(counts.values())

    def time_span(self) -> tuple[int, int]:
        """Log times [ns] of the earliest and the latest message; zeros when there is none."""
        spans = [(chunk.start_ns, chunk.end_ns) for file in self._files for chunk in file.chunks]
        spans += [(loose.log_time, loose.log_time) for file in self._files for loose in file.loose_messages]
        return (min(start for start, _ in spans), max(end for _, end in spans)) if spans else (0, 0)

    def metadata(self) -> list[tuple[str, dict[str, str]]]:
        """Named sets of texts in the order of the recording."""
        return [(record.name, record.metadata) for file in self._files for record in file.metadata]

    def messages(self, topics: frozenset[str], start_ns: int, end_ns: int) -> Iterator[StoredMessage]:
        """Messages of these topics with log times in [start_ns, end_ns), in log-time order."""
        wanted = [
            {
                channel_id: (topic.name, topic.type)
                for channel_id, topic in ((number, topic_of(file, number)) for number in file.channels)
                if topic.name in topics
            }
            for file in self._files
        ]
        chunks = [
            (number, chunk)
            for number, file in enumerate(self._files)
            for chunk in file.chunks
            if chunk.start_ns < end_ns and chunk.end_ns >= start_ns
        ]
        loose = [
            (message.log_time, *wanted[number][message.channel_id], message.data)
            for number, file in enumerate(self._files)
            for message in file.loose_messages
            if message.channel_id in wanted[number]
        ]
        loose.sort(key=_LOG_TIME)
        chunked = self._chunked(chunks, wanted)
        ordered = heapq.merge(chunked, loose, key=_LOG_TIME) if loose else chunked
        return (message for message in ordered if start_ns <= message[0] < end_ns)

    def close(self) -> None:
        """Release the files."""
        for file in self._files:
            file.close()

    def _chunked(
        self, chunks: list[tuple[int, Chunk]], wanted: list[dict[int, tuple[str, str]]]
    ) -> Iterator[StoredMessage]:
        """Messages in chunks by log time. Chunks that overlap in time are merged; no others are held."""
        chunks.sort(key=lambda entry: entry[1].start_ns)
        first = 0
        while first < len(chunks):
            last, end_ns = first + 1, chunks[first][1].end_ns
            while last < len(chunks) and chunks[last][1].start_ns < end_ns:
                end_ns = max(end_ns, chunks[last][1].end_ns)
                last += 1
            messages: list[StoredMessage] = []
            for number, chunk in sorted(chunks[first:last], key=lambda entry: (entry[0], entry[1].position)):
                names = wanted[number]
                messages += [
                    (log_time, *names[channel], data)
                    for log_time, channel, _, data in self._files[number].chunk_messages(chunk)
                    if channel in names
                ]
            messages.sort(key=_LOG_TIME)
            yield from messages
            first = last

    @staticmethod
    def _numbers(file: McapFile) -> dict[int, int]:
        """Messages of each channel: as the file says, or counted when it does not say."""
        if file.statistics is not None:
            return file.statistics.channel_message_counts
        numbers: dict[int, int] = {}
        chunked = (message for chunk in file.chunks for message in file.chunk_messages(chunk))
        for message in (*file.loose_messages, *chunked):
            numbers[message.channel_id] = numbers.get(message.channel_id, 0) + 1
        return numbers


class RosbagsStorage:
    """A recording that `rosbags` reads: SQLite storage, or files compressed as a whole."""

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            self._reader = Reader(path)
            self._reader.open()
        except (ReaderError, OSError) as error:
            raise BagError(f"{path}: {error}") from error

    def topics(self) -> list[TopicCount]:
        """Topics in the order of the recording."""
        return [
            TopicCount(Topic(absolute(connection.topic), connection.msgtype), connection.msgcount)
            for connection in self._reader.connections
        ]

    def time_span(self) -> tuple[int, int]:
        """Log times [ns] of the earliest and the latest message; zeros when there is none."""
        if self._reader.message_count == 0:
            return 0, 0
        return self._reader.start_time, self._reader.end_time - 1

    def metadata(self) -> list[tuple[str, dict[str, str]]]:
        """No texts: these storages have no place for them."""
        return []

    def messages(self, topics: frozenset[str], start_ns: int, end_ns: int) -> Iterator[StoredMessage]:
        """Messages of these topics with log times in [start_ns, end_ns), in log-time order."""
        connections = [entry for entry in self._reader.connections if absolute(entry.topic) in topics]
        if not connections:
            return
        try:
            for connection, log_time, data in self._reader.messages(connections, start_ns, end_ns):
                yield log_time, absolute(connection.topic), connection.msgtype, data
        except ReaderError as error:
            raise BagError(f"{self._path}: {error}") from error

    def close(self) -> None:
        """Release the files."""
        if self._reader.is_open:
            self._reader.close()
