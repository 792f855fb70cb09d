# SPDX-License-Identifier: Apache-2.0
"""Writes a recording: a rosbag2 folder with one MCAP file, from serialised messages and simulated stamps.

The log time of a message is its stamp, never the wall clock, and nothing else in the file depends on when or
where it was written. Messages are held until their span of simulated time is over, sorted by stamp and topic, and
written as one chunk that is handed to the operating system at once. The same flight therefore gives the same bytes,
in whatever order its messages arrived, and a killed recorder loses one simulated second (`second_buffer`).

A finished recording is one that has a `metadata.yaml`: it is written last, under another name, and renamed.
"""

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import Self

from css_recording.bag_folder import free_name, is_in_place, place_of, prepare_folder, write_atomically
from css_recording.bag_metadata import (
    METADATA_FILE,
    BagSummary,
    FileSummary,
    Topic,
    absolute,
    bag_information,
    metadata_text,
    ros_distro,
    serialized_metadata,
)
from css_recording.errors import BagError
from css_recording.mcap_output import McapOutput
from css_recording.provenance import SEAL, sealed
from css_recording.schemas import MessageSchema, schema_of
from css_recording.second_buffer import BufferLimits, Message, SecondBuffer

METADATA_RECORD = "sunpoint"
FLIGHT_RECORD = "sunpoint_flight"
"""Texts known at the end of a flight; `metadata.yaml` has them too, as `custom_data`."""
LAST_NS = (1 << 63) - 1
"""No stamp of ROS is as late as this."""
_SEALED_RECORDS = (METADATA_RECORD, FLIGHT_RECORD)


