# SPDX-License-Identifier: Apache-2.0
"""The folder of a recording on disk: making it, replacing it, and writing into it so that it lasts."""

import fcntl
import os
import sys
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import IO

from css_common import places
from css_recording.bag_metadata import METADATA_FILE
from css_recording.errors import BagError


def fresh_folder(name: str) -> Path:
    """A folder `bags/NAME_TIME` that does not exist yet, in the project when there is one."""
    return free_name(places.results("bags") / f"{name}_{datetime.now(UTC):%Y%m%d_%H%M%S}")


def free_name(base: Path) -> Path:
    """This path, or the same with a number where something has that name."""
    folder, number = base, 1
    while folder.exists():
        number += 1
        folder = base.with_name(f"{base.name}_{number}")
    return folder


def prepare_folder(folder: Path, overwrite: bool) -> None:
    """Make the folder; refuse one that holds something, unless it is a recording that may be replaced."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        contents = sorted(folder.iterdir())
        if not contents:
            return
        if not overwrite:
            raise BagError(f"{folder}: already exists and is not empty; choose another name, or --overwrite it")
        foreign = [path.name for path in contents if not _belongs_to_bag(path)]
        if foreign:
            raise BagError(f"{folder}: holds {foreign[0]}, which is no part of a recording; not overwritten")
        # The metadata go first: what is left after an interruption does not look finished.
        for path in sorted(contents, key=lambda path: path.name != METADATA_FILE):
            path.unlink()
    except OSError as error:
        raise BagError(
            f"{folder}: cannot create the recording: {error.strerror}; choose a folder in which you may write"
        ) from error


def create_file(path: Path) -> IO[bytes]:
    """Open a new file for writing and reading, locked; one that exists, perhaps another recorder's, is refused."""
    try:
        file = path.open("x+b")
    except OSError as error:
        raise BagError(f"{path}: cannot create the recording: {error.strerror}") from error
    with suppress(OSError):  # not every file system knows locks
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    return file


def is_being_written(path: Path) -> bool:
    """Whether a recorder that is alive holds the file."""
    with path.open("rb") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
        except OSError:
            return False
    return False


def place_of(descriptor: int) -> Path | None:
    """Where an open file is now, however it was renamed; None when it was deleted."""
    if os.fstat(descriptor).st_nlink == 0:
        return None
    if sys.platform == "darwin":
        return Path(os.fsdecode(fcntl.fcntl(descriptor, fcntl.F_GETPATH, bytes(1024)).rstrip(b"\0")))
    return Path(os.readlink(f"/proc/self/fd/{descriptor}"))


def is_in_place(descriptor: int, path: Path) -> bool:
    """Whether an open file is still what is found under its name."""
    try:
        return os.path.samestat(os.fstat(descriptor), path.stat())
    except OSError:
        return False


def write_atomically(path: Path, text: str) -> None:
    """Write a text file so that, whatever happens, it has its old contents or the new ones."""
    temporary = _temporary(path)
    with temporary.open("w", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())
    temporary.replace(path)
    sync_folder(path.parent)


def sync_folder(folder: Path) -> None:
    """Make a rename or a new name in the folder outlast a power failure."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _temporary(path: Path) -> Path:
    return path.with_name(f".{path.name}.new")


def _belongs_to_bag(path: Path) -> bool:
    own_names = (METADATA_FILE, _temporary(Path(METADATA_FILE)).name)
    return path.is_file() and (path.name in own_names or path.suffix in (".mcap", ".db3"))
