# SPDX-License-Identifier: Apache-2.0
"""Reads the records of one MCAP file, finished or torn, at the speed that replay needs.

The library `mcap` parses the records that are few. Chunks and the messages in them, of which an orbit has a
quarter of a million, are walked here with one `struct` call each, ten times as fast as through the library.
The file is walked from its start to its last intact record and needs no index, so that the same code reads a
finished recording and one whose recorder was killed.
"""

import mmap
import struct
import zlib
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Header, Metadata, Schema, Statistics

from css_recording.errors import BagError

MAGIC = b"\x89MCAP0\r\n"
_HEAD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<BQHIQQ")  # head, channel, sequence, log time, publish time
_CHUNK = struct.Struct("<QQQII")  # start, end, uncompressed size, CRC, length of the compression's name
_MAX_CHUNK_BYTES = 1 << 30
_LAST_OPCODE = int(Opcode.DATA_END)
_FIRST_PRIVATE_OPCODE = 0x80


class RawMessage(NamedTuple):
    """A message as it stands in the file."""

    log_time: int  # [ns]
    channel_id: int
    publish_time: int  # [ns]
    data: bytes


class Chunk(NamedTuple):
    """Where a chunk stands in the file and what time it spans."""

    start_ns: int
    end_ns: int
    position: int
    size: int


