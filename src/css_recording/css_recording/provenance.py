# SPDX-License-Identifier: Apache-2.0
"""What software made a recording: the entries beside the mission in its record `sunpoint`."""

import hashlib
import os
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

_LIBRARIES = ("css_recording", "css_sim", "css_estimation", "sunpoint_control", "numpy", "numba", "mcap")
_LOCK_FILE = "requirements.lock"


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
    lock = Path(os.environ.get("SUNPOINT_HOME", "."), _LOCK_FILE)
    if lock.is_file():
        entries["lock_sha256"] = hashlib.sha256(lock.read_bytes()).hexdigest()
    return entries


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
