# SPDX-License-Identifier: Apache-2.0
"""The MCAP files of one recording, read as one."""

import heapq
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from operator import itemgetter
from pathlib import Path

from css_recording.bag_metadata import Topic, absolute, parse_qos
from css_recording.bag_storage import NO_CHECK_SUM, StoredMessage, TopicCount, damaged, unfinished
from css_recording.errors import BagError
from css_recording.mcap_chunk import MAX_CHUNK_BYTES, MAX_RECORDS, Chunk
from css_recording.mcap_file import McapFile
from css_recording.provenance import broken_entries
from css_recording.schemas import MessageSchema, full_type_name

_LOG_TIME = itemgetter(0)
_LAST_NS = (1 << 63) - 1


def recorded_topic(file: McapFile, channel_id: int, hashes: Mapping[str, str] | None = None) -> Topic:
    """Topic of a channel in any encoding, with its definition as recorded; `BagError` when it has no type.

    hashes: of types by topic, for channels that do not say.
    """
    channel = file.channels[channel_id]
    schema = file.schemas.get(channel.schema_id)
    if schema is None:
        raise BagError(f"{file.path}: topic {channel.topic} is without a type; only ROS 2 messages can be read")
    name, type_name = absolute(channel.topic), full_type_name(schema.name)
    type_hash = channel.metadata.get("topic_type_hash", "") or (hashes or {}).get(name, "")
    definition = MessageSchema(type_name, schema.data.decode(errors="surrogateescape"), type_hash, schema.encoding)
    qos = parse_qos(channel.metadata.get("offered_qos_profiles", ""))
    return Topic(name, type_name, qos, definition, channel.message_encoding)


class McapStorage:
    """The MCAP files of one recording."""

    def __init__(
        self, bag: Path, paths: Sequence[Path], hashes: Mapping[str, str], notes: list[str], cleanup: ExitStack
    ) -> None:
        """Opens the files; `BagError` when one is unfinished or damaged.

        bag: what was asked for, for messages.
        hashes: of types by topic, for files that do not say.
        notes: what is to be known of the recording so far; more is added.
        cleanup: closed with the storage.
        """
        self.notes = notes
        self._bag = bag
        self._cleanup = cleanup
        self._files: list[McapFile] = []
        self._topics: list[dict[int, Topic]] = []  # of each file, by channel
        for path in paths:
            file = McapFile(path)
            cleanup.callback(file.close)
            self._files.append(file)
            self._check(file)
            self._topics.append(self._topics_of(file, hashes))
        self._counts = self._counted()
        if not all(file.has_check_sum for file in self._files):
            self.notes.append(NO_CHECK_SUM)

    def topics(self) -> list[TopicCount]:
        """Topics in the order of the recording."""
        return list(self._counts.values())

    def _counted(self) -> dict[str, TopicCount]:
        counts: dict[str, TopicCount] = {}
        for file, topics in zip(self._files, self._topics, strict=True):
            numbers = self._numbers(file)
            for channel_id, topic in topics.items():
                before = counts.get(topic.name, TopicCount(topic, 0))
                if (before.topic.type, before.topic.schema) != (topic.type, topic.schema):
                    what = "types" if before.topic.type != topic.type else "definitions"
                    raise BagError(f"{file.path}: topic {topic.name} has two {what}")
                counts[topic.name] = before._replace(count=before.count + numbers.get(channel_id, 0))
            strange = sum(count for number, count in numbers.items() if number not in file.channels)
            if strange:
                self.notes.append(f"{strange} messages are of channels that it does not define, and left out")
        return counts

    def time_span(self) -> tuple[int, int]:
        """Log times [ns] of the earliest and the latest message; zeros when there is none."""
        spans = [
            (chunk.start_ns, min(chunk.end_ns, _LAST_NS))
            for file in self._files
            for chunk in file.chunks
            # a chunk without messages says that it spans from zero to zero
            if chunk.start_ns <= _LAST_NS and (chunk.end_ns or file.chunk_messages(chunk))
        ]
        loose = [message.log_time for file in self._files for message in file.loose_messages]
        spans += [(log_time, log_time) for log_time in loose if log_time <= _LAST_NS]
        return (min(start for start, _ in spans), max(end for _, end in spans)) if spans else (0, 0)

    def metadata(self) -> list[tuple[str, dict[str, str]]]:
        """Named sets of texts in the order of the recording."""
        return [(record.name, record.metadata) for file in self._files for record in file.metadata]

    def messages(self, topics: frozenset[str], start_ns: int, end_ns: int) -> Iterator[StoredMessage]:
        """Messages of these topics with log times in [start_ns, end_ns), in log-time order."""
        wanted = [
            {number: (topic.name, topic.type) for number, topic in found.items() if topic.name in topics}
            for found in self._topics
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
        self._cleanup.close()

    def _check(self, file: McapFile) -> None:
        if file.damage:
            raise damaged(self._bag, f"{file.path.name}: {file.damage[0]}")
        if not file.complete:
            torn = f"the last {file.torn_bytes} bytes of {file.path.name} are torn or it has no end"
            raise unfinished(self._bag, torn)
        for record in file.metadata:
            broken = broken_entries(record.metadata)
            if broken:
                raise damaged(self._bag, f"the {broken[0]} in its record '{record.name}' is not what was recorded")
        try:
            file.learn_channels()
        except BagError as error:
            raise damaged(self._bag, str(error)) from error

    def _topics_of(self, file: McapFile, hashes: Mapping[str, str]) -> dict[int, Topic]:
        topics = {}
        for number in sorted(file.channels):
            try:
                topics[number] = recorded_topic(file, number, hashes)
            except BagError as error:
                self.notes.append(str(error))
        return topics

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
            yield from self._merged(chunks[first:last], wanted)
            first = last

    def _merged(self, chunks: list[tuple[int, Chunk]], wanted: list[dict[int, tuple[str, str]]]) -> list[StoredMessage]:
        """Messages of chunks that overlap in time, by log time."""
        size = sum(chunk.unpacked_size for _, chunk in chunks)
        if size > MAX_CHUNK_BYTES:
            reason = f"{len(chunks)} chunks of one time state {size} bytes, more than {MAX_CHUNK_BYTES}"
            raise damaged(self._bag, reason)
        messages: list[StoredMessage] = []
        for number, chunk in sorted(chunks, key=lambda entry: (entry[0], entry[1].position)):
            names = wanted[number]
            try:
                found = self._files[number].chunk_messages(chunk, names)
            except BagError as error:
                raise damaged(self._bag, str(error)) from error
            messages += [(log_time, *names[channel], data) for log_time, channel, _, data in found if channel in names]
            if len(messages) > MAX_RECORDS:
                raise damaged(self._bag, f"{len(chunks)} chunks of one time hold more than {MAX_RECORDS} messages")
        messages.sort(key=_LOG_TIME)
        return messages

    @staticmethod
    def _numbers(file: McapFile) -> dict[int, int]:
        """Messages of each channel: as the file says, or counted when it does not say."""
        if file.statistics is not None:
            return file.statistics.channel_message_counts
        numbers: dict[int, int] = {}
        for chunk in file.chunks:
            for message in file.chunk_messages(chunk):
                numbers[message.channel_id] = numbers.get(message.channel_id, 0) + 1
        for message in file.loose_messages:
            numbers[message.channel_id] = numbers.get(message.channel_id, 0) + 1
        return numbers