class BagWriter:
    """A recording being written.

    Parameters
    ----------
    folder: the recording. The file in it is called `<folder name>_0.mcap`, as rosbag2 does.
    topics: in the order in which messages of equal stamp are stored.
    metadata: texts kept in the file's record `sunpoint` (mission, versions, ...).
    overwrite: replace a recording that is there. A folder that holds anything else is always refused.
    limits: how long messages are held to be put in order.
    file_name: of the file, when it is not the folder's name.

    Every method raises `BagError` when the disk refuses. The recording is then over, and what was written
    before can be recovered. So it does when the folder is moved or deleted under it: the recording is then finished
    in its new place, or in a new folder beside the old one, and over too.
    """

    def __init__(
        self,
        folder: str | Path,
        topics: Iterable[Topic] = (),
        metadata: Mapping[str, str] | None = None,
        *,
        overwrite: bool = False,
        limits: BufferLimits = BufferLimits(),  # noqa: B008 (immutable)
        file_name: str | None = None,
    ) -> None:
        self.folder = Path(folder).absolute()
        self.path = self.folder / (file_name or f"{self.folder.name}_0.mcap")
        self._topics: list[Topic] = []
        self._schemas: list[MessageSchema] = []
        self._index: dict[str, int] = {}
        self._channel_ids: list[int] = []
        self._counts: list[int] = []
        self._notes: dict[str, str] = {}
        self._start_ns = self._end_ns = 0
        self._buffer = SecondBuffer(limits)
        self._open = True
        self._failure: str | None = None
        # An unknown type is found before anything is on the disk.
        defined = [topic._replace(schema=topic.schema or schema_of(topic.type)) for topic in topics]
        prepare_folder(self.folder, overwrite)
        self._output = McapOutput(self.path)
        try:
            with self._disk():
                self._output.start()
            for topic in defined:
                self.add_topic(topic)
            if metadata:
                self.add_metadata(METADATA_RECORD, metadata)
        except BagError:
            self._output.abandon()
            raise

    @property
    def topics(self) -> tuple[Topic, ...]:
        """Topics in the order in which equal stamps are stored."""
        return tuple(self._topics)

    @property
    def counts(self) -> dict[str, int]:
        """Messages received so far for each topic."""
        counts = {topic.name: count for topic, count in zip(self._topics, self._counts, strict=True)}
        for message in self._buffer.held():
            counts[self._topics[message[1]].name] += 1
        return counts

    @property
    def late_messages(self) -> int:
        """Messages that came after their part of a simulated second was on disk. They are kept, out of order."""
        return self._buffer.late_messages

    @property
    def closed(self) -> bool:
        """Whether the recording is over, finished or failed."""
        return not self._open

    def add_topic(self, topic: Topic) -> None:
        """Make a topic known. Repeating it with the same type changes nothing."""
        self._check_open()
        name = absolute(topic.name)
        if name in self._index:
            known = self._topics[self._index[name]].type
            if known != topic.type:
                raise BagError(f"{self.folder}: topic {name} is recorded as {known}, not as {topic.type}")
            return
        topic = topic._replace(name=name)
        schema = topic.schema or schema_of(topic.type)
        with self._disk():
            self._channel_ids.append(self._output.add_channel(topic, schema))
        self._index[name] = len(self._topics)
        self._topics.append(topic)
        self._schemas.append(schema)
        self._counts.append(0)

    def write(self, topic: str, stamp_ns: int, data: bytes, publish_time_ns: int | None = None) -> None:
        """Record one serialised message.

        topic: absolute name of a topic that was added.
        stamp_ns: [ns since 1970, simulated UTC] log time; not negative, and within 63 bits.
        data: little-endian CDR with its four-byte header.
        publish_time_ns: default: the stamp.
        """
        index = self._index.get(topic)
        if index is None or not 0 <= stamp_ns <= LAST_NS or not self._open:
            self._check_open()
            era = "before 1970" if stamp_ns < 0 else "is later than ROS can tell"
            reason = "was not added to the recording" if index is None else f"stamp {stamp_ns} {era}"
            raise BagError(f"{self.folder}: topic {topic}: {reason}")
        publish_time_ns = stamp_ns if publish_time_ns is None else publish_time_ns
        batches = self._buffer.add((stamp_ns, index, data, publish_time_ns))
        if batches:
            self._store(batches)
            self._check_place()

    def add_metadata(self, name: str, entries: Mapping[str, str]) -> None:
        """Store a named set of texts at once, between the messages: an event, a parameter that changed."""
        self._check_open()
        if name in _SEALED_RECORDS:
            entries = sealed(entries)
        if name == FLIGHT_RECORD:
            self._notes.update((key, value) for key, value in entries.items() if key != SEAL)
        with self._disk():
            self._output.add_metadata(name, entries)

    def attach(self, name: str, media_type: str, data: bytes, stamp_ns: int) -> None:
        """Store a file in the recording."""
        self._check_open()
        with self._disk():
            self._output.attach(name, media_type, data, stamp_ns)

    def flush(self) -> None:
        """Hand everything received so far to the operating system."""
        self._check_open()
        self._store(self._buffer.drain())
        self._check_place()

    def close(self, notes: Mapping[str, str] | None = None) -> None:
        """Finish the recording. Closing it again does nothing.

        notes: what is known only now (how the flight ended, what was lost): the record `sunpoint_flight`.
        """
        if not self._open:
            return
        self.flush()
        if notes:
            self.add_metadata(FLIGHT_RECORD, notes)
        self._finish()

    def _finish(self, copy: Path | None = None) -> None:
        """Write what stands at the end of a recording."""
        file = FileSummary(self.path.name, self._start_ns, self._end_ns, sum(self._counts))
        summary = BagSummary([file], self._counts, ros_distro(), self._notes)
        information = bag_information(self._topics, [schema.type_hash for schema in self._schemas], summary)
        with self._disk():
            # One record only: of several, some readers take the first and others the last.
            self._output.add_metadata("rosbag2", {"serialized_metadata": serialized_metadata(information)})
            self._output.finish(copy)
            write_atomically(self.folder / METADATA_FILE, metadata_text(information))
        self._open = False

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        if value is None:
            self.close()
        else:
            with suppress(BagError):  # the first error is the one to hear about
                self.close()

    def _store(self, batches: list[list[Message]]) -> None:
        """Write each batch as a chunk."""
        for batch in batches:
            is_first = not any(self._counts)
            self._start_ns = batch[0][0] if is_first else min(self._start_ns, batch[0][0])
            self._end_ns = max(self._end_ns, batch[-1][0])
            with self._disk():
                self._output.write_chunk(self._numbered(batch))

    def _check_place(self) -> None:
        """End the recording when its file is no longer where it was begun, and save what it holds."""
        if is_in_place(self._output.descriptor, self.path) or self._failure:
            return
        place = place_of(self._output.descriptor)
        what = f"{self.folder}: was {'deleted' if place is None else 'moved'} while it was being recorded"
        self._open, self._failure = False, what
        self._store(self._buffer.drain())
        if place is None:
            self.folder = free_name(self.folder.with_name(f"{self.folder.name}_rescued"))
            prepare_folder(self.folder, overwrite=False)
        self.path = place or self.folder / self.path.name
        self.folder = self.path.parent
        received = sum(self._counts)
        self._finish(copy=None if place else self.path)
        kept = sum(self._counts)
        which = f"the {kept}" if kept == received else f"the last {kept} of {received}"
        self._failure = f"{what}; {which} messages until then are in {self.folder}"
        raise BagError(self._failure)

    def _numbered(self, batch: list[Message]) -> Iterator[tuple[int, int, int, int, bytes]]:
        """Messages with the numbers of their channels and their places in them."""
        channel_ids, counts = self._channel_ids, self._counts
        for stamp_ns, index, data, publish_time_ns in batch:
            counts[index] = count = counts[index] + 1
            yield channel_ids[index], count & 0xFFFFFFFF, stamp_ns, publish_time_ns, data

    def _check_open(self) -> None:
        if not self._open:
            raise BagError(self._failure or f"{self.folder}: the recording is closed")

    @contextmanager
    def _disk(self) -> Iterator[None]:
        """Ends the recording when the disk refuses to take what is written inside."""
        try:
            yield
        except OSError as error:
            self._output.abandon()
            self._open = False
            self._failure = (
                f"{self.path}: cannot write the recording: {error.strerror or error}; "
                f"`recover {self.folder}` keeps what was written before"
            )
            raise BagError(self._failure) from error
