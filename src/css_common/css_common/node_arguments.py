# SPDX-License-Identifier: Apache-2.0
"""What the command line of a node says: its name, its parameter files and the mission that they make."""

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

from css_common.component import Component
from css_common.mission import Mission
from css_common.mission_extends import sections_of_file
from css_common.mission_file import MissionError
from css_common.parameter_sections import (
    SHARED,
    Sections,
    belongs_to_ros,
    given_to,
    is_for,
    is_shared,
    merged_files,
    shared_by_all,
)
from css_common.schema import ParameterError, nearest, shown, unknown_name
from css_common.shared_sections import shared_parameters

_NAMING = re.compile(r"(?:(\w+):)?__(node|name|ns):=(.*)", re.DOTALL)
_NODE = re.compile(r"[A-Za-z]\w*", re.ASCII)
_NAMESPACE = re.compile(r"/|(/[A-Za-z_]\w*)+", re.ASCII)
_LONGEST_NAME = 100
USUAL_GRAPH = (
    "css_sim/dynamics",
    "css_sim/css_array",
    "css_sim/gyro",
    "css_estimation/ekf",
    "sunpoint_control/mrp_control",
)
"""What a node takes to be around it that is started without a mission."""


@dataclass
class NodeArguments:
    """The parts of a command line.

    Attributes:
        name: of the node, after remapping.
        namespace: of the node, after remapping.
        files: parameter files in their order.
        overrides: what is given with -p, as written.
        others: what is none of ROS's.
    """

    name: str
    namespace: str = "/"
    files: list[str] = field(default_factory=list)
    overrides: list[str] = field(default_factory=list)
    others: list[str] = field(default_factory=list)


def parse_arguments(executable: str, arguments: Iterable[str]) -> NodeArguments:
    """Takes a command line apart as rcl does; what rcl refuses is left to rcl."""
    of_ros, others = _split(arguments)
    result = NodeArguments(executable, others=others)
    rules: list[re.Match[str]] = []
    for option, value in pairwise(of_ros):
        if option == "--params-file":
            result.files.append(value)
        elif option in ("-p", "--param"):
            result.overrides.append(value)
        elif option in ("-r", "--remap") and (rule := _NAMING.fullmatch(value)):
            rules.append(rule)
    result.name = _renamed(rules, ("node", "name"), executable, executable)
    result.namespace = _renamed(rules, ("ns",), result.name, "/")
    return result


def _renamed(rules: list[re.Match[str]], kinds: tuple[str, ...], name: str, otherwise: str) -> str:
    """What the first rule says that is for the node of that name."""
    return next((rule[3] for rule in rules if rule[2] in kinds and rule[1] in (None, name)), otherwise)


def _split(arguments: Iterable[str]) -> tuple[list[str], list[str]]:
    """Arguments of ROS, which stand between `--ros-args` and `--`, and the others."""
    of_ros: list[str] = []
    others: list[str] = []
    inside = False
    for argument in arguments:
        if argument in ("--ros-args", "--"):
            inside = argument == "--ros-args"
        else:
            (of_ros if inside else others).append(argument)
    return of_ros, others


def mission_of_arguments(component_type: type[Component], arguments: Iterable[str]) -> Mission:
    """The mission in the parameter files of a command line, later files over earlier ones; defaults without any.

    A file with `graph.nodes` is a mission and is checked as one. Any other is a parameter file like those of other
    nodes: what it holds for this node is checked, the rest is left alone.

    Raises:
        MissionError: a file is missing or wrong.
        ParameterError: an override is for no parameter of the node.
    """
    executable = component_type.__module__.rpartition(".")[2]
    given = parse_arguments(executable, arguments)
    _refuse_bad_names(given)
    _refuse_unknown_overrides(component_type, given)
    files = [(file, sections_of_file(file)) for file in given.files]
    sections = merged_files(read for _, read in files)
    origin = ", ".join(given.files) or "defaults"
    alone = "graph.nodes" not in shared_by_all(sections, given.namespace)
    if not alone:
        sections = dict(_of_graph(sections, given, origin))
    else:
        sections = _of_one_node(component_type, sections, given, origin)
    mission = Mission(origin, sections, given.namespace, (given.name, component_type), alone)
    mission.remarks += tuple(_for_another_namespace(files, given))
    return mission


