# SPDX-License-Identifier: Apache-2.0
"""Missions: one ROS 2 parameter file each, validated as a whole by every reader.

Shared sections stand under `/**`, node parameters under the node's name. A mission may extend another one
(`css_common.mission_extends`); what flies and is recorded is the whole of both. The file is read unchanged by
`ros2 run ... --params-file`, by the launch file, by the composed flight and by studies; ROS itself ignores keys that
nobody declares, so each reader checks the whole file here first and a typo dies everywhere.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

from css_common import dispersions
from css_common.component import Component, Output, Plant, all_conflicts, missing_values
from css_common.dispersions import Dispersion, dispersions_of, text_parameter
from css_common.epochs import mission_epoch
from css_common.fault_lines import FAULTS, SECTION, Host, entries_of, entry_parameter
from css_common.link_kinds import LINK_FAULTS, of_sorts, parameter_of
from css_common.mission_extends import sections_of_file, sections_of_text
from css_common.mission_file import MissionError, dump_sections
from css_common.mission_lookup import find_mission
from css_common.mission_node import Node, check_wiring
from css_common.mission_script import Event, criteria_of, events_of
from css_common.mission_section import EPOCH
from css_common.node_files import find_component, parse_node_entry
from css_common.parameter_sections import (
    SHARED,
    Sections,
    given_to,
    is_for,
    is_shared,
    merged_files,
    shared_by_all,
    with_own,
    with_shared,
)
from css_common.schema import (
    Parameter,
    ParameterError,
    Table,
    checked_values,
    flag,
    missing,
    shaped_values,
    shown,
    unknown_name,
)
from css_common.shared_sections import conflicts, shared_parameters

__all__ = [
    "SHARED",
    "Event",
    "Mission",
    "MissionError",
    "find_component",
    "find_mission",
    "load_mission",
    "mission_from_text",
]

_SCRIPTS = ("events.", "criteria.", SECTION, dispersions.SECTION)
GRAPH_NODES = "graph.nodes"
"""Parameter that lists the nodes of the graph."""
_OF_ROS = {name: flag(name, False, "") for name in ("use_sim_time", "start_type_description_service")}
_MOST_NODES = 64


class Mission:
    """A validated mission. Use `load_mission`.

    Attributes:
        faults: entries of the section `faults`; the parameters of their nodes have them, too.
        dispersions: parameters that are drawn for each case; its values are those before the draws
            (`css_common.drawn_mission`).
        remarks: what is right but may not be what was meant, one line each.
    """

    def __init__(
        self,
        origin: str,
        parameters: dict[str, dict[str, Any]],
        namespace: str = "/",
        guest: tuple[str, type[Component]] | None = None,
        alone: bool = False,
    ) -> None:
        """Validates all sections.

        Args:
            origin: file name for messages.
            parameters: section name to flat parameter names and raw values.
            namespace: of its nodes.
            guest: name and component of a node beside the graph, which may have a section, too.
            alone: the guest is all there is, and may be given what it needs in another way: nothing is asked for here.

        Raises:
            MissionError: naming the file, section, key, value and what was expected.
        """
        self.origin = origin
        self.parameters = parameters
        self.namespace = namespace
        self._alone = alone
        given = shared_by_all(parameters, namespace)
        known = shared_parameters()
        shared = {key: value for key, value in given.items() if key in known}
        with _naming(origin, SHARED):
            self.shared = checked_values(known.values(), shared)
            self.values = shaped_values(known.values(), self.shared)
            _refuse(conflicts(self.values))
        self.nodes = self._build_nodes()
        with _naming(origin, SHARED):
            self.faults = entries_of(_below(SECTION, given), self._hosts())
        self.nodes = tuple(self._with_faults(node) for node in self.nodes)
        tables = {node.name: node.component.table() for node in self.nodes}
        self._check_keys(tables if guest is None else tables | {guest[0]: guest[1].table()})
        self.events = events_of(_below("events.", given), tables, f"{origin}: {SHARED}")
        if self.events or self.faults:
            with _naming(origin, SHARED):
                _refuse(missing(known.values(), self.values, (EPOCH.name,)))  # from which times count
        self.criteria = criteria_of(_below("criteria.", given), f"{origin}: {SHARED}")
        check_wiring(self.nodes, self.values.lockstep.wait_for, origin)
        with _naming(origin, SHARED):
            self.dispersions: tuple[Dispersion, ...] = dispersions_of(_below(dispersions.SECTION, given), self.known)
        self.remarks = tuple(self._unmeant())

    @property
    def name(self) -> str:
        """Name of the mission."""
        return self.values.mission.name

    @property
    def period_ns(self) -> int:
        """Control cycle [ns]."""
        return round(self.values.mission.period * 1e9)

    @property
    def epoch_ns(self) -> int:
        """Stamp of step 0 [ns since 1970 UTC]."""
        return mission_epoch(self.values.mission)

    @property
    def steps(self) -> int:
        """Number of control cycles to fly; 0 in the mission of nodes that nothing paces."""
        duration = self.values.mission.duration
        return 0 if math.isnan(duration) else round(duration / self.values.mission.period)

    def node(self, name: str) -> Node:
        """The node called `name`.

        Raises:
            MissionError: there is none.
        """
        for node in self.nodes:
            if node.name == name:
                return node
        raise MissionError(f"{self.origin}: {unknown_name(name, [n.name for n in self.nodes])}")

    def node_of(self, component: type[Component], name: str) -> Node:
        """A node for a component, with the mission's parameters, whether or not the graph lists it."""
        package, _, executable = component.__module__.partition(".nodes.")
        return self._with_faults(self._node(name, package, executable, component))

    @property
    def plant(self) -> Node | None:
        """The node that owns simulated time, if the graph has one."""
        return next((n for n in self.nodes if issubclass(n.component, Plant)), None)

    @cached_property
    def topics(self) -> dict[str, type]:
        """Every topic that a node of the graph publishes, with its message class."""
        return {output.topic: output.message_type for node in self.nodes for output in node.outputs}

    @cached_property
    def publishers(self) -> dict[str, str]:
        """Name of the node of the graph that publishes each topic."""
        return {output.topic: node.name for node in self.nodes for output in node.outputs}

    @cached_property
    def outputs(self) -> dict[str, Output]:
        """Every output of the graph by topic."""
        return {output.topic: output for node in self.nodes for output in node.outputs}

    @cached_property
    def awaited(self) -> tuple[str, ...]:
        """Topics that the plant waits for before it leaves a stamp.

        Without an explicit list: every output that ends a cycle, less those that an awaited node itself must have
        received for the same stamp; in a graph without such outputs, everything that no node consumes.
        """
        explicit = tuple(self.values.lockstep.wait_for)
        if explicit:
            return explicit
        others = [n for n in self.nodes if not issubclass(n.component, Plant)]
        ends = [o.topic for n in others for o in n.outputs if o.ends_cycle]
        if not ends:
            consumed = {i.topic for n in others for i in n.inputs}
            return tuple(o.topic for n in others for o in n.outputs if o.topic not in consumed and not o.events)
        implied = {
            i.topic
            for n in others
            if any(o.topic in ends and o.divider == 1 for o in n.outputs)
            for i in n.inputs
            if i.required and i.divider == 1
        }
        exact = self.values.io.input_matching == "exact"
        return tuple(topic for topic in ends if not (exact and topic in implied))

    def refuse_faults(self, why: str, *sorts: str) -> None:
        """Refuses faults that a way of flying has no place for.

        Args:
            why: what they need, and what would be right.
            sorts: of these.

        Raises:
            MissionError: the mission has one.
        """
        for node in self.nodes:
            for line in of_sorts(node.canonical[LINK_FAULTS.name], *sorts):
                names = [entry.name for entry in self.faults if entry.line == line]
                where = f"{SHARED}: {SECTION}{names[0]}" if names else f"{node.name}: {LINK_FAULTS.name}"
                raise MissionError(f"{self.origin}: {where}: {shown(line)} {why}")
        for event in self.events:
            for line in of_sorts(event.value, *sorts) if event.parameter == LINK_FAULTS.name else ():
                raise MissionError(f"{self.origin}: {SHARED}: events.{event.name}: {shown(line)} {why}")

    def with_overrides(self, overrides: Iterable[str]) -> "Mission":
        """The mission with `key=value` texts applied; a key may begin with a node's name (`ekf.use_gyro=false`).

        Raises:
            MissionError: a key that no section has, or a value that its specification refuses.
        """
        parameters: Sections = self.parameters
        texts = list(overrides)
        tables = self._tables_with(texts)
        for override in texts:
            key, separator, text = override.partition("=")
            if not separator:
                raise MissionError(f"{shown(override)} is no override, expected KEY=VALUE")
            node, specification = self._find(key.strip(), tables)
            value = _parsed(key.strip(), specification, text)
            parameters = _placed(parameters, key.strip(), node, specification, value)
        return self._with(parameters)

    def _tables_with(self, overrides: Sequence[str]) -> dict[str, Table]:
        """Parameters of each node of the graph, as it is once overrides are applied: they may bring a node."""
        tables = {node.name: node.component.table() for node in self.nodes}
        for override in overrides:
            key, _, text = override.partition("=")
            if key.strip() == GRAPH_NODES:
                for entry in _parsed(GRAPH_NODES, shared_parameters()[GRAPH_NODES], text):
                    package, executable, name = parse_node_entry(entry, self.origin)
                    tables[name] = find_component(package, executable, self.origin).table()
        return tables

    def with_drawn(self, values: Mapping[str, Any], case: int) -> "Mission":
        """The mission with values in canonical form by key, for a case; it disperses nothing any more.

        Raises:
            MissionError: values that do not go together.
        """
        parameters: Sections = self.parameters
        for key, value in values.items():
            parameters = _placed(parameters, key, *self._find(key), value)
        parameters = with_shared(parameters, "mission.case", case)
        drawn = dispersions.SECTION
        return self._with({n: {k: v for k, v in p.items() if not k.startswith(drawn)} for n, p in parameters.items()})

    def known(self, key: str) -> tuple[str | None, Parameter, Any]:
        """Node of an override's key (None: it is shared), its specification and its value in canonical form.

        Raises:
            MissionError: no section has it.
        """
        node, specification = self._find(key)
        canonical = self.shared if node is None else self.node(node).canonical
        return node, specification, canonical.get(specification.name)

    def with_sections(self, sections: Sections) -> "Mission":
        """The mission with the parameters of a file on top of its own, key by key.

        Raises:
            MissionError: a section or key that the mission does not have, or a value that is refused.
        """
        return self._with(merged_files([self.parameters, sections]))

    def with_node(self, node: tuple[str, str, str], changes: Mapping[str, str]) -> "Mission":
        """The mission with a node in its graph, there or not, and texts of parameters of its own applied.

        Args:
            node: its package, executable and name.
            changes: parameter to text.

        Raises:
            MissionError: as `with_overrides`.
        """
        package, executable, name = node
        parameters: Sections = self.parameters
        if all(known.name != name for known in self.nodes):
            entries = [*self.values.graph.nodes, f"{package}/{executable}:{name}"]
            parameters = with_shared(parameters, "graph.nodes", entries)
        table = {p.name: p for p in find_component(package, executable, self.origin).table()}
        for key, text in changes.items():
            if key not in table:
                raise MissionError(f"override {name}.{unknown_name(key, table)}")
            parameters = with_own(parameters, name, key, _parsed(f"{name}.{key}", table[key], text))
        return self._with(parameters)

    def _with(self, parameters: Sections) -> "Mission":
        return Mission(self.origin, {name: dict(flat) for name, flat in parameters.items()}, self.namespace)

    def text(self) -> str:
        """The mission as a parameter file: what was given, overrides applied."""
        return dump_sections(self.parameters)

    def _find(self, key: str, tables: Mapping[str, Table] | None = None) -> tuple[str | None, Parameter]:
        """The node that a parameter belongs to, None when all share it, and its specification."""
        tables = self._tables_with(()) if tables is None else tables
        shared = shared_parameters()
        if key in shared:
            return None, shared[key]
        other = entry_parameter(key, self._hosts().values()) or text_parameter(key)
        if other is not None:
            return None, other
        head, _, rest = key.partition(".")
        known = [*shared]
        for name, table in tables.items():
            for parameter in table:
                if name == head and parameter.name == rest:
                    return name, parameter
                known.append(f"{name}.{parameter.name}")
        raise MissionError(f"override {unknown_name(key, known)}")

    def _build_nodes(self) -> tuple[Node, ...]:
        entries = self.values.graph.nodes
        if len(entries) > _MOST_NODES:
            raise MissionError(
                f"{self.origin}: {SHARED}: graph.nodes: {len(entries)} given, expected at most {_MOST_NODES}"
            )
        nodes: list[Node] = []
        for entry in entries:
            package, executable, name = parse_node_entry(entry, self.origin)
            if any(n.name == name for n in nodes):
                raise MissionError(f"{self.origin}: {SHARED}: graph.nodes: two nodes are called {name}")
            nodes.append(self._node(name, package, executable, find_component(package, executable, self.origin)))
        return tuple(nodes)

    def _check_keys(self, tables: Mapping[str, Table]) -> None:
        """Refuses sections that are for no node of the graph, and keys that none of a section's nodes has."""
        for section, parameters in self.parameters.items():
            names = [name for name in tables if is_for(section, name, self.namespace)]
            shared = is_shared(section, self.namespace)
            if not names and not shared:
                raise MissionError(
                    f"{self.origin}: section {unknown_name(section, tables)} (sections are {SHARED} and the nodes "
                    f"of graph.nodes: {', '.join(tables)})"
                )
            known = {p.name: p for name in names for p in tables[name]} | _OF_ROS
            known |= shared_parameters() if shared else {}
            for key, value in parameters.items():
                if key.startswith("qos_overrides.") or (shared and key.startswith(_SCRIPTS)):
                    continue
                with _naming(self.origin, section):
                    if key not in known:
                        raise ParameterError(unknown_name(key, known))
                    if key in _OF_ROS:
                        _OF_ROS[key].check(value)

    def _unmeant(self) -> Iterator[str]:
        given, period = self.values.mission.duration, self.values.mission.period
        if abs(given - self.steps * period) > 1e-6 * period:
            yield (
                f"mission.duration: {given:.9g} s is no multiple of mission.period {period:.9g} s: "
                f"{self.steps} steps are flown, {self.steps * period:.9g} s"
            )

    def _node(self, name: str, package: str, executable: str, component: type[Component]) -> Node:
        table = component.table()
        names = {p.name for p in table}
        given = given_to(self.parameters, name, self.namespace)
        with _naming(self.origin, name):
            canonical = checked_values(table, {key: value for key, value in given.items() if key in names})
            values = shaped_values(table, canonical)
            if not (self._alone and any(missing_values(component, values))):
                _refuse(all_conflicts(component, values, name))
        return Node(name, package, executable, component, canonical, values)

    def _hosts(self) -> dict[str, Host]:
        """What may fail, by node."""
        return {node.name: node.host for node in self.nodes}

    def _with_faults(self, node: Node) -> Node:
        """A node with the faults of the mission's entries after those of its own parameter."""
        given = [entry for entry in self.faults if entry.node == node.name]
        if not given:
            return node
        canonical = dict(node.canonical)
        for entry in given:
            key = parameter_of(entry.line.partition(".")[0], FAULTS).name
            canonical[key] = [*canonical[key], entry.line]
        values = shaped_values(node.component.table(), canonical)
        if not any(missing_values(node.component, values)):
            with _naming(self.origin, node.name):
                _refuse(all_conflicts(node.component, values, node.name))
        return replace(node, canonical=canonical, values=values)


