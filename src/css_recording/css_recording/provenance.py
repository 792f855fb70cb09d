# SPDX-License-Identifier: Apache-2.0
"""What software made a recording: the entries beside the mission in its record `sunpoint`."""

import hashlib
import json
import platform
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from css_common import places

_LIBRARIES = ("css_recording", "css_sim", "css_estimation", "sunpoint_control", "numpy", "numba", "mcap")
_LOCK_FILE = "requirements.lock"
IMPORTED_FROM = "imported_from"
"""Entry of a recording that was made of a table of telemetry: JSON with its file, hash and known parts of the truth."""

INCIDENTS = "incidents"
"""Entry with what was not as it should be in a flight, a line each; `NOTHING`: nothing was."""
REPLAY_INCIDENTS = "replay_incidents"
"""The same of the replay that made a recording."""
NOTHING = "none"

STAND_INS = "stand_ins"
"""Entry of a flight in which a library took the place of compiled functions: JSON with its file and hash by node."""

SEAL = "sha256"
"""Entry that holds the check sums of those beside it."""


def software_versions() -> dict[str, str]:
    """Versions of Python and of what computes the flight, hash of the lock file, processor.

    With the same of all of these a replayed estimator gives the bytes that flew.
    """
    entries = {"python": platform.python_version(), "cpu": _processor()}
    for name in _LIBRARIES:
        try:
            entries[name] = version(name)
        except PackageNotFoundError:
            continue
    lock = places.home() / _LOCK_FILE
    if lock.is_file():
        entries["lock_sha256"] = hashlib.sha256(lock.read_bytes()).hexdigest()
    return entries


def sealed(entries: Mapping[str, str]) -> dict[str, str]:
    """Entries of a record with the check sum (SHA-256) of each beside them."""
    entries = {key: value for key, value in entries.items() if key != SEAL}
    return entries | {SEAL: json.dumps({key: _digest(value) for key, value in entries.items()})}


def broken_entries(entries: Mapping[str, str]) -> list[str]:
    """Names of the entries that are not as they were sealed, or are missing; none when nothing was sealed."""
    if SEAL not in entries:
        return []
    try:
        stated = dict(json.loads(entries[SEAL]))
    except (ValueError, TypeError, RecursionError):
        return [SEAL]
    found = {key: _digest(value) for key, value in entries.items() if key != SEAL}
    return sorted(str(key) for key in stated.keys() | found.keys() if stated.get(key) != found.get(key))


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def _processor() -> str:
    """Name of the processor model as Linux tells it, else the architecture."""
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            key, _, value = line.partition(":")
            if key.strip() == "model name":
                return value.strip()
    except OSError:
        pass
    return platform.machine()
