# SPDX-License-Identifier: Apache-2.0
"""Where files go: into the project folder when one may write there, else to places of the user's own.

Standard library only, for the start of `./sunpoint` reads it too.
"""

import os
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path

HOME = "SUNPOINT_HOME"
SECTIONS_INDEX = "share/ament_index/resource_index/sunpoint_sections"
"""Where a package that brings sections of missions leaves a mark, below the folder that it is installed in."""


def home() -> Path:
    """The project folder; the current one for commands that were not started by `./sunpoint`."""
    return Path(os.environ.get(HOME) or ".")


def results(kind: str) -> Path:
    """Folder of results, e.g. `bags`: in the project, or in the current folder when the project is another user's."""
    folder = home() / kind
    return folder if may_write(folder) else Path(kind)


def logs(environ: Mapping[str, str] = os.environ) -> Path:
    """Folder of logs: in the project, or with what can be made again when the project is another user's."""
    folder = Path(environ.get(HOME) or ".", "log")
    return folder if may_write(folder) else scratch("log", environ)


def scratch(name: str, environ: Mapping[str, str] = os.environ) -> Path:
    """Folder of what can be made again, e.g. compiled code: in the project, the user's cache, or a temporary folder.

    Args:
        name: of the folder below it.
        environ: where the project and the user's folders are named.

    Raises:
        OSError: nothing can be written anywhere.
    """
    for folder in _scratch_folders(environ):
        if may_write(folder):
            return folder / name
    # predictable names in a folder of all users: only one that is really ours is taken
    own = Path(tempfile.gettempdir(), f"sunpoint-{os.getuid()}")
    own.mkdir(mode=0o700, exist_ok=True)
    found = own.lstat()
    if found.st_uid != os.getuid() or found.st_mode & 0o022:
        raise PermissionError(f"{own} is writable by others, expected a folder of one's own")
    return own / name


def _scratch_folders(environ: Mapping[str, str]) -> Iterator[Path]:
    if environ.get(HOME):
        yield Path(environ[HOME], ".cache")
    if environ.get("XDG_CACHE_HOME"):
        yield Path(environ["XDG_CACHE_HOME"], "sunpoint")
    elif environ.get("HOME"):
        yield Path(environ["HOME"], ".cache", "sunpoint")


def may_write(folder: Path) -> bool:
    """Whether one may write into a folder, or make it."""
    place = folder.absolute()
    while not place.exists() and place != place.parent:
        place = place.parent
    return place.is_dir() and os.access(place, os.W_OK | os.X_OK)
