# SPDX-License-Identifier: Apache-2.0
"""Missions: one ROS 2 parameter file each, validated as a whole by every reader.

Shared sections stand under `/**`, node parameters under the node's name. The file is read unchanged by
`ros2 run ... --params-file`, by the launch file, by the composed flight and by studies; ROS itself ignores keys that
nobody declares, so each reader checks the whole file here first and a typo dies everywhere.
"""

import importlib
import math
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from css_common import sections
from css_common.codec import type_name
from css_common.component import Component, Input, Output, Plant
from css_common.epochs import parse_utc
from css_common.mission_file import MissionError, dump_sections, flattened, read_sections
from css_common.schema import (
    Parameter,
    ParameterError,
    Values,
    checked_values,
    shaped_values,
    unknown_name,
)

SHARED = "/**"
_SHARED_TABLE = tuple(p for table in sections.SECTIONS.values() for p in table)
_SHARED_NAMES = {p.name: p for p in _SHARED_TABLE}
_EVENT_KEYS = {"time", "node", "action", "parameter", "value"}
_ACTIONS = ("activate", "deactivate", "set")


@dataclass(frozen=True)
class Event:
    """A scripted change at a simulated time."""

    name: str
    time: float
    node: str
    action: str
    parameter: str = ""
    value: Any = None


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
        return self.component.outputs(self.name, self.values)


