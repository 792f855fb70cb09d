# SPDX-License-Identifier: Apache-2.0
"""Flies a mission in this process, without ROS: the components that fly on topics, called one after the other.

Sample sensors, estimate, control, propagate: the order follows from who listens to whom. A component gets the
same values as from its topics, so the flight is the same as that of the composed graph.
"""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from css_analysis.flight_log import FlightLog
from css_analysis.flight_topics import LOGGED_TYPES, TOLD_TYPES
from css_common.codec import Sample, codec_of
from css_common.component import Outgoing, Plant
from css_common.link_kinds import MESSAGES_FAIL, SORTS
from css_common.message_columns import Columns
from css_common.mission import Mission, MissionError
from css_common.mission_node import Node
from css_common.preflight import preflight, report
from css_common.schema import unknown_name
from css_common.stepping import Stepper
from css_monte_carlo.flight_threads import go_on_if_waited_for


def fly_directly(mission: Mission) -> FlightLog:
    """Flies a mission to its end, after the checks before a flight; the log holds what a recording of it would.

    Raises:
        MissionError: the mission has no plant, or its nodes wait for each other in a circle.
    """
    report(preflight(mission))
    return fly_checked(mission)


def fly_checked(mission: Mission) -> FlightLog:
    """As `fly_directly`, for a mission that has passed the checks before a flight."""
    steps = max(mission.steps, 1)
    wires: dict[str, _Wire | _Tape] = {
        topic: _Wire(kind, steps) if kind in _LOGGED else _Tape(kind, keep=kind in TOLD_TYPES)
        for topic, kind in mission.topics.items()
    }
    _fly(mission, wires)
    log = FlightLog(f"{mission.name}_{mission.values.mission.case}", mission)
    for topic, wire in wires.items():
        if isinstance(wire, _Wire):
            log.add(f"/{topic}", mission.topics[topic], wire.columns())
    for topic, wire in sorted(wires.items()):
        if isinstance(wire, _Tape):
            log.tell(f"/{topic}", mission.topics[topic], wire.samples)
    return log


def fly_and_keep(mission: Mission, topics: Iterable[str]) -> dict[str, list[Sample]]:
    """Flies a mission to its end; gives all messages of some topics, of any type.

    Raises:
        MissionError: the mission has no plant or not these topics, or its nodes wait for each other in a circle.
    """
    report(preflight(mission))
    kept = list(topics)
    for topic in kept:
        if topic not in mission.topics:
            raise MissionError(f"{mission.origin}: topic {unknown_name(topic, mission.topics)}")
    wires = {topic: _Tape(kind, keep=topic in kept) for topic, kind in mission.topics.items()}
    _fly(mission, wires)
    return {topic: wires[topic].samples for topic in kept}


def refuse_what_needs_the_graph(mission: Mission) -> None:
    """Refuses faults of messages, clocks and processes, which there are none of here.

    Raises:
        MissionError: the mission has one.
    """
    mission.refuse_faults(MESSAGES_FAIL, *SORTS)


def _fly(mission: Mission, wires: "Wires") -> None:
    refuse_what_needs_the_graph(mission)
    *others, plant = [_Part(node, mission) for node in _in_order(mission)]
    stamp_ns = mission.epoch_ns
    plant.stepper.apply_due(stamp_ns)
    clockwork = plant.stepper.component
    assert isinstance(clockwork, Plant)
    outgoing = clockwork.begin()
    while not clockwork.finished:
        go_on_if_waited_for()
        bus: dict[str, Sample] = {}
        plant.publish(outgoing, wires, bus)
        for part in others:
            part.answer(stamp_ns, wires, bus)
        outgoing = clockwork.cycle(stamp_ns, plant.received(bus))
        stamp_ns += mission.period_ns
        plant.stepper.apply_due(stamp_ns)


