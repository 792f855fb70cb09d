# SPDX-License-Identifier: Apache-2.0
"""What a finished MCAP file says of itself at its end, and whether that is so."""

import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from mmap import mmap
from typing import Any

from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, ChunkIndex, DataEnd, Footer, Metadata, Statistics

from css_recording.mcap_chunk import RECORD_HEAD, Chunk

_CRC_BYTES = 4
_SUMMARY = frozenset(
    {
        Opcode.FOOTER,
        Opcode.STATISTICS,
        Opcode.CHUNK_INDEX,
        Opcode.ATTACHMENT_INDEX,
        Opcode.METADATA_INDEX,
        Opcode.SUMMARY_OFFSET,
    }
)


@dataclass
class Ending:
    """The records at the end of a file.

    reached: the file has a footer.
    data_end: where the data end [byte]; -1 when nothing says so.
    data_crc: check sum of everything before; 0: none is held.
    footer_at: where the footer begins [byte].
    footer: the footer itself.
    index: what the file says of its chunks, by their place in it.
    """

    reached: bool = False
    data_end: int = -1
    data_crc: int = 0
    footer_at: int = 0
    footer: Footer | None = None
    index: dict[int, ChunkIndex] = field(default_factory=dict)

    def take(self, opcode: int, position: int, body: bytes, parse: Callable[[Any, bytes], Any]) -> bool:
        """Take a record if it belongs to the end of a file; whether it does.

        Raises `ValueError` when it cannot stand where it does.
        """
        if opcode in _SUMMARY and self.data_end < 0:
            raise ValueError("a record of the summary stands among the data")
        if opcode == Opcode.DATA_END:
            self.data_crc = parse(DataEnd, body).data_section_crc
            self.data_end = position
        elif opcode == Opcode.CHUNK_INDEX:
            entry = parse(ChunkIndex, body)
            self.index[entry.chunk_start_offset] = entry
        elif opcode == Opcode.FOOTER:
            self.footer = parse(Footer, body)
            self.footer_at, self.reached = position, True
        else:
            return False
        return True


def faults_of(
    ending: Ending,
    records: Sequence[Any],
    statistics: Statistics | None,
    channels: Mapping[int, Channel],
    data: mmap | bytes,
) -> list[str]:
    """What is wrong with a file that has a footer, one text each; contents of chunks are not looked into.

    Where the file holds no check sum of its data, its own counts and its index must agree with what is in it: a
    chunk that was lost, or the time of one that was changed, is found by that.
    """
    if ending.data_end < 0:
        return ["nothing says where its data end"]
    with memoryview(data) as view:
        if ending.data_crc and zlib.crc32(view[: ending.data_end]) != ending.data_crc:
            return ["the check sum of its data is wrong"]
        assert ending.footer is not None
        if ending.footer.summary_crc and _summary_crc(ending, view) != ending.footer.summary_crc:
            return ["the check sum of its summary is wrong"]
    return [] if ending.data_crc else _miscounts(ending, records, statistics, channels)


def _summary_crc(ending: Ending, view: memoryview) -> int:
    """Check sum from the end of the data to the check sum itself, the last field of the footer."""
    start = ending.data_end + RECORD_HEAD.size + _CRC_BYTES
    footer_fields = RECORD_HEAD.size + 16
    return zlib.crc32(view[start : ending.footer_at + footer_fields])


def _miscounts(
    ending: Ending, records: Sequence[Any], statistics: Statistics | None, channels: Mapping[int, Channel]
) -> list[str]:
    chunks = [record for record in records if isinstance(record, Chunk)]
    found = []
    if ending.index:
        stated = {at: (entry.message_start_time, entry.message_end_time) for at, entry in ending.index.items()}
        if stated != {chunk.position: (chunk.start_ns, chunk.end_ns) for chunk in chunks}:
            found.append("its chunks are not those of its index")
    if statistics is not None:
        kinds = {"chunk": Chunk, "metadata": Metadata, "attachment": Attachment}
        for name, kind in kinds.items():
            stated_count = getattr(statistics, f"{name}_count")
            count = sum(isinstance(record, kind) for record in records)
            if stated_count != count:
                found.append(f"it states {stated_count} {name} records and holds {count}")
        if channels and statistics.channel_count < len(channels):
            found.append(f"it states {statistics.channel_count} channels and holds {len(channels)}")
        if statistics.message_count != sum(statistics.channel_message_counts.values()):
            found.append("its counts of messages do not add up")
    return found
