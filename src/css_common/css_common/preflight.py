# SPDX-License-Identifier: Apache-2.0
"""Checks before a flight: what is physically or numerically wrong is refused, what is doubtful is named.

Each component knows what its own values do (`Component.preflight`); here they are all asked, with the values of the
start and those after each scripted change. Every way to fly a mission asks here first: `fly`, the node that owns
simulated time, studies and the reproduction of papers.
"""

import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from itertools import groupby

from css_common.component import Component, Finding, missing_values
from css_common.mission import SHARED, Mission
from css_common.mission_file import MissionError
from css_common.mission_node import Node
from css_common.schema import shaped_values
from css_common.shared_sections import shared_parameters

_reported: dict[str, None] = {}


def preflight(mission: Mission, component: type[Component] | None = None) -> list[str]:
    """Warnings for a mission that is about to fly, one line each.

    Args:
        mission: valid as a whole.
        component: ask nodes of this kind alone, as a node does that flies a mission's values by itself.

    Raises:
        MissionError: it must not fly, with file, section, key, value and what would be right.
    """
    warnings: dict[str, None] = {}
    for when, graph in _stages(mission):
        for node in graph.values():
            if component is not None and node.component is not component:
                continue
            if any(missing_values(node.component, node.values)):
                continue  # the node itself asks for it
            for finding in node.component.preflight(node, graph):
                line = _line(mission, node, finding)
                if finding.refused:
                    raise MissionError(line + when)
                if not any(line in known for known in warnings):
                    warnings[line + when] = None
    warnings |= dict.fromkeys(_what_is_too_late(mission))
    return list(warnings)


def report(warnings: Iterable[str]) -> None:
    """Warnings on standard error, each once in a process however often its mission flies."""
    for line in warnings:
        if line not in _reported:
            _reported[line] = None
            print(f"warning: {line}", file=sys.stderr, flush=True)


def reported() -> list[str]:
    """All warnings that this process has given."""
    return list(_reported)


def _stages(mission: Mission) -> Iterator[tuple[str, Mapping[str, Node]]]:
    """The nodes with their values at the start and after the changes of each instant, with words that tell when."""
    graph = {node.name: node for node in mission.nodes}
    yield "", graph
    changes = [event for event in mission.events if event.action == "set"]
    for time, together in groupby(changes, key=lambda event: event.time):
        events = list(together)
        for event in events:
            node = graph[event.node]
            canonical = {**node.canonical, event.parameter: event.value}
            values = shaped_values(node.component.table(), canonical)
            graph = graph | {node.name: replace(node, canonical=canonical, values=values)}
        yield f" (from {time:g} s on, by the event {events[-1].name})", graph


def _line(mission: Mission, node: Node, finding: Finding) -> str:
    key = finding.text.partition(":")[0]
    return f"{mission.origin}: {SHARED if key in shared_parameters() else node.name}: {finding.text}"


def _what_is_too_late(mission: Mission) -> Iterator[str]:
    if not mission.steps:
        return
    last = (mission.steps - 1) * mission.values.mission.period
    for word, scripted in (("event", mission.events), ("fault", mission.faults)):
        for one in scripted:
            if one.time > last + 1e-9:
                yield f"{word} {one.name} at {one.time:g} s never comes, the last step is at {last:g} s"