class Mission:
    """A validated mission. Use `load_mission` or `default_mission`."""

    def __init__(self, origin: str, parameters: dict[str, dict[str, Any]]) -> None:
        """Validates all sections.

        Args:
            origin: file name for messages.
            parameters: section name to flat parameter names and raw values.

        Raises:
            MissionError: naming the file, section, key, value and what was expected.
        """
        self.origin = origin
        self.parameters = parameters
        shared = {key: value for key, value in parameters.get(SHARED, {}).items() if not belongs_to_ros(key)}
        self._events_raw = _take(shared, "events.")
        self._criteria_raw = _take(shared, "criteria.")
        with _naming(origin, SHARED):
            self.shared = checked_values(_SHARED_TABLE, shared)
            self.values = shaped_values(_SHARED_TABLE, self.shared)
            _refuse(sections.conflicts(self.values))
        self._shared_given = shared
        self.nodes = self._build_nodes()
        self.events = self._build_events()
        self.criteria = self._build_criteria()
        self._check_wiring()

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
        return parse_utc(self.values.mission.epoch)

    @property
    def steps(self) -> int:
        """Number of control cycles to fly."""
        return round(self.values.mission.duration / self.values.mission.period)

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
        return self._node(name, package, executable, component)

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

    def with_overrides(self, overrides: Iterable[str]) -> "Mission":
        """The mission with `key=value` texts applied; a key may begin with a node's name (`ekf.use_gyro=false`).

        Raises:
            MissionError: a key that no section has, or a value that its specification refuses.
        """
        parameters = {section: dict(values) for section, values in self.parameters.items()}
        for override in overrides:
            key, separator, text = override.partition("=")
            if not separator:
                raise MissionError(f"{override!r} is no override, expected KEY=VALUE")
            key = key.strip()
            section, specification = self._find(key)
            try:
                value = replace(specification, name=key).parse(text)  # errors name it as it was typed
            except ParameterError as error:
                raise MissionError(f"override {error}") from error
            parameters.setdefault(section, {})[specification.name] = value
        return Mission(self.origin, parameters)

    def text(self) -> str:
        """The mission as a parameter file: what was given, overrides applied."""
        return dump_sections(self.parameters)

    def _find(self, key: str) -> tuple[str, Parameter]:
        if key in _SHARED_NAMES:
            return SHARED, _SHARED_NAMES[key]
        head, _, rest = key.partition(".")
        known = [*_SHARED_NAMES]
        for node in self.nodes:
            for parameter in node.component.table():
                if node.name == head and parameter.name == rest:
                    return node.name, parameter
                known.append(f"{node.name}.{parameter.name}")
        raise MissionError(f"override {unknown_name(key, known)}")

    def _build_nodes(self) -> tuple[Node, ...]:
        nodes: list[Node] = []
        for entry in self.values.graph.nodes:
            package, executable, name = parse_node_entry(entry, self.origin)
            if any(n.name == name for n in nodes):
                raise MissionError(f"{self.origin}: {SHARED}: graph.nodes: two nodes are called {name}")
            nodes.append(self._node(name, package, executable, find_component(package, executable, self.origin)))
        known = [n.name for n in nodes]
        for section in self.parameters:
            if section != SHARED and section not in known:
                raise MissionError(
                    f"{self.origin}: section {unknown_name(section, known)} (sections are {SHARED} and the nodes "
                    f"of graph.nodes: {', '.join(known)})"
                )
        return tuple(nodes)

    def _node(self, name: str, package: str, executable: str, component: type[Component]) -> Node:
        table = component.table()
        names = {p.name for p in table}
        given = {key: value for key, value in self._shared_given.items() if key in names}
        own = self.parameters.get(name, {})
        given |= {key: value for key, value in own.items() if not belongs_to_ros(key)}
        with _naming(self.origin, name):
            canonical = checked_values(table, given)
            values = shaped_values(table, canonical)
            _refuse(sections.conflicts(values))
            _refuse(component.conflicts(values))
        return Node(name, package, executable, component, canonical, values)

    def _build_events(self) -> tuple[Event, ...]:
        grouped = _grouped(self._events_raw)
        events = []
        for name, fields in grouped.items():
            where = f"{self.origin}: {SHARED}: events.{name}"
            for key in fields:
                if key not in _EVENT_KEYS:
                    raise MissionError(f"{where}.{unknown_name(key, _EVENT_KEYS)}")
            time, node, action = fields.get("time"), fields.get("node"), fields.get("action")
            if not isinstance(time, float) or not time >= 0.0:
                raise MissionError(f"{where}.time: {time!r} given, expected seconds from the epoch, such as 600.0")
            if action not in _ACTIONS:
                raise MissionError(f"{where}.action: {action!r} given, expected one of {', '.join(_ACTIONS)}")
            names = [n.name for n in self.nodes]
            if node not in names:
                raise MissionError(f"{where}.node: {unknown_name(str(node), names)}")
            target = self.node(node)
            event = Event(name, time, target.name, action, str(fields.get("parameter", "")), fields.get("value"))
            if action == "set":
                self._check_set_event(where, target, event)
            events.append(event)
        return tuple(sorted(events, key=lambda e: (e.time, e.name)))

    def _check_set_event(self, where: str, target: Node, event: Event) -> None:
        table = {p.name: p for p in target.component.table()}
        if event.parameter not in table:
            raise MissionError(f"{where}.parameter: {unknown_name(event.parameter, table)}")
        if not table[event.parameter].tunable:
            raise MissionError(f"{where}.parameter: {event.parameter} cannot change in flight")
        try:
            table[event.parameter].check(event.value)
        except ParameterError as error:
            raise MissionError(f"{where}.value: {error}") from error

    def _build_criteria(self) -> dict[str, dict[str, float]]:
        criteria = _grouped(self._criteria_raw)
        for quantity, limits in criteria.items():
            for key, value in limits.items():
                where = f"{self.origin}: {SHARED}: criteria.{quantity}.{key}"
                if key not in ("min", "max"):
                    raise MissionError(f"{where}: unknown, expected min or max")
                if not isinstance(value, float) or not math.isfinite(value):
                    raise MissionError(f"{where}: {value!r} given, expected a number written with a point")
        return criteria

    def _check_connection(self, node: Node, entry: Input, publisher: str, output: Output) -> None:
        if entry.message_type is not output.message_type:
            raise MissionError(
                f"{self.origin}: {node.name} takes {entry.topic} as {type_name(entry.message_type)}, "
                f"{publisher} publishes {type_name(output.message_type)}"
            )
        if node.values.io.input_matching == "exact" and output.events:
            raise MissionError(
                f"{self.origin}: {node.name} expects {entry.topic} for each step, "
                f"{publisher} publishes it only when something happens"
            )
        if node.values.io.input_matching == "exact" and entry.divider % output.divider:
            raise MissionError(
                f"{self.origin}: {node.name} expects {entry.topic} every {entry.divider} steps, "
                f"{publisher} publishes it every {output.divider}"
            )

    def _check_wiring(self) -> None:
        publishers: dict[str, tuple[str, Output]] = {}
        for node in self.nodes:
            for output in node.outputs:
                if output.topic in publishers:
                    raise MissionError(
                        f"{self.origin}: {node.name} and {publishers[output.topic][0]} both publish {output.topic}"
                    )
                publishers[output.topic] = node.name, output
        for node in self.nodes:
            for entry in node.inputs:
                if entry.topic in publishers:
                    self._check_connection(node, entry, *publishers[entry.topic])
                elif entry.required and self.plant is not None:
                    # without a plant nothing is simulated: devices publish what the nodes need
                    raise MissionError(
                        f"{self.origin}: {node.name} needs the topic {unknown_name(entry.topic, publishers)}; "
                        "no node of graph.nodes publishes it"
                    )
        for topic in self.values.lockstep.wait_for:
            if topic not in publishers:
                raise MissionError(
                    f"{self.origin}: {SHARED}: lockstep.wait_for: {unknown_name(topic, publishers)}"
                )
            name, output = publishers[topic]
            if output.events:
                raise MissionError(
                    f"{self.origin}: {SHARED}: lockstep.wait_for: {name} publishes {topic} only when something happens"
                )


