# SPDX-License-Identifier: Apache-2.0
"""From an entry of `graph.nodes` to the component of a node file. Nothing but node files is ever imported."""

import importlib
import importlib.util
import re
from pathlib import Path

from css_common.component import Component
from css_common.mission_file import MissionError
from css_common.schema import nearest, shown

_KEY = "/**: graph.nodes"
_LONGEST_NAME = 100  # [characters] it becomes part of topic names, which ROS limits, and of file names


def parse_node_entry(entry: str, origin: str) -> tuple[str, str, str]:
    """Package, executable and name of `PACKAGE/EXECUTABLE[:NAME]`.

    Raises:
        MissionError: the entry has another form.
    """
    form = re.fullmatch(r"([A-Za-z]\w*)/([A-Za-z]\w*)(?::([A-Za-z]\w*))?", entry, re.ASCII)
    if form is None:
        raise MissionError(f"{origin}: {_KEY}: {shown(entry)} given, expected PACKAGE/EXECUTABLE[:NAME]")
    package, executable, name = form.groups()
    if len(name or executable) > _LONGEST_NAME:
        raise MissionError(f"{origin}: {_KEY}: {shown(entry)} given, expected at most {_LONGEST_NAME} letters")
    return package, executable, name or executable


def find_component(package: str, executable: str, origin: str = "mission") -> type[Component]:
    """The component that a node file defines.

    Raises:
        MissionError: there is no such node file, or it defines no component.
    """
    module_name = f"{package}.nodes.{executable}"
    files = _node_files(package)
    if executable not in files:
        near = nearest(executable, files)
        raise MissionError(
            f"{origin}: {_KEY}: {package}/{executable}: there is no {module_name.replace('.', '/')}.py "
            "in this workspace" + (f"; did you mean {package}/{near}?" if near else "")
        )
    module = importlib.import_module(module_name)
    for item in vars(module).values():
        if isinstance(item, type) and issubclass(item, Component) and item.__module__ == module_name:
            return item
    raise MissionError(f"{origin}: {_KEY}: {module_name} defines no component")


def _node_files(package: str) -> list[str]:
    """Names of PACKAGE/nodes/*.py; asked of the disk, for an import would run what it finds."""
    try:
        spec = importlib.util.find_spec(package)
    except ValueError:  # `__main__` and its like have no place
        return []
    places = (spec.submodule_search_locations if spec is not None else None) or ()
    return [file.stem for place in places for file in sorted((Path(place) / "nodes").glob("*.py"))]
