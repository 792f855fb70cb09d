# SPDX-License-Identifier: Apache-2.0
"""The parameters of the nodes of a graph: read when a node appears, then followed by what nodes tell of changes."""

import math
from collections.abc import Callable, Iterable
from typing import Any

from rcl_interfaces.msg import ParameterDescriptor, ParameterEvent
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters
from rclpy.node import Node

from css_console.calls import value_of

_OF_ROS = ("use_sim_time", "start_type_description_service", "qos_overrides.")
Ask = Callable[[str, type, Any, Callable[[Any], None], Callable[[str], object]], None]
"""Asks a service by its full name, its type and a request; the answer is handed on when it comes, or why none does."""


class Parameters:
    """Of all nodes of a graph.

    Attributes:
        values: by node and name.
        described: descriptors of those that can be set in flight, by node and name.
        version: grows with every change.
        heard: events of all nodes so far.
    """

    def __init__(self, node: Node, ask: Ask) -> None:
        """Begins to follow changes.

        Args:
            node: listens.
            ask: asks services.
        """
        self.values: dict[str, dict[str, Any]] = {}
        self.described: dict[str, dict[str, ParameterDescriptor]] = {}
        self.version = self.heard = 0
        self._ask = ask
        self._read: set[str] = set()
        node.create_subscription(ParameterEvent, "/parameter_events", self._note, 100)

    def follow(self, nodes: Iterable[str]) -> None:
        """Reads the parameters of nodes that are new, and forgets those of nodes that are gone."""
        wanted = set(nodes)
        for gone in self._read - wanted:
            self.values.pop(gone, None)
            self.described.pop(gone, None)
            self.version += 1
        for fresh in sorted(wanted - self._read):
            self._list(fresh)
        self._read = wanted

    def read_again(self) -> None:
        """Reads all of them anew: nodes of the same names have come in the place of those that were."""
        for node in self._read:
            self._list(node)

    def first(self, name: str) -> Any:
        """The value of a parameter that nodes have in common, at the first that has it; None without."""
        return next((values[name] for values in self.values.values() if name in values), None)

    def _list(self, node: str) -> None:
        request = ListParameters.Request()
        self._ask_of(node, "list_parameters", ListParameters, request, lambda a: self._listed(node, a))

    def _ask_of(self, node: str, name: str, kind: type, request: Any, answered: Callable[[Any], None]) -> None:
        """Asks a node; one that does not answer, as while it compiles, is asked again with the next look around."""
        self._ask(f"{node}/{name}", kind, request, answered, lambda why: self._read.discard(node))

    def _listed(self, node: str, answer: Any) -> None:
        names = [name for name in answer.result.names if not name.startswith(_OF_ROS)]
        if not names:
            return
        request, describe = GetParameters.Request(names=names), DescribeParameters.Request(names=names)
        self._ask_of(node, "get_parameters", GetParameters, request, lambda a: self._got(node, names, a.values))
        self._ask_of(
            node, "describe_parameters", DescribeParameters, describe, lambda a: self._described(node, a.descriptors)
        )

    def _got(self, node: str, names: list[str], values: Iterable[Any]) -> None:
        self.values[node] = {name: value_of(value) for name, value in zip(names, values, strict=False)}
        self.version += 1

    def _described(self, node: str, descriptors: Iterable[ParameterDescriptor]) -> None:
        self.described[node] = {d.name: d for d in descriptors if not d.read_only}
        self.version += 1

    def _note(self, event: ParameterEvent) -> None:
        self.heard += 1
        known = self.values.get(event.node)
        if known is None:
            return
        for parameter in event.changed_parameters:
            known[parameter.name] = value_of(parameter.value)
            self.version += 1

    @property
    def types(self) -> dict[tuple[str, str], int]:
        """Types of those that can be set in flight, by node and name."""
        return {(node, d.name): d.type for node, table in self.described.items() for d in table.values()}

    def table(self) -> list[dict[str, Any]]:
        """Those that can be set in flight, with unit, range and value, for the page."""
        return [
            {
                "node": node,
                "name": name,
                "what": descriptor.description,
                "expected": descriptor.additional_constraints,
                "range": _range(descriptor),
                "value": _plain(self.values.get(node, {}).get(name)),
            }
            for node, table in sorted(self.described.items())
            for name, descriptor in sorted(table.items())
        ]


def _range(descriptor: ParameterDescriptor) -> list[float | None] | None:
    for found in (*descriptor.floating_point_range, *descriptor.integer_range):
        return [_limit(float(found.from_value)), _limit(float(found.to_value))]
    return None


def _limit(value: float) -> float | None:
    """A limit, None for one that only says that there is none."""
    return None if abs(value) >= 2.0**63 - 1 else value


def _plain(value: Any) -> Any:
    """What JSON can have: no infinity."""
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return [_plain(item) for item in value] if isinstance(value, list) else value