def _parsed(key: str, specification: Parameter, text: str) -> Any:
    try:
        return replace(specification, name=key).parse(text)  # errors name it as it was typed
    except ParameterError as error:
        raise MissionError(f"override {error}") from error


def _placed(sections: Sections, key: str, node: str | None, specification: Parameter, value: Any) -> Sections:
    """Sections in which an override's key has a value."""
    if node is None:
        return with_shared(sections, key, value)
    return with_own(sections, node, specification.name, value)


@contextmanager
def _naming(origin: str, section: str) -> Iterator[None]:
    """Puts file and section in front of what is wrong."""
    try:
        yield
    except ParameterError as error:
        raise MissionError(f"{origin}: {section}: {error}") from error


def _refuse(found: Iterable[str]) -> None:
    for conflict in found:
        raise ParameterError(conflict)


def _below(prefix: str, values: Mapping[str, Any]) -> dict[str, Any]:
    return {name.removeprefix(prefix): value for name, value in values.items() if name.startswith(prefix)}


def load_mission(name: str | Path, overrides: Iterable[str] = ()) -> Mission:
    """The mission of a file or name, with overrides.

    Raises:
        MissionError: the file is missing, is no parameter file, or anything in it is wrong.
    """
    path = find_mission(str(name))
    parameters = sections_of_file(path)
    if not any(parameters.values()):
        raise MissionError(f"{path}: holds no parameters, expected sections such as {SHARED}: {{ros__parameters: ...}}")
    return _changed(Mission(str(path), parameters), overrides)


def mission_from_text(text: str, origin: str, overrides: Iterable[str] = ()) -> Mission:
    """The mission of a parameter file's text (for instance the one embedded in a recording)."""
    return _changed(Mission(origin, sections_of_text(text, origin)), overrides)


def _changed(mission: Mission, overrides: Iterable[str]) -> Mission:
    overrides = list(overrides)
    return mission.with_overrides(overrides) if overrides else mission
