# SPDX-License-Identifier: Apache-2.0
"""The process of one node: command line, mission, ROS start, clean end."""

import json
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import rclpy
from rclpy.executors import Executor
from rclpy.signals import SignalHandlerOptions

from css_common.command import FAILED, USAGE, complain
from css_common.component import Component, Plant
from css_common.device import Device
from css_common.device_host import DeviceNode
from css_common.executor import create_executor, spin_until
from css_common.host import ComponentNode
from css_common.mission import Mission
from css_common.mission_file import MissionError
from css_common.node_arguments import mission_of_arguments, parse_arguments
from css_common.node_help import describe
from css_common.plant_host import PlantNode
from css_common.preflight import preflight, report
from css_common.rcl_errors import REFUSALS, explained, in_own_words
from css_common.ros_internals import overrides_of
from css_common.schema import ParameterError, nearest, shown
from css_common.stop_signal import StopSignal
from css_common.supervised import beat

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
    host: type[ComponentNode] = ComponentNode
    if issubclass(component_type, Plant):
        host = PlantNode
    elif issubclass(component_type, Device):
        host = DeviceNode
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
            node = self._create(arguments)
        except (MissionError, ParameterError) as error:
            return self._refuse(str(error))
        except REFUSALS as error:
            return self._refuse(explained(error))
        if not node.start():
            return USAGE if node.refused else FAILED
        for remark in _unused_overrides(node):
            node.get_logger().warning(remark)
        self.stop.raises = False
        assert self._executor is not None
        return self._spin(self._executor, node)

    def _create(self, arguments: list[str]) -> ComponentNode:
        others = parse_arguments(self._executable, arguments).others
        if others:
            raise ParameterError(f"{shown(others[0])}: unknown, expected --help, --summary FILE or --ros-args ...")
        if self._summary is not None and not self._summary.parent.is_dir():
            raise ParameterError(f"--summary {self._summary}: there is no such folder")
        mission = mission_of_arguments(self._component_type, arguments)
        # whoever owns time answers for the whole flight, every other node for itself
        whole = issubclass(self._component_type, Plant)
        report(preflight(mission, None if whole else self._component_type))
        # Signals are handled here: rclpy would shut its context down with messages still waiting to be answered,
        # and an exception that a signal raises in a callback would pass through the executor's C++ frames.
        with in_own_words():
            rclpy.init(args=[sys.argv[0], *arguments], signal_handler_options=SignalHandlerOptions.NO)
        try:
            self._executor = create_executor()
        except ValueError as error:
            raise ParameterError(str(error)) from error
        node = create_node(self._component_type, self._executable, mission)
        self._executor.add_node(node)
        self._node = node  # from here on it is given up at the end, whatever comes
        node.check()
        for remark in mission.remarks:
            node.get_logger().warning(remark)
        return node

    def _refuse(self, reason: str) -> int:
        complain(self._executable, reason)
        return USAGE

    def _spin(self, executor: Executor, node: ComponentNode) -> int:
        plant = node if isinstance(node, PlantNode) else None
        spin_until(executor, lambda: self.stop.came or (plant is not None and plant.done))
        if plant is not None:
            plant.halt()
            _spin_for(executor, _ANSWER_LIMIT, lambda: bool(plant.failed) or plant.answered)
            return FAILED if plant.failed else 0
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


def _unused_overrides(node: ComponentNode) -> Iterator[str]:
    """Overrides of a quality of service that none of the node's topics has."""
    known = [name for name in node.get_parameters_by_prefix("") if name.startswith("qos_overrides.")]
    for name in overrides_of(node):
        if name.startswith("qos_overrides.") and name not in known:
            near = nearest(name, known)
            yield f"{name}: no topic of this node has it" + (f"; did you mean {near}?" if near else "")


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
