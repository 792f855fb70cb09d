# SPDX-License-Identifier: Apache-2.0
"""What there is to test, found by listing `nodes/` folders and `config/`: a new node or mission is tested with them."""

from functools import cache
from pathlib import Path
from typing import Any

from css_common.component import Component
from css_common.mission import Mission, MissionError, find_component, load_mission

ROOT = Path(__file__).parents[1]
MISSIONS = sorted(path.stem for path in (ROOT / "config").glob("*.yaml"))


def components(package: str = "*", base: type[Component] = Component) -> list[type[Component]]:
    """Components of all node files of one package or of all, of one base class."""
    found = []
    for file in sorted(ROOT.glob(f"src/{package}/*/nodes/[a-z]*.py")):
        if file.parents[1].name == file.parents[2].name:
            try:
                found.append(find_component(file.parents[1].name, file.stem))
            except MissionError:  # recorder and player are no components
                continue
    return [kind for kind in found if issubclass(kind, base)]


def executable(kind: type[Component]) -> str:
    """Name of the node file of a component."""
    return kind.__module__.rpartition(".")[2]


@cache
def _missions() -> list[Mission]:
    return [load_mission(name) for name in MISSIONS]


def mission_of(kind: type[Component]) -> Mission | None:
    """The first mission in whose graph a component flies."""
    flown = (mission for mission in _missions() if any(node.component is kind for node in mission.nodes))
    return next(flown, None)


def settings_of(kind: type[Component], *sections: str) -> dict[str, Any]:
    """Values of some sections as they are for a component in its mission, for `default_values`; none without one."""
    mission = mission_of(kind)
    if mission is None:
        return {}
    node = next(node for node in mission.nodes if node.component is kind)
    settings = {}
    for parameter in kind.table():
        section, _, rest = parameter.name.partition(".")
        if section in sections and rest:
            value: Any = node.values
            for part in parameter.name.split("."):
                value = getattr(value, part)
            settings[parameter.name.replace(".", "__")] = value.ravel().tolist() if parameter.is_array else value
    return settings


def with_every_flag(kind: type[Component]) -> dict[str, bool]:
    """All flags on: with them a component shows the topics that it has on request alone."""
    return {p.name.replace(".", "__"): True for p in kind.table() if p.kind == "flag"}


def controlled_by(name: str, base: type[Component]) -> bool:
    """Whether a component of a base class flies in a mission."""
    return any(issubclass(node.component, base) for node in load_mission(name).nodes)


def anywhere(base: type[Component]) -> list[str]:
    """Estimators of a base class that fly in the mission of O'Keefe & Schaub too: all but those for Clark's cells."""
    by_mission = estimators_by_mission(base)
    return sorted(name for mission, names in by_mission.items() if not mission.startswith("clark") for name in names)


def estimators_by_mission(base: type[Component]) -> dict[str, list[str]]:
    """Estimators of a base class by the mission that they fly in; those of none may fly in that of O'Keefe & Schaub."""
    by_mission: dict[str, list[str]] = {}
    for kind in components(base=base):
        mission = mission_of(kind) or load_mission("okeefe_2013")
        by_mission.setdefault(mission.name, []).append(executable(kind))
    return by_mission
