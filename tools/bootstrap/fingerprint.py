# SPDX-License-Identifier: Apache-2.0
"""Decides what has to be installed or built again, from the content of the files it is made from."""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Iterable
from pathlib import Path

from bootstrap.environment import NONE
from bootstrap.project import Project

LAYOUT = 1
"""Raised when an environment installed by an older bootstrap has to be installed again."""

BUILD_FILES = ("package.xml", "setup.py", "setup.cfg", "CMakeLists.txt")
INTERFACE_FOLDERS = ("msg", "srv", "action")
LISTED_FOLDERS = ("launch", "config", "resource", "data")
EXECUTABLE_FOLDERS = ("nodes", "commands")


INTEL_MAC = "Darwin x86_64"


def lock_file(project: Project, ros: str) -> Path:
    """What is to be installed: everything, or what is left of it where there is no ROS."""
    if ros != NONE:
        return project.root / "requirements.lock"
    own = "-intel-mac" if project.machine == INTEL_MAC else ""
    return project.root / f"requirements-analysis{own}.lock"


def _digest(parts: Iterable[str | bytes]) -> str:
    total = hashlib.blake2b(digest_size=16)
    for part in parts:
        data = part.encode() if isinstance(part, str) else part
        total.update(b"%d:" % len(data))
        total.update(data)
    return total.hexdigest()


def _read(file: Path) -> bytes:
    try:
        return file.read_bytes()
    except FileNotFoundError:
        return b""


def _names(folder: Path) -> list[str]:
    try:
        entries = os.listdir(folder)
    except (FileNotFoundError, NotADirectoryError):
        return []
    return sorted(name for name in entries if not name.startswith(("__pycache__", ".")))


def installation(project: Project, ros: str) -> str:
    """Fingerprint of the environment: lock files, Python, kind of ROS, and the folder it lies in.

    The folder counts because installed scripts carry the absolute path of their Python.
    """
    root = project.root
    locks = (_read(root / "requirements-uv.lock"), _read(lock_file(project, ros)))
    others = _names(common_interfaces(project)) if ros == NONE else []
    return _digest([str(LAYOUT), str(sys.implementation.cache_tag), ros, str(root), *locks, *others])


def test_requirements(project: Project) -> str:
    """Fingerprint of what `./sunpoint test` installs in addition."""
    return _digest([_read(project.root / "requirements-test.lock")])


def extra_requirements(project: Project, name: str) -> str:
    """Fingerprint of what a verb with an extra installs in addition."""
    return _digest([_read(project.root / f"requirements-{name}.lock")])


def package(folder: Path) -> str:
    """Fingerprint of what a package's build reads.

    Python modules are installed as links, so their content does not count; the names in `nodes/` and
    `commands/` do, because executables are made from them.
    """
    parts: list[str | bytes] = [_read(folder / name) for name in BUILD_FILES]
    for name in INTERFACE_FOLDERS:
        for file in _names(folder / name):
            parts += [file, _read(folder / name / file)]
    listed = [folder / name for name in LISTED_FOLDERS]
    listed += [folder / folder.name / name for name in (*EXECUTABLE_FOLDERS, *LISTED_FOLDERS)]
    for place in listed:
        parts += [str(place.relative_to(folder)), *_names(place)]
    return _digest(parts)


def packages(project: Project) -> dict[str, str]:
    """Fingerprints of all packages under `src/`."""
    return {
        name: package(project.source / name)
        for name in _names(project.source)
        if (project.source / name / "package.xml").is_file()
    }


def common_interfaces(project: Project) -> Path:
    """Copies of ROS's own `.msg` files, a folder for each package, for where there is no ROS."""
    return project.source / "css_msgs" / "common_interfaces"


def has_interfaces(folder: Path) -> bool:
    """Whether a package defines messages, services or actions, which others are built against."""
    return any((folder / name).is_dir() for name in INTERFACE_FOLDERS)
