# SPDX-License-Identifier: Apache-2.0
"""Reads any recording: a rosbag2 folder (MCAP or SQLite) or a bare `.mcap` file, own or foreign."""

from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self

from css_recording.bag_files import open_storage
from css_recording.bag_metadata import RECOVERY_NOTE, absolute
from css_recording.bag_storage import TopicCount
from css_recording.bag_writer import FLIGHT_RECORD, LAST_NS, METADATA_RECORD
from css_recording.errors import BagError
from css_recording.provenance import SEAL
from css_recording.recorded_types import Conversion, ConversionError, match_type
from css_recording.schemas import is_installed

CDR_LITTLE_ENDIAN = b"\x00\x01"
_ANY_TIME_NS = 1 << 64


class BagMessage(NamedTuple):
    """One recorded message."""

    topic: str  # absolute, after remapping
    type: str  # "css_msgs/msg/CssVoltages"
    stamp_ns: int  # log time; in Sunpoint's own recordings the stamp of the message's header
    data: bytes  # little-endian CDR with its four-byte header


class Refused(NamedTuple):
    """Messages of one topic that were passed over for one reason."""

    topic: str
    reason: str
    count: int  # type: ignore[assignment]  # the method of tuples that it hides is not missed
    first_ns: int  # log time of the first

    def __str__(self) -> str:
        messages = "1 message" if self.count == 1 else f"{self.count} messages, the first"
        return f"{self.topic}: {messages} at {self.first_ns} ns: {self.reason}"


class BagReader:
    """An open recording.

    Parameters
    ----------
    path: rosbag2 folder or `.mcap` file.
    remap: new names of topics, old name -> new name. Everything below uses the new names.

    refused: messages that were passed over while reading, because they cannot be messages of ROS 2.

    Raises `BagError` when there is no recording, when it is unfinished or damaged (the text names the command that
    recovers it), or when it holds no topic of ROS 2.
    """

    def __init__(self, path: str | Path, remap: Mapping[str, str] | None = None) -> None:
        self.path = Path(path)
        names = {absolute(old): absolute(new) for old, new in (remap or {}).items()}
        self._storage = open_storage(self.path)
        self._refused: dict[tuple[str, str], Refused] = {}
        self._conversions: dict[str, Conversion] = {}
        self._type_notes: dict[str, str] = {}  # of the topics whose types were compared
        everything = self._storage.topics()
        recorded = [entry for entry in everything if entry.topic.encoding == "cdr"]
        self._others = {
            entry.topic.name: f"{self.path}: topic {entry.topic.name} is encoded as '{entry.topic.encoding}'; "
            "only ROS 2 messages can be read"
            for entry in everything
            if entry.topic.encoding != "cdr"
        }
        self._new_names = {topic.name: names.get(topic.name, topic.name) for topic, _ in recorded}
        try:
            if self._others and not recorded:
                raise BagError(next(iter(self._others.values())))
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
    def notes(self) -> list[str]:
        """What must be known of the recording to trust what is read from it, one text each."""
        notes = [*self._storage.notes, *self._others.values()]
        recovery = self.description.get(RECOVERY_NOTE)
        if recovery and not any(recovery in note for note in notes):
            notes.append(f"it was recovered; lost or in doubt: {recovery}")
        return [*notes, *filter(None, self._type_notes.values())]

    @property
    def refused(self) -> list[Refused]:
        """Messages passed over so far by `messages`, by topic and reason."""
        return list(self._refused.values())

    def expect(self, types: Mapping[str, str]) -> None:
        """Compare recorded types with installed ones. What could not be compared or is converted joins the `notes`.

        types: topic (new name) to the full name of the installed type that is expected; topics that are not in the
            recording are passed over.

        `messages` does so too, with the types that the recording names. Raises `BagError` when a topic is of another
        type, or of a definition that does not convert field by field.
        """
        for topic in (entry.topic for entry in self._topics if entry.topic.name in types):
            match = match_type(topic, types[topic.name])
            self._type_notes[topic.name] = match.note
            if match.conversion is not None:
                self._conversions[topic.name] = match.conversion

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
                entries[name].update((key, value) for key, value in values.items() if key != SEAL)
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

        Messages of installed types come in the installed form: `BagError` when their recorded definition is another
        that does not convert field by field.
        """
        wanted = self._recorded_names(topics)
        start_ns = -_ANY_TIME_NS if start_ns is None else start_ns
        end_ns = _ANY_TIME_NS if end_ns is None else end_ns
        self._refused.clear()
        self.expect(self._not_compared(wanted))
        names, conversions, new = self._new_names, self._conversions, tuple.__new__
        for stamp_ns, topic, type_name, data in self._storage.messages(wanted, start_ns, end_ns):
            if data[:2] != CDR_LITTLE_ENDIAN or not 0 <= stamp_ns <= LAST_NS or len(data) < 4:
                self._refuse(names[topic], stamp_ns, _fault(stamp_ns, data))
                continue
            name = names[topic]
            if name in conversions:
                try:
                    data = conversions[name](data)
                except ConversionError as error:
                    self._refuse(name, stamp_ns, str(error))
                    continue
            yield new(BagMessage, (name, type_name, stamp_ns, data))  # half a million times an orbit

    def _not_compared(self, recorded_names: Collection[str]) -> dict[str, str]:
        """Topics whose types are installed and were not compared yet, and their types."""
        names = {self._new_names[name] for name in recorded_names} - self._type_notes.keys()
        topics = [entry.topic for entry in self._topics if entry.topic.name in names]
        return {topic.name: topic.type for topic in topics if is_installed(topic.type)}

    def _refuse(self, topic: str, stamp_ns: int, reason: str) -> None:
        before = self._refused.get((topic, reason), Refused(topic, reason, 0, stamp_ns))
        self._refused[topic, reason] = before._replace(count=before.count + 1)

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
            if min(unknown) in self._others:
                raise BagError(self._others[min(unknown)])
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


def _fault(stamp_ns: int, data: bytes) -> str:
    """Why a message cannot be one."""
    if not 0 <= stamp_ns <= LAST_NS:
        return "its log time is no time of ROS (63 bits, from 1970)"
    if len(data) < 4:
        return f"it has {len(data)} bytes, fewer than the head of a message"
    encoding = "big-endian" if data[:2] == b"\0\0" else f"encoded as {data[:2].hex()}"
    return f"it is {encoding}; only little-endian CDR can be read"
