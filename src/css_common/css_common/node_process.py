# SPDX-License-Identifier: Apache-2.0
"""The process of one node: command line, mission, ROS start, clean end."""

import json
import signal
import sys
from itertools import pairwise
from pathlib import Path

import rclpy
from rclpy._rclpy_pybind11 import RCLError, RCLInvalidROSArgsError, UnknownROSArgsError
from rclpy.executors import ExternalShutdownException

from css_common.codec import type_name
from css_common.component import Component, Plant
from css_common.executor import create_executor, spin_until
from css_common.host import ComponentNode
from css_common.mission import Mission, belongs_to_ros
from css_common.mission_file import MissionError, flattened, read_sections
from css_common.plant_host import PlantNode
from css_common.schema import ParameterError, default_values, unknown_name
from css_common.sections import GRAPH

USAGE_ERROR = 2


def main(component_type: type[Component], arguments: list[str]) -> int:
    """Shows the help or runs the node; the exit code."""
    if "-h" in arguments or "--help" in arguments:
        print(describe(component_type))
        return 0
    return run_node(component_type, arguments)


def create_node(component_type: type[Component], name: str, mission: Mission, **options) -> ComponentNode:
    """The host that fits a component."""
    host = PlantNode if issubclass(component_type, Plant) else ComponentNode
    return host(component_type, name, mission, **options)


class FirstInterrupt:
    """Makes the first Ctrl-C a KeyboardInterrupt and every later one nothing.

    Attributes:
        armed: the next Ctrl-C raises; false from the first one on, and once cleaning up has begun.
    """

    def __init__(self) -> None:
        self.armed = True
        signal.signal(signal.SIGINT, self._raise_once)

    def _raise_once(self, number: int, frame: object) -> None:
        if self.armed:
            self.armed = False
            raise KeyboardInterrupt


def run_node(component_type: type[Component], arguments: list[str]) -> int:
    """Runs one node until it is told to stop; 0 on a clean end, 1 when it failed, 2 on bad parameters.

    `--summary FILE` before `--ros-args` leaves the figures of the run in a JSON file at its end.
    """
    summary = None
    if "--summary" in arguments[:-1]:
        at = arguments.index("--summary")
        summary = Path(arguments[at + 1])
        arguments = arguments[:at] + arguments[at + 2 :]
    interrupt = FirstInterrupt()
    started: list[ComponentNode] = []
    try:
        try:
            return _create_and_spin(component_type, arguments, started)
        finally:
            interrupt.armed = False  # from here on nothing tears the clean-up apart
    except KeyboardInterrupt:
        return 0
    finally:
        for node in started:
            if summary is not None:
                summary.write_text(json.dumps(node.summary()), encoding="utf-8")
            node.finish()
            node.destroy_node()
        rclpy.try_shutdown()


def _create_and_spin(component_type: type[Component], arguments: list[str], started: list[ComponentNode]) -> int:
    executable = component_type.__module__.rpartition(".")[2]
    try:
        mission = mission_of_arguments(component_type, arguments)
        rclpy.init(args=[sys.argv[0], *arguments])
        executor = create_executor()
        node = create_node(component_type, executable, mission)
        started.append(node)
        executor.add_node(node)
        if not node.start():
            return USAGE_ERROR if rclpy.ok() else 0
        plant = node if isinstance(node, PlantNode) else None
        spin_until(executor, lambda: plant is not None and plant.done)
        return 1 if plant is not None and plant.failed else 0
    except (MissionError, ParameterError) as error:
        print(f"{executable}: {error}", file=sys.stderr)
        return USAGE_ERROR
    except (RCLError, RCLInvalidROSArgsError, UnknownROSArgsError) as error:
        if not started:
            print(f"{executable}: {' '.join(str(error).split())}", file=sys.stderr)
            return USAGE_ERROR
        if rclpy.ok():
            raise
        return 0  # a signal ended ROS while the node was being set up
    except ExternalShutdownException:
        return 0


def mission_of_arguments(component_type: type[Component], arguments: list[str]) -> Mission:
    """The mission in the parameter files of a command line, later files over earlier ones; defaults without any.

    Raises:
        MissionError: a file is missing or wrong.
    """
    files = [b for a, b in pairwise(arguments) if a == "--params-file"]
    parameters: dict[str, dict] = {}
    for file in files:
        try:
            with open(file, encoding="utf-8") as stream:
                text = stream.read()
        except (OSError, UnicodeDecodeError) as error:
            raise MissionError(f"{file}: cannot be read: {error}") from error
        for section, nested in read_sections(text, file).items():
            parameters.setdefault(section, {}).update(flattened(nested))
    package, _, executable = component_type.__module__.partition(".nodes.")
    name = executable
    for argument in arguments:
        name = argument.removeprefix("__node:=") if argument.startswith("__node:=") else name
    _refuse_unknown_overrides(component_type, name, arguments)
    shared = parameters.setdefault("/**", {})
    if "graph.nodes" not in shared:
        # A file for this node alone: the graph is the default one, with this node in it. A node of another package
        # knows nothing of that graph and stands by itself.
        nodes = default_values(GRAPH).graph.nodes
        if not any(entry.startswith(f"{package}/") for entry in nodes):
            nodes = []
        if not any((entry.partition(":")[2] or entry.rpartition("/")[2]) == name for entry in nodes):
            shared["graph.nodes"] = [*nodes, f"{package}/{executable}:{name}"]
    given = {section: flat for section, flat in parameters.items() if flat}
    return Mission(", ".join(files) or "defaults", given)


def _refuse_unknown_overrides(component_type: type[Component], name: str, arguments: list[str]) -> None:
    # ROS keeps an override that nobody declares without a word
    known = [p.name for p in component_type.table()]
    for option, assignment in pairwise(arguments):
        node, _, key = assignment.partition(":=")[0].rpartition(":")
        if option in ("-p", "--param") and node in ("", name) and key not in known and not belongs_to_ros(key):
            raise ParameterError(unknown_name(key, known))


def describe(component_type: type[Component]) -> str:
    """Help text of a node: purpose, topics, parameters with unit, range and default."""
    package, _, name = component_type.__module__.partition(".nodes.")
    values = default_values(component_type.table())
    lines = [f"ros2 run {package} {name} [--ros-args --params-file MISSION.yaml ...]", ""]
    lines += [(component_type.__doc__ or "").strip(), "", "Subscribes:"]
    lines += [
        f"  {i.topic}  {type_name(i.message_type)}" + ("" if i.required else "  (optional)")
        for i in component_type.inputs(name, values)
    ] or ["  nothing"]
    lines += ["", "Publishes:"]
    lines += [
        f"  {o.topic}  {type_name(o.message_type)}" for o in component_type.outputs(name, values)
    ]
    lines += ["  /diagnostics  diagnostic_msgs/msg/DiagnosticArray", "", "Parameters (* may change in flight):"]
    for p in component_type.table():
        default = p.default if not (p.is_array and len(p.default) > 6) else f"{len(p.default)} values"
        lines.append(f"  {'*' if p.tunable else ' '}{p.name} = {default}")
        lines.append(f"      {p.description}; {p.expectation()}")
    return "\n".join(lines)
