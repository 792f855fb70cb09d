# SPDX-License-Identifier: Apache-2.0
"""Packs messages into the chunks of an MCAP file, with their indexes and what the file says of them at its end."""

import struct
import zlib
from collections import Counter
from collections.abc import Iterator
from typing import Protocol

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import ChunkIndex, Statistics

from css_recording.mcap_chunk import CHUNK_HEAD, MESSAGE_HEAD, RECORD_HEAD

_COMPRESSION = b"zstd"
_SIZE = struct.Struct("<Q")
_INDEX_HEAD = struct.Struct("<BQHI")  # record head, channel, bytes of the entries
_MESSAGE_FIELDS = MESSAGE_HEAD.size - RECORD_HEAD.size
_INDEX_FIELDS = _INDEX_HEAD.size - RECORD_HEAD.size


class Record(Protocol):
    """Anything that can stand in a file."""

    def write(self, stream: RecordBuilder) -> None:
        """Put the record at the end of a stream."""


def bytes_of(*records: Record) -> bytes:
    """Records as they stand in a file."""
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    return bytes(builder.end())


class ChunkBuilder:
    """The chunk being filled, and those that were finished.

    Attributes:
        indexes: a record of each finished chunk, as they stand at the end of the file. They are held for as long as a
            recording goes on, and would take six times the memory as Python objects.
    """

    def __init__(self) -> None:
        self.indexes = bytearray()
        self._chunks = 0
        self._compressor = zstandard.ZstdCompressor()
        self._parts: list[bytes] = []
        self._size = 0
        self._places: dict[int, list[int]] = {}  # by channel: log time and place in the chunk of each message in turn
        self._start_ns = self._end_ns = 0
        self._counts: Counter[int] = Counter()
        self._span_ns: tuple[int, int] | None = None

    def add_definitions(self, records: bytes) -> None:
        """Put schemas and channels before the messages that come next."""
        self._parts.append(records)
        self._size += len(records)

    def fill(self, messages: Iterator[tuple[int, int, int, int, bytes]], most_bytes: int) -> bool:
        """Take messages (channel, sequence number, log time, publish time, data) until there is enough for a chunk.

        They come in the order of their log times. False: there was none.
        """
        parts, places, pack = self._parts, self._places, MESSAGE_HEAD.pack
        size, log_time = self._size, -1
        for channel, sequence, log_time, publish_time, data in messages:
            place = places.get(channel)
            if place is None:
                place = places[channel] = []
                self._start_ns = log_time if len(places) == 1 else self._start_ns
            place += (log_time, size)
            length = _MESSAGE_FIELDS + len(data)
            parts += (pack(5, length, channel, sequence, log_time, publish_time), data)
            size += RECORD_HEAD.size + length
            if size > most_bytes:
                break
        self._size, self._end_ns = size, log_time
        return log_time >= 0

    def finish(self, position: int) -> bytes:
        """The chunk and its indexes as they stand in the file from a position on; a new one is begun."""
        records = b"".join(self._parts)
        packed = self._compressor.compress(records)
        head = CHUNK_HEAD.pack(self._start_ns, self._end_ns, len(records), zlib.crc32(records), len(_COMPRESSION))
        body = head + _COMPRESSION + _SIZE.pack(len(packed)) + packed
        chunk = RECORD_HEAD.pack(Opcode.CHUNK, len(body)) + body
        indexes = b""
        offsets = {}
        for channel, place in self._places.items():
            offsets[channel] = position + len(chunk) + len(indexes)
            length = len(place) * _SIZE.size
            indexes += _INDEX_HEAD.pack(Opcode.MESSAGE_INDEX, _INDEX_FIELDS + length, channel, length)
            indexes += struct.pack(f"<{len(place)}Q", *place)
            self._counts[channel] += len(place) // 2
        index = ChunkIndex(
            chunk_length=len(chunk),
            chunk_start_offset=position,
            compression=_COMPRESSION.decode(),
            compressed_size=len(packed),
            message_end_time=self._end_ns,
            message_index_length=len(indexes),
            message_index_offsets=offsets,
            message_start_time=self._start_ns,
            uncompressed_size=len(records),
        )
        self.indexes += bytes_of(index)
        self._chunks += 1
        self._begin_anew()
        return chunk + indexes

    def statistics(self, schemas: int, channels: int, attachments: int, metadata: int) -> Statistics:
        """What the file says of itself: these counts of other records, and those of the messages."""
        start_ns, end_ns = self._span_ns or (0, 0)
        return Statistics(
            attachment_count=attachments,
            channel_count=channels,
            channel_message_counts=dict(self._counts),
            chunk_count=self._chunks,
            message_count=self._counts.total(),
            message_end_time=end_ns,
            message_start_time=start_ns,
            metadata_count=metadata,
            schema_count=schemas,
        )

    def _begin_anew(self) -> None:
        start_ns, end_ns = self._span_ns or (self._start_ns, self._end_ns)
        self._span_ns = min(start_ns, self._start_ns), max(end_ns, self._end_ns)
        self._parts.clear()
        self._places.clear()
        self._size = 0