class McapFile:
    """An open MCAP file.

    records: metadata, attachments, chunks and messages outside of chunks, in file order.
    complete: the file is finished: every record is intact and it ends as the format wants it.
    has_end: its last bytes are those of a finished file; when it is not complete, it is damaged inside.
    torn_bytes: what follows the last intact record of an unfinished file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.statistics: Statistics | None = None
        self.records: list[Metadata | Attachment | Chunk | RawMessage] = []
        self.profile = ""
        self.complete = self.has_end = False
        self.torn_bytes = 0
        self._map: mmap.mmap | bytes = _map_file(path)
        if self._map[: len(MAGIC)] != MAGIC:
            raise BagError(f"{path}: is not an MCAP file")
        self._walk()

    def learn_channels(self) -> None:
        """Find channels that only the chunks define: those of a torn file, or of one without a summary."""
        known = self.statistics.channel_count if self.statistics else None
        if len(self.channels) != known:
            for chunk in self.chunks:
                self.chunk_messages(chunk)

    @property
    def chunks(self) -> list[Chunk]:
        """Chunks in file order."""
        return [record for record in self.records if isinstance(record, Chunk)]

    @property
    def loose_messages(self) -> list[RawMessage]:
        """Messages outside of chunks, in file order."""
        return [record for record in self.records if isinstance(record, RawMessage)]

    @property
    def metadata(self) -> list[Metadata]:
        """Metadata records in file order."""
        return [record for record in self.records if isinstance(record, Metadata)]

    def close(self) -> None:
        """Release the file."""
        if isinstance(self._map, mmap.mmap):
            self._map.close()
        self._map = b""

    def chunk_messages(self, chunk: Chunk) -> list[RawMessage]:
        """Messages of a chunk in file order; `BagError` when it is damaged."""
        raw = self._decompress(chunk)
        messages: list[RawMessage] = []
        append, unpack, new = messages.append, _MESSAGE.unpack_from, tuple.__new__
        position, end = 0, len(raw)
        while position < end:
            if position + _MESSAGE.size <= end:
                opcode, length, channel, _, log_time, publish_time = unpack(raw, position)
            elif position + _HEAD.size <= end:
                opcode, length = _HEAD.unpack_from(raw, position)
                if opcode == Opcode.MESSAGE:
                    raise self._damaged(chunk, "a message is cut short")
            else:
                raise self._damaged(chunk, "a record is cut short")
            following = position + 9 + length
            if following > end:
                raise self._damaged(chunk, "a record is cut short")
            if opcode == 5:  # Opcode.MESSAGE; the comparison with a plain number is what makes it fast
                append(new(RawMessage, (log_time, channel, publish_time, raw[position + 31 : following])))
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                self._learn(opcode, raw[position + 9 : following])
            position = following
        return messages

    def _walk(self) -> None:
        """Find all intact records."""
        data, size = self._map, len(self._map)
        position = len(MAGIC)
        opcode = 0
        while True:
            if position + _HEAD.size > size:
                break
            opcode, length = _HEAD.unpack_from(data, position)
            following = position + 9 + length
            if following > size or not self._take(opcode, position, length):
                break
            position = following
            if opcode == Opcode.FOOTER:
                break
        self.has_end = data[-len(MAGIC) :] == MAGIC and size > len(MAGIC)
        self.complete = opcode == Opcode.FOOTER and data[position:] == MAGIC
        self.torn_bytes = 0 if self.complete else size - position

    def _take(self, opcode: int, position: int, length: int) -> bool:
        """Remember one record; False when its contents cannot be what its head says."""
        if opcode in (Opcode.MESSAGE_INDEX, Opcode.CHUNK_INDEX) or opcode >= _FIRST_PRIVATE_OPCODE:
            return True
        if not 0 < opcode <= _LAST_OPCODE:
            return False
        if opcode == Opcode.CHUNK:
            if length < _CHUNK.size:
                return False
            start_ns, end_ns, _, _, _ = _CHUNK.unpack_from(self._map, position + 9)
            self.records.append(Chunk(start_ns, end_ns, position, length))
            return True
        try:
            body = self._map[position + 9 : position + 9 + length]
            if opcode == Opcode.MESSAGE:
                _, _, channel, _, log_time, publish_time = _MESSAGE.unpack_from(self._map, position)
                self.records.append(RawMessage(log_time, channel, publish_time, body[22:]))
            elif opcode in (Opcode.METADATA, Opcode.ATTACHMENT):
                self.records.append(_parse(Metadata if opcode == Opcode.METADATA else Attachment, body))
            else:
                self._learn(opcode, body)
        except (McapError, struct.error, ValueError):
            return False
        return True

    def _learn(self, opcode: int, body: bytes) -> None:
        if opcode == Opcode.SCHEMA:
            schema = _parse(Schema, body)
            self.schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            channel = _parse(Channel, body)
            self.channels[channel.id] = channel
        elif opcode == Opcode.HEADER:
            self.profile = _parse(Header, body).profile
        elif opcode == Opcode.STATISTICS:
            self.statistics = _parse(Statistics, body)

    def _decompress(self, chunk: Chunk) -> bytes:
        body = self._map[chunk.position + 9 : chunk.position + 9 + chunk.size]
        try:
            _, _, size, crc, name_length = _CHUNK.unpack_from(body)
            name_end = _CHUNK.size + name_length
            compression = body[_CHUNK.size : name_end].decode()
            packed = body[name_end + 8 :]
            if size > _MAX_CHUNK_BYTES or compression not in _DECOMPRESSORS:
                raise self._damaged(chunk, f"compression '{compression}', size {size}")
            raw = _DECOMPRESSORS[compression](packed, size)
        except (zstandard.ZstdError, RuntimeError, ValueError, struct.error) as error:
            raise self._damaged(chunk, str(error)) from error
        if len(raw) != size or (crc and zlib.crc32(raw) != crc):
            raise self._damaged(chunk, "its check sum is wrong")
        return raw

    def _damaged(self, chunk: Chunk, reason: str) -> BagError:
        return BagError(f"{self.path}: the chunk at byte {chunk.position} is damaged: {reason}")


_DECOMPRESSORS: dict[str, Callable[[bytes, int], bytes]] = {
    "": lambda packed, size: packed,
    "lz4": lambda packed, size: lz4.frame.decompress(packed),
    "zstd": lambda packed, size: zstandard.decompress(packed, max_output_size=size),
}


def _parse(kind: Any, body: bytes) -> Any:
    return kind.read(ReadDataStream(BytesIO(body)))


def _map_file(path: Path) -> mmap.mmap | bytes:
    try:
        with path.open("rb") as file:
            if path.stat().st_size == 0:
                return b""
            return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    except OSError as error:
        raise BagError(f"{path}: cannot be read: {error.strerror}") from error