class _Wire:
    """One topic: writes its messages into columns and hands them to the listeners of the same step.

    Listeners see the kinds and shapes that a decoded message has, and a sender may reuse its arrays.
    """

    def __init__(self, message_type: type, messages: int) -> None:
        self._fields = codec_of(message_type).fields
        self._stamp_ns = np.zeros(messages, dtype=np.int64)
        self._columns: list[tuple[str, np.ndarray, bool]] = []  # name, column, whether it holds arrays
        self._count = 0

    def carry(self, sample: Sample) -> Sample:
        """The message as a listener gets it."""
        given, at = sample.__dict__, self._count
        if at == 0:
            self._allocate(given)
        heard = Sample.__new__(Sample)
        fields = heard.__dict__
        fields["stamp_ns"] = self._stamp_ns[at] = sample.stamp_ns
        fields["frame_id"] = sample.frame_id
        for name, column, holds_arrays in self._columns:
            column[at] = value = given[name]
            fields[name] = column[at] if holds_arrays else value
        self._count = at + 1
        return heard

    def columns(self) -> Columns:
        """What was carried."""
        fields = {name: column[: self._count] for name, column, _ in self._columns}
        return Columns(self._stamp_ns[: self._count], **fields)

    def _allocate(self, first: Mapping[str, Any]) -> None:
        rows = len(self._stamp_ns)
        for field in self._fields:
            shape = (rows,) if field.count is None else (rows, field.count or len(first[field.name]))
            self._columns.append((field.name, np.zeros(shape, field.dtype), field.count is not None))


class _Tape:
    """One topic whose messages are handed on as they are, and kept when they are asked for."""

    def __init__(self, message_type: type, keep: bool) -> None:
        self._fields = codec_of(message_type).fields
        self._keep = keep
        self.samples: list[Sample] = []

    def carry(self, sample: Sample) -> Sample:
        """The message as a listener gets it."""
        heard = Sample(sample.stamp_ns, sample.frame_id)
        for field in self._fields:
            value = getattr(sample, field.name)
            # a sender may reuse its arrays
            heard.__dict__[field.name] = value if field.count is None else np.array(value, field.dtype).ravel()
        if self._keep:
            self.samples.append(heard)
        return heard


Wires = Mapping[str, _Wire | _Tape]
_LOGGED = frozenset(LOGGED_TYPES.values())


class _Part:
    """A component of the flight with its wiring."""

    def __init__(self, node: Node, mission: Mission) -> None:
        self.stepper = Stepper(node.component, node.name, node.canonical, mission.events, mission.epoch_ns)
        self._inputs = [(i.key, i.topic) for i in node.inputs]
        self._required = [(i.topic, i.divider) for i in node.inputs if i.required]

    def answer(self, stamp_ns: int, wires: Wires, bus: dict[str, Sample]) -> None:
        """One cycle; none when an input that is due did not come."""
        for topic, divider in self._required:
            if topic not in bus and self.stepper.component.step_of(stamp_ns) % divider == 0:
                return
        self.publish(self.stepper.step(stamp_ns, self.received(bus)), wires, bus)

    def received(self, bus: Mapping[str, Sample]) -> dict[str, Sample | None]:
        """The inputs of the step, None for what did not come."""
        return {key: bus.get(topic) for key, topic in self._inputs}

    def publish(self, outgoing: Outgoing, wires: Wires, bus: dict[str, Sample]) -> None:
        """Send what a component gave."""
        for port, sample in self.stepper.checked(outgoing):
            bus[port.topic] = wires[port.topic].carry(sample)


def _in_order(mission: Mission) -> list[Node]:
    """Nodes such that each comes after those it listens to; the plant, which begins the step, comes last."""
    plant = mission.plant
    if plant is None:
        raise MissionError(f"{mission.origin}: no node of graph.nodes owns simulated time, nothing can fly")
    known = {output.topic for output in plant.outputs}
    waiting = [node for node in mission.nodes if node is not plant]
    published = set(mission.topics)
    order: list[Node] = []
    while waiting:
        ready = [n for n in waiting if all(i.topic in known or i.topic not in published for i in n.inputs)]
        if not ready:
            names = ", ".join(node.name for node in waiting)
            raise MissionError(f"{mission.origin}: {names} wait for each other, no order of calls serves them")
        for node in ready:
            known.update(output.topic for output in node.outputs)
            waiting.remove(node)
        order += ready
    return [*order, plant]
