# SPDX-License-Identifier: Apache-2.0
"""Missions that say only in what they differ from another one: `extends: NAME` in the section for all nodes.

The other mission is given by its name, looked for beside the file first, or by a path relative to it. It counts as if
it stood before the file: key by key the nearest file wins, a list is replaced as a whole. What is for all nodes in the
nearer file wins over what is for one node in the other. Sections of nodes that the nearer file takes from the graph are
left out, and `mission.name` is the file's own.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from css_common.mission_file import MissionError, flattened, read_sections, read_text
from css_common.mission_lookup import find_mission
from css_common.mission_section import name_for_files
from css_common.parameter_sections import Sections, is_for, is_shared, merged_files, shared_by_all
from css_common.schema import shown

EXTENDS = "extends"
"""Key that names the other mission."""

_NODES = "graph.nodes"
_NAME = "mission.name"


def sections_of_file(path: str | Path) -> dict[str, dict[str, Any]]:
    """Flat parameters of each section of a parameter file, on top of those of the mission that it extends.

    Raises:
        MissionError: this file or another one is missing or no parameter file, or they extend each other in a circle.
    """
    return _of_text(read_text(path), str(path), Path(path), ())


def sections_alone(path: str | Path) -> dict[str, dict[str, Any]]:
    """Flat parameters of each section of a parameter file, without those of a mission that it may extend.

    Raises:
        MissionError: the file is missing or no parameter file.
    """
    sections = {name: flattened(body) for name, body in read_sections(read_text(path), str(path)).items()}
    for parameters in sections.values():
        parameters.pop(EXTENDS, None)
    return sections


def sections_of_text(text: str, origin: str) -> dict[str, dict[str, Any]]:
    """The same for a text that is no file, which can extend missions by name.

    Raises:
        MissionError: as above, with `origin` in the place of the path.
    """
    return _of_text(text, origin, None, ())


def _of_text(text: str, origin: str, file: Path | None, nearer: tuple[Path, ...]) -> dict[str, dict[str, Any]]:
    sections = {name: flattened(body) for name, body in read_sections(text, origin).items()}
    named = [parameters.pop(EXTENDS) for name, parameters in sections.items() if _may_extend(name, parameters)]
    if not named:
        return sections
    if len(named) > 1 or not isinstance(named[0], str) or not named[0]:
        raise MissionError(f"{origin}: {EXTENDS}: {shown(named)} given, expected the name or path of one mission")
    other = _found(named[0], origin, file)
    chain = nearer if file is None else (*nearer, file.resolve())
    if other.resolve() in chain:
        way = " -> ".join(p.name for p in (*chain[chain.index(other.resolve()) :], other))
        raise MissionError(f"{origin}: {EXTENDS}: {way} is a circle")
    base = _of_text(read_text(other), str(other), other, chain)
    return _on_top(base, sections, "" if file is None else file.stem)


def _may_extend(section: str, parameters: Mapping[str, Any]) -> bool:
    return is_shared(section) and EXTENDS in parameters


def _found(name: str, origin: str, file: Path | None) -> Path:
    """File of the mission that `file` extends."""
    folder = Path() if file is None else file.parent
    is_path = "/" in name or name.endswith((".yaml", ".yml"))
    beside = folder / (name if is_path else f"{name}.yaml")
    if beside.is_file():
        return beside
    try:
        return find_mission(str(beside) if is_path else name)
    except MissionError as error:
        raise MissionError(f"{origin}: {EXTENDS}: {error}") from error


def _on_top(base: Sections, own: Sections, name: str) -> dict[str, dict[str, Any]]:
    for_all = shared_by_all(own)
    beneath = {
        section: parameters
        if is_shared(section)
        else {key: value for key, value in parameters.items() if key not in for_all}
        for section, parameters in base.items()
    }
    result = merged_files([beneath, own])
    if name and _NAME not in for_all:
        shared = next(section for section in result if is_shared(section))
        result[shared][_NAME] = name_for_files(name)
    gone = set(_nodes(shared_by_all(base))) - set(_nodes(shared_by_all(result)))
    return {
        section: parameters
        for section, parameters in result.items()
        if section in own or is_shared(section) or not any(is_for(section, node) for node in gone)
    }


def _nodes(shared: Mapping[str, Any]) -> list[str]:
    """Names of the nodes of a graph, as far as it has any."""
    entries = shared.get(_NODES, [])
    return [str(entry).replace(":", "/").rpartition("/")[2] for entry in entries] if isinstance(entries, list) else []
