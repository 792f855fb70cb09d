# SPDX-License-Identifier: Apache-2.0
"""A recording that begins a new file when one is large or long enough: `NAME_0.mcap`, `NAME_1.mcap` and so on.

Each file is whole by itself: it has the definitions of all topics known when it was begun, the mission and versions,
an index and metadata of its own. `metadata.yaml`, which is written last, tells of all of them.
"""

from bisect import bisect_left
from collections.abc import Iterable, Mapping, Sequence
from operator import itemgetter
from pathlib import Path
from typing import Any, NamedTuple

from css_recording.bag_folder import is_in_place, write_atomically
from css_recording.bag_metadata import (
    METADATA_FILE,
    BagSummary,
    FileSummary,
    Topic,
    bag_information,
    metadata_text,
    ros_distro,
    serialized_metadata,
)
from css_recording.bag_writer import BagWriter
from css_recording.errors import BagError
from css_recording.mcap_output import McapOutput
from css_recording.second_buffer import Message

_STAMP = itemgetter(0)


class FileLimits(NamedTuple):
    """When a file is over; None: never."""

    most_bytes: int | None = None  # on the disk; the chunk that reaches it is the last
    longest_ns: int | None = None  # from the first message to the first of the next file


class SplitBagWriter(BagWriter):
    """A recording of one file or several; otherwise as `BagWriter`."""

    def __init__(
        self,
        folder: str | Path,
        topics: Iterable[Topic] = (),
        metadata: Mapping[str, str] | None = None,
        *,
        files: FileLimits,
        **options: Any,
    ) -> None:
        """Begins the recording.

        Args:
            folder: the recording.
            topics: in the order in which messages of equal stamp are stored.
            metadata: texts kept in every file.
            files: when the next file begins.
            options: as for `BagWriter`.
        """
        self._limits = files
        self._finished: list[FileSummary] = []
        self._head: list[tuple[str, dict[str, str]]] = []
        self._file_start_ns = self._file_end_ns = 0
        self._counts_before: list[int] = []
        super().__init__(folder, topics, metadata, **options)

    def add_metadata(self, name: str, entries: Mapping[str, str]) -> None:
        """Store a named set of texts at once; those that stand before all messages stand in every file."""
        super().add_metadata(name, entries)
        if not any(self._counts):
            self._head.append((name, dict(entries)))

    def _store(self, batches: list[list[Message]]) -> None:
        for batch in batches:
            left = batch
            while left:
                if self._in_this_file() and self._is_over(left[0][0]):
                    self._next_file()
                fitting = self._fitting(left)
                self._store_in_this_file(left[:fitting])
                left = left[fitting:]

    def _store_in_this_file(self, batch: list[Message]) -> None:
        is_first = not self._in_this_file()
        self._file_start_ns = batch[0][0] if is_first else min(self._file_start_ns, batch[0][0])
        self._file_end_ns = batch[-1][0] if is_first else max(self._file_end_ns, batch[-1][0])
        super()._store([batch])

    def _fitting(self, batch: list[Message]) -> int:
        """How many messages of a sorted batch belong into this file by their time; at least one."""
        if self._limits.longest_ns is None or not is_in_place(self._output.descriptor, self.path):
            return len(batch)
        start_ns = self._file_start_ns if self._in_this_file() else batch[0][0]
        return bisect_left(batch, start_ns + self._limits.longest_ns, key=_STAMP)

    def _is_over(self, next_ns: int) -> bool:
        if not is_in_place(self._output.descriptor, self.path):
            return False  # what is written is saved when the batches are stored
        most_bytes, longest_ns = self._limits
        if longest_ns is not None and next_ns - self._file_start_ns >= longest_ns:
            return True
        return most_bytes is not None and self.path.stat().st_size >= most_bytes

    def _next_file(self) -> None:
        self._finish_file()
        self.path = self.folder / f"{self.folder.name}_{len(self._finished)}.mcap"
        self._counts_before = list(self._counts)
        try:
            self._output = McapOutput(self.path)
        except BagError as error:
            self._open, self._failure = False, str(error)
            raise
        with self._disk():
            self._output.start()
            defined = zip(self._topics, self._schemas, strict=True)
            self._channel_ids = [self._output.add_channel(topic, schema) for topic, schema in defined]
        for name, entries in self._head:
            super().add_metadata(name, entries)

    def _finish_file(self, copy: Path | None = None) -> None:
        """Completes the file that is being written, with metadata as if it were the whole recording."""
        counts = self._in_this_file_by_topic()
        start_ns, end_ns = (self._file_start_ns, self._file_end_ns) if any(counts) else (0, 0)
        file = FileSummary(self.path.name, start_ns, end_ns, sum(counts))
        information = self._information([file], counts)
        with self._disk():
            self._output.add_metadata("rosbag2", {"serialized_metadata": serialized_metadata(information)})
            self._output.finish(copy)
        self._finished.append(file)

    def _finish(self, copy: Path | None = None) -> None:
        if copy is not None:  # the folder was deleted, and with it the files that were finished
            self._counts = self._in_this_file_by_topic()
            self._start_ns, self._end_ns = self._file_start_ns, self._file_end_ns
            self._finished.clear()
        if not self._finished:
            super()._finish(copy)
            return
        self._finish_file(copy)
        with self._disk():
            information = self._information(self._finished, self._counts)
            write_atomically(self.folder / METADATA_FILE, metadata_text(information))
        self._open = False

    def _information(self, files: Sequence[FileSummary], counts: Sequence[int]) -> dict[str, Any]:
        summary = BagSummary(files, counts, ros_distro(), self._notes)
        return bag_information(self._topics, [schema.type_hash for schema in self._schemas], summary)

    def _in_this_file_by_topic(self) -> list[int]:
        before = self._counts_before + [0] * (len(self._counts) - len(self._counts_before))
        return [count - past for count, past in zip(self._counts, before, strict=True)]

    def _in_this_file(self) -> bool:
        return any(self._in_this_file_by_topic())
