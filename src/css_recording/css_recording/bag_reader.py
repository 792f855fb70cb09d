# SPDX-License-Identifier: Apache-2.0
"""Reads any recording: a rosbag2 folder (MCAP or SQLite) or a bare `.mcap` file, own or foreign."""

from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self

from css_recording.bag_metadata import absolute
from css_recording.bag_storage import TopicCount, open_storage
from css_recording.bag_writer import FLIGHT_RECORD, METADATA_RECORD
from css_recording.errors import BagError

LAST_NS = (1 << 63) - 1
"""No stamp of ROS is as late as this."""
CDR_LITTLE_ENDIAN = b"\x00\x01"


class BagMessage(NamedTuple):
    """One recorded message."""

    topic: str  # absolute, after remapping
    type: str  # "css_msgs/msg/CssVoltages"
    stamp_ns: int  # log time; in Sunpoint's own recordings the stamp of the message's header
    data: bytes  # little-endian CDR with its four-byte header


class BagReader:
    """An open recording.

    Parameters
    ----------
    path: rosbag2 folder or `.mcap` file.
    remap: new names of topics, old name -> new name. Everything below uses the new names.

    Raises `BagError` when there is no recording, when it is unfinished (the text names the command that
    recovers it) or when its messages are not CDR.
    """

    def __init__(self, path: str | Path, remap: Mapping[str, str] | None = None) -> None:
        self.path = Path(path)
        names = {absolute(old): absolute(new) for old, new in (remap or {}).items()}
        self._storage = open_storage(self.path)
        recorded = self._storage.topics()
        self._new_names = {topic.name: names.get(topic.name, topic.name) for topic, _ in recorded}
        try:
            self._check_renaming(names)
        except BagError:
            self._storage.close()
            raise
        self._topics = [
            TopicCount(topic._replace(name=self._new_names[topic.name]), count) for topic, count in recorded
        ]

    @property
    def name(self) -> str:
        """What to call it in a message."""
        return str(self.path)

    @property
    def topics(self) -> list[TopicCount]:
        """Topics in the order of the recording."""
        return list(self._topics)

    @property
    def message_count(self) -> int:
        """Number of messages of all topics."""
        return sum(entry.count for entry in self._topics)

    @property
    def start_ns(self) -> int:
        """Log time of the earliest message; 0 when there is none."""
        return self._storage.time_span()[0]

    @property
    def end_ns(self) -> int:
        """Log time of the latest message; 0 when there is none."""
        return self._storage.time_span()[1]

    @property
    def duration_ns(self) -> int:
        """Time from the earliest to the latest message."""
        return self.end_ns - self.start_ns

    @property
    def metadata(self) -> list[tuple[str, dict[str, str]]]:
        """Named sets of texts in the order in which they were recorded."""
        return self._storage.metadata()

    @property
    def description(self) -> dict[str, str]:
        """What Sunpoint says about the recording: mission, versions, notes made when it was closed.

        Empty for foreign recordings. A note never hides what was written at the start.
        """
        entries: dict[str, dict[str, str]] = {FLIGHT_RECORD: {}, METADATA_RECORD: {}}
        for name, values in self.metadata:
            if name in entries:
                entries[name].update(values)
        return entries[FLIGHT_RECORD] | entries[METADATA_RECORD]

    @property
    def mission_text(self) -> str | None:
        """The mission file that flew, if the recording holds one."""
        return self.description.get("mission")

    def messages(
        self,
        topics: Collection[str] | None = None,
        start_ns: int | None = None,
        end_ns: int | None = None,
    ) -> Iterator[BagMessage]:
        """Messages in log-time order; those of equal time in the order of the file.

        topics: only these, by their new names; a topic that is not in the recording is an error.
        start_ns, end_ns: only log times in [start_ns, end_ns).
        """
        wanted = self._recorded_names(topics)
        start_ns = 0 if start_ns is None else start_ns
        end_ns = LAST_NS if end_ns is None else end_ns
        for stamp_ns, topic, type_name, data in self._storage.messages(wanted, start_ns, end_ns):
            if data[:2] != CDR_LITTLE_ENDIAN:
                raise BagError(
                    f"{self.path}: topic {topic} at {stamp_ns} ns: the message is "
                    + ("big-endian" if data[:2] == b"\0\0" else f"encoded as {data[:2].hex() or 'nothing'}")
                    + "; only little-endian CDR can be read"
                )
            yield BagMessage(self._new_names[topic], type_name, stamp_ns, data)

    def _check_renaming(self, names: Mapping[str, str]) -> None:
        missing = names.keys() - self._new_names.keys()
        if missing:
            raise BagError(f"{self.path}: no topic {min(missing)} to rename")
        new_names = list(self._new_names.values())
        for name in new_names:
            if new_names.count(name) > 1:
                raise BagError(f"{self.path}: renaming gives two topics the name {name}")

    def _recorded_names(self, topics: Collection[str] | None) -> frozenset[str]:
        if topics is None:
            return frozenset(self._new_names)
        asked = {absolute(topic) for topic in topics}
        unknown = asked - set(self._new_names.values())
        if unknown:
            known = ", ".join(sorted(self._new_names.values())) or "none"
            raise BagError(f"{self.path}: no topic {min(unknown)}; the recording has {known}")
        return frozenset(old for old, new in self._new_names.items() if new in asked)

    def close(self) -> None:
        """Release the files."""
        self._storage.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
