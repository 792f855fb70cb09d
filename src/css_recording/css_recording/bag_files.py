# SPDX-License-Identifier: Apache-2.0
"""Which files make up a recording, brought into a form in which they can be read, and opened."""

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import zstandard

from css_recording.bag_metadata import METADATA_FILE, METADATA_VERSION, read_metadata, recorded_hashes, recovery_note
from css_recording.bag_storage import BagStorage, StoredMessage, TopicCount, unfinished
from css_recording.errors import BagError
from css_recording.mcap_chunk import MAX_CHUNK_BYTES
from css_recording.mcap_storage import McapStorage
from css_recording.sqlite_storage import SqliteStorage

_SUFFIXES = (".mcap", ".db3")
_MOST_EXPANSION = 1000  # real messages shrink to a twentieth at best
_COPY_BYTES = 1 << 20


def open_storage(path: Path) -> BagStorage:
    """Open a rosbag2 folder or a file; `BagError` when it is none, unfinished or damaged."""
    if not path.exists():
        raise BagError(f"{path}: there is no such recording")
    cleanup = ExitStack()
    try:
        return _open_file(path, cleanup) if path.is_file() else _open_folder(path, cleanup)
    except BaseException:
        cleanup.close()
        raise


def _open_file(path: Path, cleanup: ExitStack) -> BagStorage:
    if path.suffix not in _SUFFIXES:
        raise BagError(f"{path}: is not a recording: expected a folder, an .mcap or a .db3 file")
    return open_files(path, [path], {}, [], cleanup)


def _open_folder(path: Path, cleanup: ExitStack) -> BagStorage:
    information = read_metadata(path)
    if information is None:
        if any(bag_files(path)):
            raise unfinished(path, f"it has no readable {METADATA_FILE}")
        raise BagError(f"{path}: is not a recording: it has neither {METADATA_FILE} nor an .mcap or .db3 file")
    kind = information["storage_identifier"]
    if kind not in ("mcap", "sqlite3"):
        raise BagError(f"{path}: its storage '{kind}' is not known; mcap and sqlite3 can be read")
    notes: list[str] = []
    files = [path / name for name in named_files(information)]
    missing = [file.name for file in files if not file.is_file()]
    if missing:
        raise unfinished(path, f"{METADATA_FILE} names {missing[0]}, which is not there")
    mode = str(information.get("compression_mode") or "").lower()
    if mode == "file":
        folder = Path(cleanup.enter_context(tempfile.TemporaryDirectory(prefix="sunpoint_bag_")))
        files = [_expanded(file, folder) for file in files]
    others = [file.name for file in bag_files(path) if file.name not in named_files(information)]
    if others and mode != "file":
        notes.append(f"{METADATA_FILE} does not name {', '.join(others)}: left out")
    storage = open_files(path, files, recorded_hashes(information), notes, cleanup)
    storage.notes += doubts(information, storage.topics())
    if recovery_note(information):
        storage.notes.append(f"it was recovered, without {recovery_note(information)}")
    return _CompressedMessages(storage) if mode == "message" else storage


def open_files(
    bag: Path, files: Sequence[Path], hashes: Mapping[str, str], notes: list[str], cleanup: ExitStack
) -> BagStorage:
    """Open files of one kind as one recording; arguments as those of `McapStorage`."""
    kind = SqliteStorage if files[0].suffix == ".db3" else McapStorage
    return kind(bag, files, hashes, notes, cleanup)


def bag_files(folder: Path) -> list[Path]:
    """The files of recordings in a folder, bag_2 before bag_10."""
    files = [file for file in folder.iterdir() if file.suffix in _SUFFIXES and file.is_file()]
    return sorted(files, key=lambda file: (len(file.name), file.name))


def named_files(information: Mapping[str, Any]) -> list[str]:
    """Names of the files that `metadata.yaml` gives, each once; older ones are given with their folder."""
    return list(dict.fromkeys(Path(name).name for name in information["relative_file_paths"]))


def doubts(information: Mapping[str, Any], topics: list[TopicCount]) -> list[str]:
    """What `metadata.yaml` says otherwise than the files, one text each."""
    found = []
    total = sum(entry.count for entry in topics)
    if information.get("message_count", total) != total:
        found.append(f"{METADATA_FILE} speaks of {information['message_count']} messages, the files hold {total}")
    version = information.get("version")
    if not isinstance(version, int) or not 1 <= version <= METADATA_VERSION:
        found.append(f"{METADATA_FILE} is of version {version}; known are 1 to {METADATA_VERSION}")
    if len(named_files(information)) != len(information["relative_file_paths"]):
        found.append(f"{METADATA_FILE} names a file twice; it is read once")
    return found


def _expanded(file: Path, folder: Path) -> Path:
    """A file that is compressed as a whole, expanded into another folder."""
    target = folder / file.stem
    left = max(MAX_CHUNK_BYTES, _MOST_EXPANSION * file.stat().st_size)
    try:
        with file.open("rb") as packed, target.open("wb") as out:
            reader = zstandard.ZstdDecompressor().stream_reader(packed, read_across_frames=True)
            while block := reader.read(_COPY_BYTES):
                left -= len(block)
                if left < 0:
                    raise BagError(f"{file}: expands to more than {_MOST_EXPANSION} times its size; not read")
                out.write(block)
    except (zstandard.ZstdError, OSError) as error:
        raise BagError(f"{file}: cannot be expanded: {error}") from error
    return target


class _CompressedMessages:
    """A storage whose messages are compressed one by one."""

    def __init__(self, storage: BagStorage) -> None:
        self._storage = storage
        self.notes = storage.notes
        self.topics, self.time_span = storage.topics, storage.time_span
        self.metadata, self.close = storage.metadata, storage.close

    def messages(self, topics: frozenset[str], start_ns: int, end_ns: int) -> Iterator[StoredMessage]:
        """As `BagStorage.messages`; a message that does not expand stays as it is, and is found to be none."""
        for log_time, topic, type_name, data in self._storage.messages(topics, start_ns, end_ns):
            yield log_time, topic, type_name, _expanded_message(data)


def _expanded_message(data: bytes) -> bytes:
    try:
        stated = zstandard.get_frame_parameters(data).content_size
        if stated > MAX_CHUNK_BYTES and stated != (1 << 64) - 1:
            return data
        return zstandard.decompress(data, max_output_size=MAX_CHUNK_BYTES)
    except zstandard.ZstdError:
        return data
