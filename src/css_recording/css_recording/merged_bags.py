# SPDX-License-Identifier: Apache-2.0
"""Several recordings played as one."""

import heapq
from collections.abc import Collection, Iterator, Mapping, Sequence
from operator import attrgetter
from pathlib import Path
from typing import Protocol

from css_recording.bag_metadata import absolute
from css_recording.bag_reader import BagMessage, BagReader
from css_recording.bag_storage import TopicCount
from css_recording.errors import BagError


class Recording(Protocol):
    """What is played: one recording, or several together."""

    @property
    def name(self) -> str:
        """What to call it in a message."""

    @property
    def topics(self) -> list[TopicCount]:
        """Topics with their numbers of messages."""

    @property
    def start_ns(self) -> int:
        """Log time of the earliest message; 0 when there is none."""

    @property
    def end_ns(self) -> int:
        """Log time of the latest message; 0 when there is none."""

    def messages(
        self, topics: Collection[str] | None = None, start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[BagMessage]:
        """Messages in log-time order, those of some topics, with log times in [start_ns, end_ns)."""


class MergedBags:
    """Recordings merged by log time; messages of equal time in the order in which the recordings are named."""

    def __init__(self, paths: Sequence[str | Path], remap: Mapping[str, str] | None = None) -> None:
        """Opens all of them.

        Args:
            paths: rosbag2 folders or files.
            remap: new names of topics, old name -> new name.

        Raises:
            BagError: one cannot be read, none has a topic that is to be renamed, or a topic has two types.
        """
        self._readers: list[BagReader] = []
        try:
            for path in paths:
                self._readers.append(BagReader(path))
            self._rename({absolute(old): new for old, new in (remap or {}).items()})
            self._topics = self._merged_topics()
        except BagError:
            self.close()
            raise

    @property
    def name(self) -> str:
        """What to call them in a message."""
        return ", ".join(str(reader.path) for reader in self._readers)

    @property
    def topics(self) -> list[TopicCount]:
        """Topics with their numbers of messages in all recordings."""
        return list(self._topics)

    @property
    def start_ns(self) -> int:
        """Log time of the earliest message; 0 when there is none."""
        return min((reader.start_ns for reader in self._readers if reader.message_count), default=0)

    @property
    def end_ns(self) -> int:
        """Log time of the latest message; 0 when there is none."""
        return max((reader.end_ns for reader in self._readers if reader.message_count), default=0)

    def messages(
        self, topics: Collection[str] | None = None, start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[BagMessage]:
        """Messages in log-time order, those of some topics, with log times in [start_ns, end_ns)."""
        streams = []
        for reader in self._readers:
            held = {entry.topic.name for entry in reader.topics}
            wanted = held if topics is None else held & set(topics)
            if wanted:
                streams.append(reader.messages(wanted, start_ns, end_ns))
        return streams[0] if len(streams) == 1 else heapq.merge(*streams, key=attrgetter("stamp_ns"))

    @property
    def notes(self) -> list[str]:
        """What must be known of the recordings, and what was passed over in them so far, one text each."""
        return [
            f"{reader.path}: {note}" for reader in self._readers for note in (*reader.notes, *map(str, reader.refused))
        ]

    def close(self) -> None:
        """Releases the files."""
        for reader in self._readers:
            reader.close()

    def __enter__(self) -> "MergedBags":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _rename(self, names: Mapping[str, str]) -> None:
        """Opens again, with its new names, whatever has a topic that gets one."""
        held = [{entry.topic.name for entry in reader.topics} for reader in self._readers]
        missing = [name for name in names if not any(name in topics for topics in held)]
        if missing:
            raise BagError(f"{self.name}: no topic {missing[0]} to rename")
        for number, topics in enumerate(held):
            own = {old: new for old, new in names.items() if old in topics}
            if own:
                self._readers[number].close()
                self._readers[number] = BagReader(self._readers[number].path, own)

    def _merged_topics(self) -> list[TopicCount]:
        merged: dict[str, tuple[TopicCount, BagReader]] = {}
        for reader in self._readers:
            for entry in reader.topics:
                name = entry.topic.name
                known, first = merged.get(name, (entry._replace(count=0), reader))
                if known.topic.type != entry.topic.type:
                    raise BagError(
                        f"topic {name} is {known.topic.type} in {first.path} and {entry.topic.type} in {reader.path}; "
                        "these cannot be played together"
                    )
                merged[name] = (known._replace(count=known.count + entry.count), first)
        return [entry for entry, _ in merged.values()]
