# SPDX-License-Identifier: Apache-2.0
"""The SQLite files of one recording, read as one through `rosbags`, with the write-ahead log of a killed recorder."""

import heapq
import shutil
import sqlite3
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, closing
from operator import itemgetter
from pathlib import Path
from typing import Any

import apsw
from rosbags.interfaces import MessageDefinitionFormat
from rosbags.rosbag2 import Reader, ReaderError

from css_recording.bag_metadata import QosProfile, Topic, absolute
from css_recording.bag_storage import StoredMessage, TopicCount
from css_recording.errors import BagError
from css_recording.schemas import MessageSchema, full_type_name

_ENCODINGS = {MessageDefinitionFormat.MSG: "ros2msg", MessageDefinitionFormat.IDL: "ros2idl"}
_ERRORS = (ReaderError, OSError, ValueError, TypeError, KeyError, apsw.Error, sqlite3.Error, AssertionError)
_LOG_FRAME_HEAD = 24
_LOG_HEAD = 32
_NO_CHECK_SUM = "an sqlite3 recording holds no check sums: damage to the messages in it cannot be seen"


class SqliteStorage:
    """The SQLite files of one recording."""

    def __init__(
        self, bag: Path, paths: Sequence[Path], hashes: Mapping[str, str], notes: list[str], cleanup: ExitStack
    ) -> None:
        """Opens the files; `BagError` when one is damaged. Arguments as those of `McapStorage`."""
        self.notes = notes
        self._bag = bag
        self._cleanup = cleanup
        self._hashes = hashes
        self._readers: list[Reader] = []
        for path in paths:
            try:
                self._readers.append(cleanup.enter_context(Reader(self._whole(path))))
            except _ERRORS as error:
                raise BagError(f"{path}: cannot be read as an SQLite recording: {error}") from error
        self._topics = self._find_topics()
        self.notes.append(_NO_CHECK_SUM)

    def topics(self) -> list[TopicCount]:
        """Topics in the order of the recording."""
        return list(self._topics.values())

    def time_span(self) -> tuple[int, int]:
        """Log times [ns] of the earliest and the latest message; zeros when there is none."""
        spans = [(r.start_time, r.end_time - 1) for r in self._readers if r.message_count]
        return (min(start for start, _ in spans), max(end for _, end in spans)) if spans else (0, 0)

    def metadata(self) -> list[tuple[str, dict[str, str]]]:
        """No texts: this storage has no place for them."""
        return []

    def messages(self, topics: frozenset[str], start_ns: int, end_ns: int) -> Iterator[StoredMessage]:
        """Messages of these topics with log times in [start_ns, end_ns), in log-time order."""
        parts = [self._messages_of(reader, topics, start_ns, end_ns) for reader in self._readers]
        return heapq.merge(*parts, key=itemgetter(0)) if len(parts) > 1 else parts[0]

    def close(self) -> None:
        """Release the files."""
        self._cleanup.close()

    def _messages_of(
        self, reader: Reader, topics: frozenset[str], start_ns: int, end_ns: int
    ) -> Iterator[StoredMessage]:
        names = {c.id: (absolute(c.topic), full_type_name(c.msgtype)) for c in reader.connections}
        connections = [c for c in reader.connections if names[c.id][0] in topics]
        if not connections:
            return
        try:
            for connection, log_time, data in reader.messages(connections, max(start_ns, -(1 << 63)), None):
                if log_time >= end_ns:
                    return
                if not isinstance(data, bytes):  # a row whose kind of value was changed by damage
                    raise BagError(f"{self._bag}: a message on {connection.topic} is not stored as bytes")
                yield log_time, *names[connection.id], data
        except _ERRORS as error:
            raise BagError(f"{self._bag}: is damaged: {error}") from error

    def _find_topics(self) -> dict[str, TopicCount]:
        topics: dict[str, TopicCount] = {}
        for connection in (c for reader in self._readers for c in reader.connections):
            topic = self._topic_of(connection)
            before = topics.get(topic.name, TopicCount(topic, 0))
            if before.topic.type != topic.type:
                raise BagError(f"{self._bag}: topic {topic.name} has two types")
            topics[topic.name] = before._replace(count=before.count + connection.msgcount)
        return topics

    def _topic_of(self, connection: Any) -> Topic:
        name, type_name = absolute(connection.topic), full_type_name(connection.msgtype)
        encoding = _ENCODINGS.get(connection.msgdef.format, "")
        type_hash = connection.digest or self._hashes.get(name, "")
        schema = MessageSchema(type_name, connection.msgdef.data, type_hash, encoding)
        qos = tuple(
            QosProfile(q.reliability.name.lower(), q.durability.name.lower(), q.history.name.lower(), q.depth)
            for q in connection.ext.offered_qos_profiles
        )
        return Topic(name, type_name, qos, schema, connection.ext.serialization_format)

    def _whole(self, path: Path) -> Path:
        """The file itself or, when a recorder left changes beside it, a copy into which they were merged."""
        log, journal = (path.with_name(path.name + suffix) for suffix in ("-wal", "-journal"))
        beside = [side for side in (log, journal) if side.is_file() and side.stat().st_size]
        if beside:
            folder = Path(self._cleanup.enter_context(tempfile.TemporaryDirectory(prefix="sunpoint_bag_")))
            for file in (path, *beside):
                shutil.copyfile(file, folder / file.name)
            path = folder / path.name
            self._merge(path, log if log in beside else None)
        with closing(sqlite3.connect(f"{path.absolute().as_uri()}?immutable=1", uri=True)) as database:
            (verdict,) = database.execute("PRAGMA quick_check(1)").fetchone()
        if verdict != "ok":
            raise ValueError(f"it is damaged: {verdict.splitlines()[-1]}")
        return path

    def _merge(self, path: Path, log: Path | None) -> None:
        """Let SQLite apply what stands beside a file, and tell what it left out."""
        expected = _frames_of(log) if log else 0
        with closing(sqlite3.connect(path)) as database:
            database.execute("SELECT count(*) FROM sqlite_master").fetchone()  # rolls a journal back
            _, merged, _ = database.execute("PRAGMA wal_checkpoint(FULL)").fetchone()
            database.execute("PRAGMA journal_mode=DELETE").fetchone()
        if log is None:
            self.notes.append(f"{path.name}: a change that its recorder had begun was taken back")
        elif max(merged, 0) < expected:
            self.notes.append(f"{log.name}: {expected - max(merged, 0)} of {expected} pages are torn and left out")
        else:
            self.notes.append(f"{log.name}: {merged} pages that its recorder had not merged were read too")


def _frames_of(log: Path) -> int:
    """Pages in a write-ahead log that belong to its present run: those with the salt of its head."""
    data = log.read_bytes()
    page_size, salt = int.from_bytes(data[8:12], "big"), data[16:24]
    step = _LOG_FRAME_HEAD + page_size
    if len(data) < _LOG_HEAD or not 512 <= page_size <= 65536:
        return max(1, len(data) // 4096)
    starts = range(_LOG_HEAD, len(data) - step + 1, step)
    return max(1, sum(data[at + 8 : at + 16] == salt for at in starts))
