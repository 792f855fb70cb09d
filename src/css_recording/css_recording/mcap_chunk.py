# SPDX-License-Identifier: Apache-2.0
"""Chunks of an MCAP file: unpacked to at most the size that they state, and walked message by message.

A few bytes can unpack to gigabytes. What a chunk may take in memory is therefore bounded before it is unpacked:
by the size that it states, by a limit on that, and by a limit on the number of its records.
"""

import struct
import zlib
from collections.abc import Callable, Container
from typing import NamedTuple

import lz4.frame
import zstandard
from mcap.opcode import Opcode

MAX_CHUNK_BYTES = 256 << 20
"""No chunk may state more. Recorders write chunks of about a megabyte, or of one message if that is larger."""
MAX_RECORDS = 2_000_000
"""No chunk, and no chunks that overlap in time, may hold more records: as Python objects they take half a gigabyte."""
CHUNK_HEAD = struct.Struct("<QQQII")  # start, end, uncompressed size, CRC, length of the compression's name
RECORD_HEAD = struct.Struct("<BQ")
MESSAGE_HEAD = struct.Struct("<BQHIQQ")  # record head, channel, sequence, log time, publish time
_MESSAGE_FIELDS = MESSAGE_HEAD.size - RECORD_HEAD.size
_ZSTD = zstandard.ZstdDecompressor()  # making one costs as much as a chunk; a process reads from one thread at a time
_UNKNOWN_SIZE = (1 << 64) - 1


class ChunkError(Exception):
    """A chunk cannot be read. The text says why, not where."""


class RawMessage(NamedTuple):
    """A message as it stands in the file."""

    log_time: int  # [ns]
    channel_id: int
    publish_time: int  # [ns]
    data: bytes


class Chunk(NamedTuple):
    """Where a chunk stands in the file, what time it spans, and how much it states to hold."""

    start_ns: int
    end_ns: int
    position: int
    size: int  # of the record's body
    unpacked_size: int


def unpack(body: bytes) -> bytes:
    """Records of a chunk; `ChunkError` when they are not what the chunk's head states."""
    try:
        _, _, size, crc, name_length = CHUNK_HEAD.unpack_from(body)
        name_end = CHUNK_HEAD.size + name_length
        compression = body[CHUNK_HEAD.size : name_end].decode()
        if compression not in _UNPACKERS:
            raise ChunkError(f"compression '{compression}' is not known")
        if size > MAX_CHUNK_BYTES:
            raise ChunkError(f"it states {size} bytes, more than {MAX_CHUNK_BYTES}")
        records = _UNPACKERS[compression](body[name_end + 8 :], size)
    except (zstandard.ZstdError, RuntimeError, ValueError, struct.error, EOFError) as error:
        raise ChunkError(str(error)) from error
    if len(records) != size:
        raise ChunkError(f"it states {size} bytes and holds {'fewer' if len(records) < size else 'more'}")
    if crc and zlib.crc32(records) != crc:
        raise ChunkError("its check sum is wrong")
    return records


def walk(
    records: bytes, learn: Callable[[int, bytes], None], channels: Container[int] | None = None
) -> list[RawMessage]:
    """Messages in file order; `ChunkError` when a record is not whole.

    learn: takes opcode and body of each schema and channel.
    channels: only their messages; None: all.
    """
    messages: list[RawMessage] = []
    append, unpack_from, new = messages.append, MESSAGE_HEAD.unpack_from, tuple.__new__
    position, end = 0, len(records)
    last_start = end - MESSAGE_HEAD.size
    for _ in range(MAX_RECORDS):
        if position >= end:
            return messages
        if position <= last_start:
            opcode, length, channel, _, log_time, publish_time = unpack_from(records, position)
        elif position + RECORD_HEAD.size <= end:
            opcode, length = RECORD_HEAD.unpack_from(records, position)
        else:
            raise ChunkError("a record is cut short")
        following = position + 9 + length
        if following > end:
            raise ChunkError("a record is cut short")
        if opcode == 5:  # Opcode.MESSAGE; the comparison with a plain number is what makes it fast
            if length < _MESSAGE_FIELDS:
                raise ChunkError("a message is cut short")
            if channels is None or channel in channels:
                append(new(RawMessage, (log_time, channel, publish_time, records[position + 31 : following])))
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            learn(opcode, records[position + 9 : following])
        else:
            raise ChunkError(f"it holds a record of type {opcode}")
        position = following
    raise ChunkError(f"it holds more than {MAX_RECORDS} records")


def _unpack_zstd(packed: bytes, size: int) -> bytes:
    stated = zstandard.get_frame_parameters(packed).content_size
    # The library makes room for what the frame states, whatever the limit.
    if stated not in (size, _UNKNOWN_SIZE):
        raise ChunkError(f"it states {size} bytes and its data {stated}")
    return _ZSTD.decompress(packed, max_output_size=size)


def _unpack_lz4(packed: bytes, size: int) -> bytes:
    return bytes(lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=size + 1))


_UNPACKERS: dict[str, Callable[[bytes, int], bytes]] = {
    "": lambda packed, size: packed,
    "lz4": _unpack_lz4,
    "zstd": _unpack_zstd,
}
