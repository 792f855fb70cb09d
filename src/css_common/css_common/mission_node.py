# SPDX-License-Identifier: Apache-2.0
"""A node of the graph as a mission describes it, and whether the nodes of a graph fit together."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from css_common.codec import type_name
from css_common.component import Component, Input, Output, Plant
from css_common.fault_lines import Host
from css_common.link_kinds import KINDS as LINK_KINDS
from css_common.mission_file import MissionError
from css_common.parameter_sections import SHARED
from css_common.schema import Values, unknown_name


@dataclass(frozen=True)
class Node:
    """A node of the graph as the mission describes it."""

    name: str
    package: str
    executable: str
    component: type[Component]
    canonical: Mapping[str, Any]
    values: Values

    @property
    def inputs(self) -> tuple[Input, ...]:
        """Topics it listens to."""
        return self.component.inputs(self.name, self.values)

    @property
    def outputs(self) -> tuple[Output, ...]:
        """Topics it publishes."""
        return self.component.all_outputs(self.name, self.values)

    @property
    def host(self) -> Host:
        """What may fail of it."""
        kind, values = self.component, self.values
        own = kind.fault_units(values) if kind.fault_kinds else {}
        return Host((*kind.fault_kinds, *LINK_KINDS), {**own, **kind.link_units(self.name, values)})


def check_wiring(nodes: Sequence[Node], wait_for: Iterable[str], origin: str) -> None:
    """Looks whether every topic that a node needs is published as it expects it, by one node alone.

    Args:
        nodes: of the graph.
        wait_for: topics that the plant is told to wait for.
        origin: of the mission, for messages.

    Raises:
        MissionError: naming nodes, topic and what was expected.
    """
    publishers: dict[str, tuple[str, Output]] = {}
    for node in nodes:
        for output in node.outputs:
            if output.topic in publishers:
                raise MissionError(
                    f"{origin}: {node.name} and {publishers[output.topic][0]} both publish {output.topic}"
                )
            publishers[output.topic] = node.name, output
    # without a plant nothing is simulated: devices publish what the nodes need
    is_simulated = any(issubclass(node.component, Plant) for node in nodes)
    for node in nodes:
        for entry in node.inputs:
            if entry.topic in publishers:
                _check_connection(node, entry, *publishers[entry.topic], origin)
            elif entry.required and is_simulated:
                raise MissionError(
                    f"{origin}: {node.name} needs the topic {unknown_name(entry.topic, publishers)}; "
                    "no node of graph.nodes publishes it"
                )
    _check_awaited(wait_for, publishers, f"{origin}: {SHARED}")


def _check_awaited(wait_for: Iterable[str], publishers: Mapping[str, tuple[str, Output]], where: str) -> None:
    for topic in wait_for:
        if topic not in publishers:
            raise MissionError(f"{where}: lockstep.wait_for: {unknown_name(topic, publishers)}")
        name, output = publishers[topic]
        if output.events:
            raise MissionError(f"{where}: lockstep.wait_for: {name} publishes {topic} only when something happens")


def _check_connection(node: Node, entry: Input, publisher: str, output: Output, origin: str) -> None:
    if entry.message_type is not output.message_type:
        raise MissionError(
            f"{origin}: {node.name} takes {entry.topic} as {type_name(entry.message_type)}, "
            f"{publisher} publishes {type_name(output.message_type)}"
        )
    if node.values.io.input_matching == "exact" and output.events:
        raise MissionError(
            f"{origin}: {node.name} expects {entry.topic} for each step, "
            f"{publisher} publishes it only when something happens"
        )
    if node.values.io.input_matching == "exact" and entry.divider % output.divider:
        raise MissionError(
            f"{origin}: {node.name} expects {entry.topic} every {entry.divider} steps, "
            f"{publisher} publishes it every {output.divider}"
        )
