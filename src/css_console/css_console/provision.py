# SPDX-License-Identifier: Apache-2.0
"""What only the console needs, fetched when it is first asked for: the web server and two JavaScript libraries.

Both are pinned: the server by the hashes of requirements-console.lock, each JavaScript package by the integrity of its
archive at the npm registry. They are kept, and after that nothing is fetched again.
"""

import base64
import fcntl
import hashlib
import importlib
import importlib.util
import io
import os
import shutil
import subprocess
import sys
import tarfile
import tempfile
import urllib.request
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from css_common import places
from css_console.errors import ConsoleError

_LOCK = "requirements-console.lock"
_SERVER = "aiohttp"
_REGISTRY = "https://registry.npmjs.org"
_REGISTRY_NAMES = ("npm_config_registry", "NPM_CONFIG_REGISTRY")  # as npm itself is told
_PATIENCE_S = 120.0
_LARGEST = 64 << 20  # bytes of an archive

Tell = Callable[[str], object]
"""Told in a line what takes long."""


class Library(NamedTuple):
    """A package of the npm registry.

    Attributes:
        name: at the registry.
        version: of it.
        integrity: sha512 of the archive, as package-lock.json has it.
        files: served name by path in the package.
    """

    name: str
    version: str
    integrity: str
    files: Mapping[str, str]

    @property
    def address(self) -> str:
        """Of the archive, at the registry of this machine."""
        registry = next((os.environ[name] for name in _REGISTRY_NAMES if os.environ.get(name)), _REGISTRY)
        return f"{registry.rstrip('/')}/{self.name}/-/{self.name}-{self.version}.tgz"


LIBRARIES = (
    Library(
        "three",
        "0.187.0",
        "sha512-Qiu7R+Cmh8CstZsY1uJOSWnVlfo7ZtNLV7mF8Jltk3LB3AtDu9cRZlcnRKkAk8Y4z6KKw35z7Y7Urd7jWY8etA==",
        {"build/three.module.js": "three.module.js", "build/three.core.js": "three.core.js"},
    ),
    Library(
        "uplot",
        "1.6.32",
        "sha512-KIMVnG68zvu5XXUbC4LQEPnhwOxBuLyW1AHtpm6IKTXImkbLgkMy+jabjLgSLMasNuGGzQm/ep3tOkyTxpiQIw==",
        {"dist/uPlot.esm.js": "uplot.js", "dist/uPlot.min.css": "uplot.css"},
    ),
)


def provide(tell: Tell) -> dict[str, Path]:
    """Makes sure that everything is there; the files of the JavaScript libraries by the name that they are served by.

    Raises:
        ConsoleError: something cannot be fetched or installed, or is not what is pinned.
    """
    folder = places.scratch("console")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with _alone(folder):
            _provide_server(tell)
            return {name: file for library in LIBRARIES for name, file in _files(library, folder, tell).items()}
    except OSError as error:
        raise ConsoleError(f"{folder}: cannot be written: {error.strerror}") from error


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Two consoles that are started together fetch one after the other."""
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def _provide_server(tell: Tell) -> None:
    importlib.invalidate_caches()
    if importlib.util.find_spec(_SERVER) is not None:
        return
    lock = places.home() / _LOCK
    uv = shutil.which("uv")
    command = f"uv pip install --require-hashes -r {lock}"
    if uv is None or not lock.is_file():
        raise ConsoleError(f"{_SERVER} is not installed; {command}")
    tell(f"installing the web server of the console (needed once): {_SERVER}")
    install = [uv, "pip", "install", "--quiet", "--python", sys.executable, "--require-hashes", "-r", str(lock)]
    done = subprocess.run(install, capture_output=True, text=True, check=False)
    importlib.invalidate_caches()
    if done.returncode or importlib.util.find_spec(_SERVER) is None:
        reason = (done.stderr.strip().splitlines() or ["it says nothing"])[-1]
        raise ConsoleError(f"{_SERVER} cannot be installed: {reason}; by hand: {command}")


def _files(library: Library, folder: Path, tell: Tell) -> dict[str, Path]:
    own = folder / f"{library.name}-{library.version}"
    files = {served: own / served for served in library.files.values()}
    if not all(file.is_file() for file in files.values()):
        tell(f"fetching {library.name} {library.version} (needed once): {library.address}")
        _unpack(library, fetched(library), own)
    return files


def fetched(library: Library) -> bytes:
    """The archive of a library.

    Raises:
        ConsoleError: it cannot be had, or is not the one that is pinned.
    """
    try:
        with urllib.request.urlopen(library.address, timeout=_PATIENCE_S) as answer:  # pinned by its hash
            archive = answer.read(_LARGEST)
    except (OSError, ValueError) as error:
        reason = getattr(error, "reason", error)
        raise ConsoleError(f"{library.address}: cannot be fetched: {reason}; it is needed once") from error
    found = "sha512-" + base64.b64encode(hashlib.sha512(archive).digest()).decode()
    if found != library.integrity:
        raise ConsoleError(f"{library.address}: has integrity {found}, expected {library.integrity}; nothing was kept")
    return archive


def _unpack(library: Library, archive: bytes, own: Path) -> None:
    """Keeps the files that are served, all or none."""
    fresh = Path(tempfile.mkdtemp(prefix=f"{own.name}.", dir=own.parent))
    try:
        with tarfile.open(fileobj=io.BytesIO(archive), mode="r:gz") as tar:
            for path, served in library.files.items():
                member = tar.extractfile(f"package/{path}")
                assert member is not None, path
                (fresh / served).write_bytes(member.read())
        shutil.rmtree(own, ignore_errors=True)
        fresh.rename(own)
    finally:
        shutil.rmtree(fresh, ignore_errors=True)
