# SPDX-License-Identifier: Apache-2.0
"""Writes what can be read of a torn or damaged recording into a new one, and tells what cannot."""

import shutil
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from mcap.records import Attachment, Metadata

from css_recording.bag_metadata import RECOVERY_NOTE, Topic
from css_recording.bag_storage import BagStorage
from css_recording.bag_writer import LAST_NS, BagWriter
from css_recording.errors import BagError
from css_recording.mcap_chunk import Chunk, RawMessage
from css_recording.mcap_file import McapFile
from css_recording.mcap_storage import recorded_topic
from css_recording.provenance import SEAL, broken_entries


@dataclass
class RecoveryReport:
    """What a recovery found and did."""

    recording: Path
    """The finished recording."""
    was_complete: bool = False
    """Nothing was missing, nothing was changed."""
    rewritten: bool = False
    """A file was written again."""
    messages: dict[str, int] = field(default_factory=dict)
    """Messages of each topic in the finished recording."""
    torn_bytes: int = 0
    """Bytes after the last intact record: what was being written."""
    damaged_chunks: int = 0
    """Chunks inside the file that cannot be read."""
    refused_messages: int = 0
    """Messages on channels that the file does not define or that have no type, or at times that ROS cannot tell."""
    damage: list[str] = field(default_factory=list)
    """What else is damaged, one text each."""
    notes: list[str] = field(default_factory=list)
    """What a reader of the recording must know, one text each."""

    @property
    def losses(self) -> list[str]:
        """What could not be saved, one text each."""
        losses = [f"the last {self.torn_bytes} bytes, which were being written"] if self.torn_bytes else []
        losses += [f"{self.damaged_chunks} damaged chunks"] if self.damaged_chunks else []
        losses += [f"{self.refused_messages} messages that are not of ROS 2"] if self.refused_messages else []
        return losses + self.damage


def damage_of(file: McapFile) -> str | None:
    """What is wrong inside a file, other than its torn end; None: nothing."""
    if file.damage:
        return file.damage[0]
    refused = 0
    for chunk in file.chunks:
        try:
            refused += sum(_is_refused(file, message) for message in file.chunk_messages(chunk))
        except BagError as error:
            return str(error).removeprefix(f"{file.path}: ")
    refused += sum(_is_refused(file, message) for message in file.loose_messages)
    if refused and not file.complete:
        return f"{refused} messages are not of ROS 2"
    for record in file.metadata:
        for entry in broken_entries(record.metadata):
            return f"the {entry} in its record '{record.name}' is not what was recorded"
    if file.private_records and not file.complete:
        return f"{file.private_records} records are of types that only another application knows"
    return None


def rewrite(
    source: Path, files: Sequence[McapFile], folder: Path, report: RecoveryReport, file_name: str | None = None
) -> Path:
    """Write everything intact in some files into one new recording; gives its file.

    `BagError` when the disk refuses; nothing is left of the new recording then.
    """
    topics = [_learn_topics(file, report) for file in files]
    known = {topic.name: topic for found in topics for topic in found.values()}
    writer = _create(source, folder, known.values(), file_name)
    try:
        for file, found in zip(files, topics, strict=True):
            _copy(file, found, writer, report)
        report.messages = writer.counts
        report.rewritten = True
        _finish(writer, report, [file.path.name for file in files if not file.ending.reached])
    except BagError as error:
        raise _given_up(source, folder, error) from error
    return writer.path


def copy_messages(source: Path, storage: BagStorage, folder: Path, report: RecoveryReport) -> None:
    """Write the messages of an open recording into a new one."""
    topics = [entry.topic for entry in storage.topics()]
    writer = _create(
        source, folder, [t._replace(schema=t.schema if t.schema and t.schema.text else None) for t in topics]
    )
    try:
        for stamp_ns, topic, _, data in storage.messages(frozenset(t.name for t in topics), -(1 << 64), 1 << 64):
            if 0 <= stamp_ns <= LAST_NS:
                writer.write(topic, stamp_ns, data)
            else:
                report.refused_messages += 1
        report.messages = writer.counts
        report.rewritten = True
        report.notes += storage.notes
        _finish(writer, report, [])
    except BagError as error:
        raise _given_up(source, folder, error) from error


def _create(source: Path, folder: Path, topics: Iterable[Topic], file_name: str | None = None) -> BagWriter:
    try:
        return BagWriter(folder, topics, file_name=file_name)
    except BagError as error:
        if isinstance(error.__cause__, OSError):
            raise _given_up(source, folder, error) from error
        raise


def _finish(writer: BagWriter, report: RecoveryReport, torn: list[str]) -> None:
    """Close a recording, and keep in it what was lost: whoever reads it later must know."""
    lost = [f"{name} had no end: up to a second may be missing" for name in torn] + report.losses
    writer.close({RECOVERY_NOTE: "; ".join(lost)} if lost else None)


def _given_up(source: Path, folder: Path, error: BagError) -> BagError:
    """Remove a new recording that cannot be finished; gives the error to raise."""
    cause = error.__cause__
    if not isinstance(cause, OSError):
        return error
    shutil.rmtree(folder, ignore_errors=True)
    return BagError(
        f"{source}: cannot be recovered: {cause.strerror or cause}; it is as it was. "
        "Make room, or name an output on another disk"
    )


def _learn_topics(file: McapFile, report: RecoveryReport) -> dict[int, Topic]:
    """Topics of all channels; in a torn file only the chunks define them."""
    for chunk in file.chunks:
        try:
            file.chunk_messages(chunk)
        except BagError:
            report.damaged_chunks += 1
    report.damage += file.damage
    topics = {}
    for channel_id in sorted(file.channels):
        with suppress(BagError):  # without a type
            topics[channel_id] = recorded_topic(file, channel_id)
    return topics


def _is_refused(file: McapFile, message: RawMessage) -> bool:
    channel = file.channels.get(message.channel_id)
    return channel is None or channel.schema_id not in file.schemas or message.log_time > LAST_NS


def _copy(file: McapFile, topics: dict[int, Topic], writer: BagWriter, report: RecoveryReport) -> None:
    report.torn_bytes += file.torn_bytes
    for record in _intact(file):
        if isinstance(record, Metadata):
            _copy_metadata(record, writer, report)
        elif isinstance(record, Attachment):
            writer.flush()
            writer.attach(record.name, record.media_type, record.data, record.log_time)
        elif record.channel_id in topics and record.log_time <= LAST_NS:
            name = topics[record.channel_id].name
            writer.write(name, record.log_time, record.data, record.publish_time)
        else:
            report.refused_messages += 1


def _copy_metadata(record: Metadata, writer: BagWriter, report: RecoveryReport) -> None:
    if record.name == "rosbag2":  # the writer makes its own
        return
    writer.flush()  # so that the record stays where it was between the messages
    broken = broken_entries(record.metadata)
    report.damage += [f"the {entry} in the record '{record.name}' was not what was recorded" for entry in broken]
    left_out = {SEAL, *broken} if broken else set()
    writer.add_metadata(record.name, {key: value for key, value in record.metadata.items() if key not in left_out})


def _intact(file: McapFile) -> Iterator[Metadata | Attachment | RawMessage]:
    """Everything that can be read, in file order."""
    for record in file.records:
        if not isinstance(record, Chunk):
            yield record
            continue
        with suppress(BagError):
            yield from file.chunk_messages(record)
