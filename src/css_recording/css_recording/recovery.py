# SPDX-License-Identifier: Apache-2.0
"""Turns the recording of a killed recorder into a finished one.

Every intact chunk, metadata record and attachment is written again through `BagWriter`, which indexes them
and adds what the recorder had no time for. The torn end is dropped: no message is ever made up. The new file
takes the place of the torn one in one step, so that an interrupted recovery can be repeated.
"""

import shutil
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from mcap.records import Attachment, Metadata

from css_recording.bag_folder import is_being_written, sync_folder, write_atomically
from css_recording.bag_metadata import METADATA_FILE, Topic, read_metadata
from css_recording.bag_storage import topic_of
from css_recording.bag_writer import BagWriter
from css_recording.errors import BagError
from css_recording.mcap_file import Chunk, McapFile, RawMessage

_TEMPORARY_SUFFIX = ".recovering"


@dataclass
class RecoveryReport:
    """What a recovery found and did."""

    recording: Path
    """The finished recording."""
    was_complete: bool = False
    """Nothing was missing, nothing was changed."""
    messages: dict[str, int] = field(default_factory=dict)
    """Messages of each topic in the finished recording."""
    torn_bytes: int = 0
    """Bytes after the last intact record: what was being written."""
    damaged_chunks: int = 0
    """Chunks inside the file that cannot be read."""
    refused_messages: int = 0
    """Messages on channels that the file does not define or that are not of ROS 2."""


def recover(path: str | Path, output: str | Path | None = None) -> RecoveryReport:
    """Finish a recording that its recorder did not.

    Parameters
    ----------
    path: rosbag2 folder with one MCAP file, or a bare `.mcap` file.
    output: new folder; default: the recording itself is replaced, also a bare file by a bare file.

    A complete recording is left as it is, or copied to `output`. Raises `BagError` when there is nothing to
    recover from, when a recorder still writes it, and when more than its end is damaged and no `output` is
    given: what cannot be read is not thrown away unasked.
    """
    source = Path(path).absolute()
    file = McapFile(_mcap_file_of(source))
    try:
        if is_being_written(file.path):
            raise BagError(f"{source}: is being written by a recorder")
        if output is not None:
            report = RecoveryReport(Path(output).absolute())
            _rewrite(file, report.recording, report)
            return report
        damage = _damage(file)
        if damage is not None:
            raise BagError(f"{source}: {damage}; name an output to save what can be read")
        report = RecoveryReport(source)
        if file.complete and (source.is_file() or read_metadata(source) is not None):
            report.was_complete = True
            counts = file.statistics.channel_message_counts if file.statistics else {}
            report.messages = {topic_of(file, number).name: counts.get(number, 0) for number in file.channels}
        else:
            _rewrite_in_place(file, source, report)
        return report
    finally:
        file.close()


def _mcap_file_of(source: Path) -> Path:
    if source.is_file():
        return source
    if not source.is_dir():
        raise BagError(f"{source}: there is no such recording")
    files = sorted(source.glob("*.mcap"))
    if not files:
        raise BagError(f"{source}: holds no .mcap file to recover from")
    if len(files) > 1:
        raise BagError(f"{source}: is split into {len(files)} files; recover each of them by its name")
    return files[0]


def _damage(file: McapFile) -> str | None:
    """What is wrong inside the file, other than its torn end."""
    if file.has_end and not file.complete:
        return f"a record is damaged, {file.torn_bytes} bytes before the end"
    for chunk in file.chunks:
        try:
            file.chunk_messages(chunk)
        except BagError as error:
            return str(error)
    return None


def _rewrite_in_place(file: McapFile, source: Path, report: RecoveryReport) -> None:
    """Write the finished recording beside the torn one and put it in its place."""
    parent = source if source.is_dir() else source.parent
    workplace = parent / f".{file.path.name}{_TEMPORARY_SUFFIX}"
    shutil.rmtree(workplace, ignore_errors=True)  # of a recovery that was interrupted
    try:
        new = _rewrite(file, workplace, report, file.path.name)
        new.replace(file.path)
        if source.is_dir():
            write_atomically(source / METADATA_FILE, (workplace / METADATA_FILE).read_text(encoding="utf-8"))
        sync_folder(parent)
    except OSError as error:
        raise BagError(f"{source}: cannot replace the recording: {error.strerror}") from error
    finally:
        shutil.rmtree(workplace, ignore_errors=True)


def _rewrite(file: McapFile, folder: Path, report: RecoveryReport, file_name: str | None = None) -> Path:
    """Write everything intact into a new recording; gives its file."""
    topics = _learn_topics(file, report)
    with BagWriter(folder, topics.values(), file_name=file_name) as writer:
        for record in _intact(file):
            if isinstance(record, Metadata):
                if record.name != "rosbag2":  # the writer makes its own
                    writer.flush()  # so that the record stays where it was between the messages
                    writer.add_metadata(record.name, record.metadata)
            elif isinstance(record, Attachment):
                writer.flush()
                writer.attach(record.name, record.media_type, record.data, record.log_time)
            elif record.channel_id in topics:
                name = topics[record.channel_id].name
                writer.write(name, record.log_time, record.data, record.publish_time)
            else:
                report.refused_messages += 1
        report.messages = writer.counts
    report.torn_bytes = file.torn_bytes
    return writer.path


def _learn_topics(file: McapFile, report: RecoveryReport) -> dict[int, Topic]:
    """Topics of all channels; in a torn file only the chunks define them."""
    for chunk in file.chunks:
        try:
            file.chunk_messages(chunk)
        except BagError:
            report.damaged_chunks += 1
    topics = {}
    for channel_id in sorted(file.channels):
        with suppress(BagError):  # not a ROS 2 topic
            topics[channel_id] = topic_of(file, channel_id)
    return topics


def _intact(file: McapFile) -> Iterator[Metadata | Attachment | RawMessage]:
    """Everything that can be read, in file order."""
    for record in file.records:
        if not isinstance(record, Chunk):
            yield record
            continue
        with suppress(BagError):
            yield from file.chunk_messages(record)