def _refuse_bad_names(given: NodeArguments) -> None:
    for rule, text, form in (("__node", given.name, _NODE), ("__ns", given.namespace, _NAMESPACE)):
        if not form.fullmatch(text) or len(text) > _LONGEST_NAME:
            raise ParameterError(
                f"-r {rule}:={shown(text)}: expected at most {_LONGEST_NAME} letters, digits and _, no digit first"
                + (", after a /" if rule == "__ns" else "")
            )


def _refuse_unknown_overrides(component_type: type[Component], given: NodeArguments) -> None:
    # ROS keeps an override that nobody declares without a word
    known = [p.name for p in component_type.table()]
    for override in given.overrides:
        assigned, separator, _ = override.partition(":=")
        node, _, key = assigned.rpartition(":")
        if not separator:
            raise ParameterError(f"-p {override}: expected KEY:=VALUE")
        if node in ("", given.name) and key not in known and not belongs_to_ros(key):
            raise ParameterError(unknown_name(key, known))


def _of_graph(sections: Sections, given: NodeArguments, origin: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """What a mission holds for its graph, without the sections of nodes that have nothing to do with it."""
    entries = shared_by_all(sections, given.namespace)["graph.nodes"]
    names = [given.name]
    if isinstance(entries, list):  # else the mission refuses it
        names += [str(entry).replace(":", "/").rpartition("/")[2] for entry in entries]
    for section, parameters in sections.items():
        if is_shared(section, given.namespace) or any(is_for(section, name, given.namespace) for name in names):
            yield section, dict(parameters)
        elif section.rpartition("/")[2] not in names and nearest(section, names):
            raise MissionError(f"{origin}: section {unknown_name(section, names)}")


def _of_one_node(
    component_type: type[Component], sections: Sections, given: NodeArguments, origin: str
) -> dict[str, dict[str, Any]]:
    """What parameter files hold for a node that is started by itself, in the usual graph with this node in it."""
    own = {p.name for p in component_type.table()}
    for section, parameters in sections.items():
        if not is_for(section, given.name, given.namespace):
            continue
        shared = is_shared(section, given.namespace)
        known = own | shared_parameters().keys() if shared else own
        for key in parameters:
            if key in known or belongs_to_ros(key) or key.startswith(("events.", "criteria.")):
                continue
            if not shared or nearest(key, known):  # in a section for all nodes it may be another's
                raise MissionError(f"{origin}: {section}: {unknown_name(key, known)}")
    for_all = shared_by_all(sections, given.namespace)
    for_it = given_to(sections, given.name, given.namespace)
    shared_keys = {key: value for key, value in for_all.items() if key in shared_parameters()}
    own_keys = {key: value for key, value in for_it.items() if key in own}
    graph = _graph_with(component_type, given.name)
    return {SHARED: shared_keys | graph, f"{given.namespace.rstrip('/')}/{given.name}": own_keys}


def _graph_with(component_type: type[Component], name: str) -> dict[str, list[str]]:
    """The usual graph with a node in it. A node of another package knows nothing of it and stands by itself."""
    package, _, executable = component_type.__module__.partition(".nodes.")
    nodes = list(USUAL_GRAPH)
    if not any(entry.startswith(f"{package}/") for entry in nodes):
        nodes = []
    if not any(entry.replace(":", "/").rpartition("/")[2] == name for entry in nodes):
        nodes = [*nodes, f"{package}/{executable}:{name}"]
    return {"graph.nodes": nodes}


def _for_another_namespace(files: Iterable[tuple[str, Sections]], given: NodeArguments) -> Iterator[str]:
    for file, sections in files:
        for section in sections:
            if section.rpartition("/")[2] == given.name and not is_for(section, given.name, given.namespace):
                yield (
                    f"{file}: section {section} is not for this node, {given.namespace.rstrip('/')}/{given.name}; "
                    f"/**/{given.name} would be"
                )
