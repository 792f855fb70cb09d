# SPDX-License-Identifier: Apache-2.0
"""A mission whose commands come from a board: the bridge stands in the place of the control."""

from collections.abc import Mapping

from css_common.mission import SHARED, Mission
from css_common.mission_file import MissionError
from css_common.parameter_sections import is_for, is_shared, with_shared

BRIDGE = ("css_drivers", "hil_bridge", "hil_bridge")
"""Package, executable and name of the node that speaks with the board."""
COMMANDS = frozenset(("wheels/torque_command", "rods/dipole_command"))


def with_board(mission: Mission, changes: Mapping[str, str]) -> tuple[Mission, list[str]]:
    """A mission without the nodes that command actuators, with the bridge, in real time.

    Args:
        mission: what would fly without a board; its estimators fly along.
        changes: parameters of the bridge, as texts.

    Returns:
        the mission, and the names of the nodes whose place the board takes.

    Raises:
        MissionError: no node of the mission commands anything, or what is left is no mission.
    """
    replaced = [node.name for node in mission.nodes if COMMANDS & {output.topic for output in node.outputs}]
    if not replaced:
        raise MissionError(
            f"{mission.origin}: {SHARED}: graph.nodes: no node commands wheels or rods, whose place a board could take"
        )
    kept = [node for node in mission.nodes if node.name not in replaced]
    entries = [f"{node.package}/{node.executable}:{node.name}" for node in kept]
    sections = with_shared(mission.parameters, "graph.nodes", entries)
    sections = with_shared(sections, "lockstep.realtime_factor", 1.0)

    def is_used(section: str) -> bool:
        names = [node.name for node in kept]
        return is_shared(section, mission.namespace) or any(is_for(section, n, mission.namespace) for n in names)

    left = {name: dict(values) for name, values in sections.items() if is_used(name)}
    return Mission(mission.origin, left, mission.namespace).with_node(BRIDGE, changes), replaced