@contextmanager
def _naming(origin: str, section: str) -> Iterator[None]:
    """Puts file and section in front of what is wrong."""
    try:
        yield
    except ParameterError as error:
        raise MissionError(f"{origin}: {section}: {error}") from error


def _refuse(conflicts: Iterable[str]) -> None:
    for conflict in conflicts:
        raise ParameterError(conflict)


def _take(values: dict[str, Any], prefix: str) -> dict[str, Any]:
    names = [name for name in values if name.startswith(prefix)]
    return {name.removeprefix(prefix): values.pop(name) for name in names}


def _grouped(flat: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    groups: dict[str, dict[str, Any]] = {}
    for name, value in flat.items():
        group, _, key = name.partition(".")
        groups.setdefault(group, {})[key] = value
    return groups


def belongs_to_ros(name: str) -> bool:
    """True for parameters that every ROS node has, whoever wrote it: quality-of-service overrides, simulated time."""
    return name.startswith("qos_overrides.") or name in ("use_sim_time", "start_type_description_service")


def parse_node_entry(entry: str, origin: str) -> tuple[str, str, str]:
    """Package, executable and name of `PACKAGE/EXECUTABLE[:NAME]`.

    Raises:
        MissionError: the entry has another form.
    """
    form = re.fullmatch(r"([A-Za-z]\w*)/([A-Za-z]\w*)(?::([A-Za-z]\w*))?", entry, re.ASCII)
    if form is None:
        raise MissionError(f"{origin}: {SHARED}: graph.nodes: {entry!r} given, expected PACKAGE/EXECUTABLE[:NAME]")
    package, executable, name = form.groups()
    return package, executable, name or executable


def find_component(package: str, executable: str, origin: str = "mission") -> type[Component]:
    """The component that a node file defines.

    Raises:
        MissionError: there is no such node file, or it defines no component.
    """
    module_name = f"{package}.nodes.{executable}"
    try:
        module = importlib.import_module(module_name)
    except ModuleNotFoundError as error:
        if error.name and not module_name.startswith(error.name):
            raise
        raise MissionError(
            f"{origin}: {SHARED}: graph.nodes: {package}/{executable}: "
            f"there is no {module_name.replace('.', '/')}.py in this workspace"
        ) from error
    for item in vars(module).values():
        if isinstance(item, type) and issubclass(item, Component) and item.__module__ == module_name:
            return item
    raise MissionError(f"{origin}: {SHARED}: graph.nodes: {module_name} defines no component")


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
        if not Path(name).is_file():
            raise MissionError(f"{name}: no such mission file")
        return Path(name)
    known: list[str] = []
    for folder in mission_folders():
        if (folder / f"{name}.yaml").is_file():
            return folder / f"{name}.yaml"
        known += [p.stem for p in sorted(folder.glob("*.yaml"))]
    raise MissionError(f"mission {unknown_name(name, known)} (missions: {', '.join(dict.fromkeys(known)) or 'none'})")


def load_mission(name: str | Path, overrides: Iterable[str] = ()) -> Mission:
    """The mission of a file or name, with overrides.

    Raises:
        MissionError: the file is missing, is no parameter file, or anything in it is wrong.
    """
    path = find_mission(str(name))
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise MissionError(f"{path}: cannot be read: {error}") from error
    if not any(read_sections(text, str(path)).values()):
        raise MissionError(f"{path}: holds no parameters, expected sections such as {SHARED}: {{ros__parameters: ...}}")
    return mission_from_text(text, str(path), overrides)


def mission_from_text(text: str, origin: str, overrides: Iterable[str] = ()) -> Mission:
    """The mission of a parameter file's text (for instance the one embedded in a recording)."""
    parameters = {name: flattened(section) for name, section in read_sections(text, origin).items()}
    mission = Mission(origin, parameters)
    overrides = list(overrides)
    return mission.with_overrides(overrides) if overrides else mission


def default_mission() -> Mission:
    """The mission of all defaults, used by a node that is started without a file."""
    return Mission("defaults", {})
