# SPDX-License-Identifier: Apache-2.0
"""One MCAP file being written: profile `ros2`, zstd chunks, indexed, with check sums of everything in it.

The library `mcap` writes the records that are few. Messages are packed here with one `struct` call each, three times
as fast as through the library: a recorder takes its time from the flight that it records.
"""

import os
import zlib
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path

from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    DataEnd,
    Footer,
    Header,
    Metadata,
    MetadataIndex,
    Schema,
)

from css_recording.bag_folder import create_file
from css_recording.bag_metadata import Topic, qos_text
from css_recording.chunk_builder import ChunkBuilder, Record, bytes_of
from css_recording.mcap_file import MAGIC
from css_recording.schemas import MessageSchema

LIBRARY = "sunpoint css_recording"
_MAX_CHUNK_BYTES = 1 << 20
_COPIED_AT_A_TIME = 1 << 20  # [bytes]
_CRC_BYTES = 4


class McapOutput:
    """An MCAP file being written. Methods raise `OSError` when the disk is full."""

    def __init__(self, path: Path) -> None:
        self._file = create_file(path)
        self._position = self._crc = 0
        self._chunk = ChunkBuilder()
        self._schemas: dict[MessageSchema, Schema] = {}
        self._channels: list[Channel] = []
        self._indexes: list[AttachmentIndex | MetadataIndex] = []

    @property
    def descriptor(self) -> int:
        """Descriptor of the open file."""
        return self._file.fileno()

    def start(self) -> None:
        """Write the head of the file."""
        self._write(MAGIC + bytes_of(Header(profile="ros2", library=LIBRARY)))

    def add_channel(self, topic: Topic, schema: MessageSchema) -> int:
        """Define a channel; gives its number.

        Definitions stand in the next chunk, for readers that look into chunks alone. They are also written at once,
        outside of chunks, so that a recording without messages is valid and one that is killed early knows its
        topics.
        """
        new: list[Record] = []
        if schema not in self._schemas:
            text = schema.text.encode(errors="surrogateescape")
            record = Schema(id=len(self._schemas) + 1, data=text, encoding=schema.encoding, name=schema.type_name)
            self._schemas[schema] = record
            new.append(record)
        entries = {"offered_qos_profiles": qos_text(topic.qos), "topic_type_hash": schema.type_hash}
        schema_id = self._schemas[schema].id
        channel = Channel(
            id=len(self._channels) + 1,
            topic=topic.name,
            message_encoding=topic.encoding,
            metadata=entries,
            schema_id=schema_id,
        )
        self._channels.append(channel)
        definitions = bytes_of(*new, channel)
        self._chunk.add_definitions(definitions)
        self._write(definitions)
        return channel.id

    def write_chunk(self, messages: Iterable[tuple[int, int, int, int, bytes]]) -> None:
        """Write messages (channel, sequence number, log time, publish time, data) as a chunk, by log time.

        More than a chunk may hold become several.
        """
        waiting = iter(messages)
        while self._chunk.fill(waiting, _MAX_CHUNK_BYTES):
            self._write(self._chunk.finish(self._position))

    def add_metadata(self, name: str, entries: Mapping[str, str]) -> None:
        """Write a named set of texts."""
        data = bytes_of(Metadata(name=name, metadata=dict(entries)))
        self._indexes.append(MetadataIndex(offset=self._position, length=len(data), name=name))
        self._write(data)

    def attach(self, name: str, media_type: str, data: bytes, stamp_ns: int) -> None:
        """Write a file into the file."""
        record = bytes_of(
            Attachment(create_time=stamp_ns, log_time=stamp_ns, name=name, media_type=media_type, data=data)
        )
        index = AttachmentIndex(
            offset=self._position,
            length=len(record),
            create_time=stamp_ns,
            log_time=stamp_ns,
            data_size=len(data),
            name=name,
            media_type=media_type,
        )
        self._indexes.append(index)
        self._write(record)

    def finish(self, copy: Path | None = None) -> None:
        """Write the index and close the file; it is on the disk then.

        copy: also written there, from the open file: it may have been deleted.
        """
        self._write(bytes_of(DataEnd(data_section_crc=self._crc)))
        summary = self._summary()
        # Summary offsets are optional, and nothing that reads recordings needs them.
        footer = Footer(summary_start=self._position, summary_offset_start=0, summary_crc=0)
        footer.summary_crc = zlib.crc32(summary + bytes_of(footer)[:-_CRC_BYTES])
        self._write(summary + bytes_of(footer) + MAGIC)
        os.fsync(self.descriptor)
        if copy is not None:
            _copy(self.descriptor, copy)
        self._file.close()

    def abandon(self) -> None:
        """Let go of the file without finishing it."""
        with suppress(OSError):
            self._file.close()

    def _summary(self) -> bytes:
        attachments = [index for index in self._indexes if isinstance(index, AttachmentIndex)]
        metadata = [index for index in self._indexes if isinstance(index, MetadataIndex)]
        statistics = self._chunk.statistics(len(self._schemas), len(self._channels), len(attachments), len(metadata))
        definitions = [*self._schemas.values(), *self._channels]
        return bytes_of(*definitions, statistics) + self._chunk.indexes + bytes_of(*attachments, *metadata)

    def _write(self, data: bytes) -> None:
        """Hand bytes to the operating system at once."""
        self._file.write(data)
        self._file.flush()
        self._crc = zlib.crc32(data, self._crc)
        self._position += len(data)


def _copy(descriptor: int, copy: Path) -> None:
    """Writes all of an open file to another; by its descriptor, for its name may be gone."""
    with copy.open("wb") as file:
        at = 0
        while part := os.pread(descriptor, _COPIED_AT_A_TIME, at):
            file.write(part)
            at += len(part)
