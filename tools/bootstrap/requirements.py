# SPDX-License-Identifier: Apache-2.0
"""Reads the lock file as far as needed to leave out what a sourced ROS installation brings itself."""

from __future__ import annotations

import re

FROM_SYSTEM = re.compile(r"ros-.*|numpy|empy|lark-parser|catkin-pkg")
FROM_SYSTEM_COLCON = re.compile(r"colcon-.*")


def blocks(lock: str) -> list[tuple[str, str]]:
    """The requirements of a lock file as (name, text with its hashes)."""
    found: list[tuple[str, list[str]]] = []
    for line in lock.splitlines():
        start = re.match(r"([A-Za-z0-9][\w.-]*)==", line)
        if start:
            found.append((start[1].lower(), []))
        if found and not line.startswith("#"):
            found[-1][1].append(line)
    return [(name, "\n".join(lines)) for name, lines in found]


def for_system(lock: str, has_colcon: bool) -> str:
    """The lock file without ROS, what ROS is built against, and colcon where the system has it."""
    return "\n".join(
        text
        for name, text in blocks(lock)
        if not FROM_SYSTEM.fullmatch(name) and not (has_colcon and FROM_SYSTEM_COLCON.fullmatch(name))
    )
