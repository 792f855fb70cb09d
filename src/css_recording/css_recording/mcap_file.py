# SPDX-License-Identifier: Apache-2.0
"""Reads the records of one MCAP file, finished or torn, at the speed that replay needs.

The library `mcap` parses the records that are few. Chunks and the messages in them, of which an orbit has a
quarter of a million, are walked here with one `struct` call each, ten times as fast as through the library.
The file is walked from its start to its last intact record and needs no index, so that the same code reads a
finished recording and one whose recorder was killed. After a record that is damaged the walk goes on at the next
chunk, so that as much as possible can be saved; that something is damaged is never passed over.
"""

import mmap
import struct
import zlib
from collections.abc import Container
from io import BytesIO
from pathlib import Path
from typing import Any

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Header, Metadata, Schema, Statistics

from css_recording.errors import BagError
from css_recording.mcap_checks import Ending, faults_of
from css_recording.mcap_chunk import CHUNK_HEAD, MESSAGE_HEAD, RECORD_HEAD, Chunk, ChunkError, RawMessage, unpack, walk

MAGIC = b"\x89MCAP0\r\n"
_MESSAGE_INDEX_HEAD = struct.Struct("<HI")  # channel, bytes that follow
_LAST_OPCODE = int(Opcode.DATA_END)
_FIRST_PRIVATE_OPCODE = 0x80
_COMPRESSION_NAMES = (b"\x04\0\0\0zstd", b"\x03\0\0\0lz4")
_NAME_AT = RECORD_HEAD.size + CHUNK_HEAD.size - 4  # where the name of the compression stands in a chunk record


class McapFile:
    """An open MCAP file.

    records: metadata, attachments, chunks and messages outside of chunks, in file order.
    complete: the file is finished: every record is intact and it ends as the format wants it.
    damage: what is wrong with the file other than its torn end, one text each; contents of chunks are not looked
        into for it.
    torn_bytes: what follows the last intact record of an unfinished file.
    private_records: records of types that the format leaves to applications, passed over.
    has_check_sum: the file holds a check sum of everything that it records, and it is right.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.statistics: Statistics | None = None
        self.records: list[Metadata | Attachment | Chunk | RawMessage] = []
        self.profile = ""
        self.damage: list[str] = []
        self.torn_bytes = self.private_records = 0
        self.ending = Ending()
        self._map: mmap.mmap | bytes = _map_file(path)
        if self._map[: len(MAGIC)] != MAGIC:
            raise BagError(f"{path}: is not an MCAP file")
        self._walk()

    @property
    def complete(self) -> bool:
        """The file is finished and nothing in it is known to be damaged."""
        return self.ending.reached and not self.damage

    @property
    def has_check_sum(self) -> bool:
        """The file holds a check sum of everything that it records, and it is right."""
        return self.complete and self.ending.data_crc != 0

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

    def chunk_messages(self, chunk: Chunk, channels: Container[int] | None = None) -> list[RawMessage]:
        """Messages of a chunk in file order, of some channels or of all; `BagError` when it is damaged."""
        body = self._map[chunk.position + 9 : chunk.position + 9 + chunk.size]
        try:
            vouched = self.ending.data_crc != 0
            messages = walk(unpack(body), self._learn, channels if vouched else None)
            if messages and not vouched:  # nothing else vouches for the head of the chunk
                times = [message[0] for message in messages]
                if min(times) < chunk.start_ns or max(times) > chunk.end_ns:
                    raise ChunkError("its messages are not of the time that it states")
        except (ChunkError, McapError, struct.error, ValueError) as error:
            raise BagError(f"{self.path}: the chunk at byte {chunk.position} is damaged: {error}") from error
        return messages

    def _walk(self) -> None:
        """Find all intact records."""
        position = len(MAGIC)
        while not self.ending.reached:
            following = self._read_record(position)
            if following is None:
                following = self._next_chunk(position)
                if following is None:
                    break
                self.damage.append(f"{following - position} bytes at byte {position} are no records")
            position = following
        rest = len(self._map) - position
        tail = self._map[position : position + len(MAGIC)]
        if self.ending.reached and tail != MAGIC and rest < len(MAGIC) and MAGIC.startswith(tail):
            self.ending.reached = False  # the last of all writes was cut
        elif self.ending.reached and (tail != MAGIC or rest > len(MAGIC)):
            self.damage.append(f"{rest} bytes that do not belong to it follow its end")
        if self.ending.reached:
            self.damage += faults_of(self.ending, self.records, self.statistics, self.channels, self._map)
            return
        self.torn_bytes = rest
        if self._map[-len(MAGIC) :] == MAGIC and len(self._map) > len(MAGIC):
            self.damage.append(f"a record is damaged, {rest} bytes before the end")

    def _read_record(self, position: int) -> int | None:
        """Take the record at a position; gives where the next one begins, None when this is none."""
        if position + RECORD_HEAD.size > len(self._map):
            return None
        opcode, length = RECORD_HEAD.unpack_from(self._map, position)
        following = position + RECORD_HEAD.size + int(length)
        known = 0 < opcode <= _LAST_OPCODE or opcode >= _FIRST_PRIVATE_OPCODE
        if not known or following > len(self._map):
            return None
        try:
            self._take(opcode, position, length)
        except (McapError, struct.error, ValueError):
            self.damage.append(f"the record of type {opcode} at byte {position} is damaged")
        return following

    def _next_chunk(self, position: int) -> int | None:
        """Where the next thing that looks like the head of a whole compressed chunk begins."""
        candidates = []
        for name in _COMPRESSION_NAMES:
            found = self._map.find(name, position + _NAME_AT + 1)
            while found >= 0:
                start = found - _NAME_AT
                opcode, length = RECORD_HEAD.unpack_from(self._map, start)
                if opcode == Opcode.CHUNK and start + RECORD_HEAD.size + length <= len(self._map):
                    candidates.append(start)
                    break
                found = self._map.find(name, found + 1)
        return min(candidates, default=None)

    def _take(self, opcode: int, position: int, length: int) -> None:
        """Remember one record; an error of the parser when its contents cannot be what its head says."""
        start = position + RECORD_HEAD.size
        if opcode >= _FIRST_PRIVATE_OPCODE:
            self.private_records += 1
            return
        if opcode == Opcode.MESSAGE_INDEX:
            if _MESSAGE_INDEX_HEAD.unpack_from(self._map, start)[1] + _MESSAGE_INDEX_HEAD.size != length:
                raise ValueError("its length is wrong")
            return
        if opcode == Opcode.CHUNK:
            if length < CHUNK_HEAD.size:
                raise ValueError("too short")
            start_ns, end_ns, unpacked_size, _, _ = CHUNK_HEAD.unpack_from(self._map, start)
            self.records.append(Chunk(start_ns, end_ns, position, length, unpacked_size))
            return
        body = self._map[start : start + length]
        if opcode == Opcode.MESSAGE:
            _, _, channel, _, log_time, publish_time = MESSAGE_HEAD.unpack_from(self._map, position)
            self.records.append(RawMessage(log_time, channel, publish_time, body[22:]))
        elif opcode == Opcode.METADATA:
            self.records.append(_parse(Metadata, body))
        elif opcode == Opcode.ATTACHMENT:
            self._take_attachment(body)
        elif not self.ending.take(opcode, position, body, _parse):
            self._learn(opcode, body)

    def _take_attachment(self, body: bytes) -> None:
        attachment = _parse(Attachment, body)
        crc = int.from_bytes(body[-4:], "little")
        if crc and zlib.crc32(body[:-4]) != crc:
            raise ValueError("its check sum is wrong")
        self.records.append(attachment)

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
