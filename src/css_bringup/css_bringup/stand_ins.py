# SPDX-License-Identifier: Apache-2.0
"""What flies in the place of the compiled functions of nodes, by packages that this one does not know."""

import json
from collections.abc import Iterable, Mapping
from importlib.metadata import entry_points

from css_common.component import Component
from css_common.mission import Mission
from css_common.mission_file import MissionError
from css_common.schema import unknown_name
from css_recording.provenance import STAND_INS

_GROUP = "sunpoint.stand_ins"


def notes_of(components: Mapping[str, type[Component]]) -> dict[str, str]:
    """What a recording says of the components that stand in for those of nodes; nothing of none."""
    told = {name: getattr(component, "made_of", {}) for name, component in components.items()}
    return {STAND_INS: json.dumps(told)} if told else {}


def stand_ins(mission: Mission, asked: Iterable[str]) -> dict[str, type[Component]]:
    """Components by the names of the nodes that they stand in for.

    Args:
        mission: what flies.
        asked: NODE=FILE each.

    Raises:
        MissionError: there is no such node, no such file, or nothing that makes a component of it.
    """
    found: dict[str, type[Component]] = {}
    nodes = {node.name: node for node in mission.nodes}
    for text in asked:
        name, equals, file = text.partition("=")
        if not equals or not file:
            raise MissionError(f"--component: {text} given, expected NODE=FILE")
        if name not in nodes:
            raise MissionError(f"--component {text}: node {unknown_name(name, nodes)}")
        (make,) = [point.load() for point in entry_points(group=_GROUP, name="library")] or (None,)
        if make is None:
            raise MissionError(f"--component {text}: no installed package offers {_GROUP}, expected css_export")
        try:
            found[name] = make(nodes[name], file)
        except ValueError as error:
            raise MissionError(str(error)) from error
    return found
