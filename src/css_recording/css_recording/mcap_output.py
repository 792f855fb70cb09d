# SPDX-License-Identifier: Apache-2.0
"""One MCAP file being written: the library's writer and what a recording needs beyond it."""

import os
import shutil
import zlib
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import IO

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Channel, DataEnd, Schema
from mcap.writer import CompressionType, Writer

from css_recording.bag_folder import create_file
from css_recording.bag_metadata import Topic, qos_text
from css_recording.mcap_chunk import RECORD_HEAD
from css_recording.schemas import MessageSchema

LIBRARY = "sunpoint css_recording"
_MAX_CHUNK_BYTES = 1 << 20
_DATA_END_HEAD = RECORD_HEAD.pack(Opcode.DATA_END, 4)


class McapOutput:
    """An MCAP file of profile `ros2`, zstd chunks, indexed, with check sums of everything in it.

    Methods raise `OSError` when the disk is full.
    """

    def __init__(self, path: Path) -> None:
        self._file = _CheckedFile(create_file(path))
        # Summary offsets are optional, and the library writes one that points to nothing when a file has no
        # attachment, which checkers of the format report as an error.
        self._writer = Writer(
            self._file,  # type: ignore[arg-type]  # it writes, tells and flushes, and is asked for no more
            chunk_size=_MAX_CHUNK_BYTES,
            compression=CompressionType.ZSTD,
            use_summary_offsets=False,
        )
        self._schema_ids: dict[MessageSchema, int] = {}

    @property
    def descriptor(self) -> int:
        """Descriptor of the open file."""
        return int(self._file.fileno())

    def start(self) -> None:
        """Write the head of the file."""
        self._writer.start(profile="ros2", library=LIBRARY)
        self._file.flush()

    def add_channel(self, topic: Topic, schema: MessageSchema) -> int:
        """Define a channel; gives its number.

        The library keeps definitions for the next chunk. Here they are also written at once, outside of
        chunks, so that a recording without messages is valid and one that is killed early knows its topics.
        """
        records = RecordBuilder()
        if schema not in self._schema_ids:
            text = schema.text.encode(errors="surrogateescape")
            schema_id = self._writer.register_schema(schema.type_name, schema.encoding, text)
            self._schema_ids[schema] = schema_id
            Schema(id=schema_id, name=schema.type_name, encoding=schema.encoding, data=text).write(records)
        schema_id = self._schema_ids[schema]
        entries = {"offered_qos_profiles": qos_text(topic.qos), "topic_type_hash": schema.type_hash}
        channel_id = self._writer.register_channel(topic.name, topic.encoding, schema_id, entries)
        Channel(channel_id, topic.name, topic.encoding, entries, schema_id).write(records)
        self._file.write(records.end())
        self._file.flush()
        return channel_id

    def write_chunk(self, messages: Iterable[tuple[int, int, int, int, bytes]]) -> None:
        """Write messages (channel, sequence number, log time, publish time, data) as a chunk and flush it.

        More than a chunk may hold become several.
        """
        add_message = self._writer.add_message
        for channel_id, sequence, log_time, publish_time, data in messages:
            add_message(channel_id, log_time, data, publish_time, sequence)
        self._writer.flush()

    def add_metadata(self, name: str, entries: Mapping[str, str]) -> None:
        """Write a named set of texts and flush it."""
        self._writer.add_metadata(name, dict(entries))
        self._writer.flush()

    def attach(self, name: str, media_type: str, data: bytes, stamp_ns: int) -> None:
        """Write a file into the file and flush it."""
        self._writer.add_attachment(stamp_ns, stamp_ns, name, media_type, data)
        self._writer.flush()

    def finish(self, copy: Path | None = None) -> None:
        """Write the index and close the file; it is on the disk then.

        copy: also written there, from the open file: it may have been deleted.
        """
        self._writer.finish()
        self._file.flush()
        os.fsync(self.descriptor)
        if copy is not None:
            shutil.copyfile(f"/proc/self/fd/{self.descriptor}", copy)
        self._file.close()

    def abandon(self) -> None:
        """Let go of the file without finishing it."""
        with suppress(OSError):
            self._file.close()


class _CheckedFile:
    """A file that puts the check sum of all that was written into the record that ends the data.

    The library computes one too, of what goes through it alone; definitions that are written at once do not.
    """

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file
        self._crc = 0
        self.tell, self.flush, self.fileno, self.close = file.tell, file.flush, file.fileno, file.close

    def write(self, data: bytes) -> int:
        if data.startswith(_DATA_END_HEAD):
            record = RecordBuilder()
            DataEnd(self._crc).write(record)
            data = record.end()
        self._crc = zlib.crc32(data, self._crc)
        return self._file.write(data)
