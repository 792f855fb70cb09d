# SPDX-License-Identifier: Apache-2.0
"""The process of one node: command line, mission, ROS start, clean end."""

import json
import sys
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import rclpy
from rclpy._rclpy_pybind11 import RCLError, RCLInvalidROSArgsError, UnknownROSArgsError
from rclpy.executors import Executor
from rclpy.signals import SignalHandlerOptions

from css_common.codec import type_name
from css_common.component import Component, Plant
from css_common.executor import create_executor, spin_until
from css_common.host import ComponentNode
from css_common.mission import Mission, belongs_to_ros
from css_common.mission_file import MissionError, flattened, read_sections
from css_common.plant_host import PlantNode
from css_common.schema import ParameterError, default_values, unknown_name
from css_common.sections import GRAPH
from css_common.stop_signal import StopSignal
from css_common.supervised import beat

USAGE_ERROR = 2
# Wall times [s] at the end: for answers to the last stamp of a plant; for what is on its way to another node, and
# without any of it after which there is no more.
_ANSWER_LIMIT = 2.0
_DRAIN_LIMIT = 0.5
_QUIET = 0.1


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


def run_node(component_type: type[Component], arguments: list[str]) -> int:
    """Runs one node until it is told to stop; 0 on a clean end, 1 when it failed, 2 on bad parameters.

    A node that is told to stop finishes what it is at and answers what has arrived; a plant leaves the stamp that it
    has reached to be answered. `--summary FILE` before `--ros-args` leaves the figures of the run in a JSON file.
    """
    summary = None
    if "--summary" in arguments[:-1]:
        at = arguments.index("--summary")
        summary = Path(arguments[at + 1])
        arguments = arguments[:at] + arguments[at + 2 :]
    process = _Process(component_type, summary)
    try:
        try:
            return process.run(arguments)
        finally:
            process.stop.raises = False  # from here on nothing tears the clean-up apart
    except KeyboardInterrupt:
        return 0
    finally:
        process.end()


class _Process:
    """What a process holds from its start to its end."""

    def __init__(self, component_type: type[Component], summary: Path | None) -> None:
        self.stop = StopSignal(raises=True)
        self._component_type = component_type
        self._executable = component_type.__module__.rpartition(".")[2]
        self._summary = summary
        self._executor: Executor | None = None
        self._node: ComponentNode | None = None

    def run(self, arguments: list[str]) -> int:
        """Starts the node and lets it work; the exit code."""
        try:
            mission = mission_of_arguments(self._component_type, arguments)
            # Signals are handled here: rclpy would shut its context down with messages still waiting to be answered,
            # and an exception that a signal raises in a callback would pass through the executor's C++ frames.
            rclpy.init(args=[sys.argv[0], *arguments], signal_handler_options=SignalHandlerOptions.NO)
            self._executor = create_executor()
            self._node = create_node(self._component_type, self._executable, mission)
        except (MissionError, ParameterError) as error:
            return self._refuse(str(error))
        except (RCLError, RCLInvalidROSArgsError, UnknownROSArgsError) as error:
            return self._refuse(" ".join(str(error).split()))
        self._executor.add_node(self._node)
        if not self._node.start():
            return USAGE_ERROR
        self.stop.raises = False
        return self._spin(self._executor, self._node)

    def _refuse(self, reason: str) -> int:
        print(f"{self._executable}: {reason}", file=sys.stderr)
        return USAGE_ERROR

    def _spin(self, executor: Executor, node: ComponentNode) -> int:
        plant = node if isinstance(node, PlantNode) else None
        spin_until(executor, lambda: self.stop.came or (plant is not None and plant.done))
        if plant is not None:
            plant.halt()
            _spin_for(executor, _ANSWER_LIMIT, lambda: bool(plant.failed) or plant.answered)
            return 1 if plant.failed else 0
        _spin_for(executor, _DRAIN_LIMIT, _Quiet(node))
        return 0

    def end(self) -> None:
        """Gives everything up, the executor first: the middleware calls into it from threads of its own."""
        if self._node is not None:
            self._node.stop_listening()
        beat()
        if self._executor is not None:
            self._executor.shutdown()
        if self._node is not None:
            if self._summary is not None:
                self._summary.write_text(json.dumps(self._node.summary()), encoding="utf-8")
            self._node.finish()
            self._node.destroy_node()
        rclpy.try_shutdown()
        self.stop.ignore()


class _Quiet:
    """True once a node has had no cycle for a while."""

    def __init__(self, node: ComponentNode) -> None:
        self._node = node
        self._cycles = -1
        self._since = 0.0

    def __call__(self) -> bool:
        now, cycles = time.monotonic(), self._node.counters["cycles"]
        if cycles != self._cycles:
            self._cycles, self._since = cycles, now
        return now - self._since > _QUIET


def _spin_for(executor: Executor, seconds: float, done: Callable[[], bool]) -> None:
    limit = time.monotonic() + seconds
    spin_until(executor, lambda: done() or time.monotonic() > limit, interval=0.01)


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
    lines += [f"  {o.topic}  {type_name(o.message_type)}" for o in component_type.outputs(name, values)]
    lines += ["  /diagnostics  diagnostic_msgs/msg/DiagnosticArray", "", "Parameters (* may change in flight):"]
    for p in component_type.table():
        default = p.default if not (p.is_array and len(p.default) > 6) else f"{len(p.default)} values"
        lines.append(f"  {'*' if p.tunable else ' '}{p.name} = {default}")
        lines.append(f"      {p.description}; {p.expectation()}")
    return "\n".join(lines)
