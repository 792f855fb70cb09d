# SPDX-License-Identifier: Apache-2.0
"""A mission flown in one process: every node of the graph in one executor, real topics, the recorder included."""

import gc
import time
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from rclpy.context import Context
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

from css_bringup.flight_result import FlightResult, Progress, Stopped, as_flown
from css_bringup.incidents import node_incidents
from css_bringup.stand_ins import notes_of
from css_common.component import Component
from css_common.executor import create_executor, retire, spin_about_until, spin_until
from css_common.host import ComponentNode
from css_common.link_kinds import PROCESSES_FAIL
from css_common.mission import Mission
from css_common.mission_file import MissionError
from css_common.node_process import create_node
from css_common.output_port import OutputPort
from css_common.plant_host import PlantNode
from css_recording.recorder import RecorderNode

_PROGRESS_EVERY = 0.2


class ComposedFlight:
    """The nodes of a mission in one process.

    Use as a context manager: nodes exist inside it, `fly` may be called once, `nodes` are there to be inspected.
    """

    def __init__(
        self,
        mission: Mission,
        bag: Path | None = None,
        executor: str | None = None,
        *,
        overwrite: bool = False,
        stand_ins: Mapping[str, type[Component]] | None = None,
        guests: Iterable[Callable[[Context], Node]] = (),
    ) -> None:
        """Prepares a flight.

        Args:
            mission: what to fly.
            bag: where to record; None records nothing.
            executor: kind of executor, see `create_executor`.
            overwrite: replace a recording that is there.
            stand_ins: components in the place of those of some nodes, by name.
            guests: make further nodes in the context of the flight, which run beside those of the graph.

        Raises:
            MissionError: no node of the mission owns simulated time, or it has faults of processes.
        """
        if mission.plant is None:
            raise MissionError(f"{mission.origin}: no node of graph.nodes owns simulated time, nothing can fly")
        mission.refuse_faults(PROCESSES_FAIL, "process")
        self.mission = mission
        self.bag = bag
        self._plant_name = mission.plant.name
        self.context = Context()
        self.nodes: dict[str, ComponentNode] = {}
        self.recorder: RecorderNode | None = None
        self._executor_kind = executor
        self._overwrite = overwrite
        self._stand_ins = stand_ins or {}
        self._make_guests = guests
        self._guests: list[Node] = []

    def __enter__(self) -> "ComposedFlight":
        self.context.init()
        self.executor = create_executor(self._executor_kind, self.context)
        mission = as_flown(self.mission, recorded=self.bag is not None)
        if self.bag is not None:
            self.recorder = RecorderNode(
                self.mission,
                self.bag,
                overwrite=self._overwrite,
                in_flight=True,
                notes=notes_of(self._stand_ins),
                context=self.context,
                use_global_arguments=False,
            )
            self.executor.add_node(self.recorder)
        for node in mission.nodes:
            component = self._stand_ins.get(node.name, node.component)
            self.nodes[node.name] = create_node(
                component, node.name, mission, context=self.context, use_global_arguments=False
            )
            self.executor.add_node(self.nodes[node.name])
        for make in self._make_guests:
            self._guests.append(make(self.context))
            self.executor.add_node(self._guests[-1])
        return self

    def __exit__(self, *_: object) -> None:
        if self.recorder is not None:
            self.recorder.close()
        for node in (*self._guests, *self.nodes.values(), *filter(None, [self.recorder])):
            retire(self.executor, node)
        self.executor.shutdown()
        self.context.try_shutdown()

    @property
    def plant(self) -> PlantNode:
        """The node that owns simulated time."""
        node = self.nodes[self._plant_name]
        assert isinstance(node, PlantNode)
        return node

    def output_ports(self) -> dict[str, OutputPort]:
        """What the nodes publish now, by full name; any thread may ask."""
        return {port.full_name: port for node in list(self.nodes.values()) for port in list(node.output_ports.values())}

    def fly(self, progress: Progress | None = None, stopped: Stopped = lambda: False) -> FlightResult:
        """Flies the mission to its end, or until stopped or interrupted."""
        result = FlightResult(self.mission, bag=self.bag)
        for node in self.nodes.values():
            if node is not self.plant and not node.start():
                result.failure = f"{node.get_name()} did not start"
                return result
        if not self.plant.start():
            result.failure = f"{self.plant.get_name()} did not start"
            return result
        plant = self.plant
        try:
            recorder = self.recorder

            def over() -> bool:
                return plant.done or stopped() or (recorder is not None and bool(recorder.failure))

            # until the first step is out, partners are being matched: not part of the flight's time
            spin_until(self.executor, lambda: plant.begun or over(), context=self.context)
            gc.collect()
            gc.freeze()
            wall, cpu = time.perf_counter(), time.process_time()
            try:
                self._spin(over, progress)
            finally:
                result.wall_s = time.perf_counter() - wall
                result.cpu_s = time.process_time() - cpu
                gc.unfreeze()
            result.interrupted = not plant.done and stopped()
        except (KeyboardInterrupt, ExternalShutdownException):
            result.interrupted = True
        plant.halt()
        self._settle(result)
        return result

    def _settle(self, result: FlightResult) -> None:
        plant = self.plant
        result.failure = plant.failed
        flown_ns = plant.stamp_ns - self.mission.epoch_ns if plant.begun else -self.mission.period_ns
        result.steps = flown_ns // self.mission.period_ns + 1
        result.simulated_s = result.steps * self.mission.period_ns * 1e-9
        result.notes += node_incidents(self.mission, {n: node.health().counters for n, node in self.nodes.items()})
        if self.recorder is not None:
            self._drain(self.recorder)
            self.recorder.close(result.notes)
            result.notes += [f"recorder: {fault}" for fault in self.recorder.faults()]
            topics = {f"/{topic}" for topic in self.mission.topics}
            result.recorded = {t: n for t, n in self.recorder.counts.items() if t in topics}
            if self.recorder.failure:
                result.failure = f"the flight is not recorded any more: {self.recorder.failure}"
        result.note_losses()

    def _drain(self, recorder: RecorderNode) -> None:
        # what was published last is still on its way: take until nothing more comes
        before = -1
        while before != recorder.message_count:
            before = recorder.message_count
            for _ in range(20):
                self.executor.spin_once(timeout_sec=0.005)

    def _spin(self, done, progress: Progress | None) -> None:
        if progress is None:
            spin_about_until(self.executor, done, self.plant)
            return
        epoch, plant = self.mission.epoch_ns, self.plant
        due = 0.0

        def done_with_progress() -> bool:
            nonlocal due
            now = time.monotonic()
            if now > due:
                due = now + _PROGRESS_EVERY
                progress((plant.stamp_ns - epoch) * 1e-9 if plant.begun else 0.0)
            return done()

        spin_about_until(self.executor, done_with_progress, self.plant)
