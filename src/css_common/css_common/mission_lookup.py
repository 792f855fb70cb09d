# SPDX-License-Identifier: Apache-2.0
"""Where the file of a mission is."""

import os
from collections.abc import Iterator
from pathlib import Path

from css_common.mission_file import MissionError
from css_common.schema import shown, unknown_name

_LONGEST_SHOWN = 300


def mission_folders() -> Iterator[Path]:
    """Folders searched for missions by name."""
    home = os.environ.get("SUNPOINT_HOME")
    if home:
        yield Path(home) / "config"
    yield Path.cwd() / "config"
    for prefix in filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)):
        yield Path(prefix).parent.parent / "config"  # install/PACKAGE lies two levels below the workspace


def find_mission(name: str) -> Path:
    """File of a mission given by name or path.

    Raises:
        MissionError: there is no such file; names what was searched and what exists.
    """
    if name.endswith((".yaml", ".yml")) or os.sep in name:
        if not os.path.isfile(name):
            reason = "a mission is a regular file" if os.path.exists(name) else "no such mission file"
            raise MissionError(f"{name if len(name) <= _LONGEST_SHOWN else shown(name)}: {reason}")
        return Path(name)
    for folder in mission_folders():
        if os.path.isfile(folder / f"{name}.yaml"):  # False, too, for a name that no file can have
            return folder / f"{name}.yaml"
    known = known_missions()
    raise MissionError(f"mission {unknown_name(name, known)} (missions: {', '.join(known) or 'none'})")


def known_missions() -> list[str]:
    """Names by which missions are found, those of the nearest folder first."""
    return list(dict.fromkeys(path.stem for folder in mission_folders() for path in sorted(folder.glob("*.yaml"))))
