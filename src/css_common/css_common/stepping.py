# SPDX-License-Identifier: Apache-2.0
"""Stepping a component: its values in force, active or idle, scripted events when they are due, checked messages out.

Live nodes, flights in one process and replay step components through this and nothing else, so that what happens to
a component in flight happens to it everywhere.
"""

import copy
import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from css_common.codec import Codec, Sample
from css_common.component import Component, Cycles, Outgoing, Output, Received, all_conflicts
from css_common.fault_lines import FAULTS
from css_common.link import GAP, Link, gap
from css_common.link_kinds import LINK_FAULTS
from css_common.message_columns import unstack
from css_common.mission import Event
from css_common.schema import ParameterError, shaped_values
from css_common.tree_codec import TreeCodec, encoder_of

# Times of events are decimal seconds, stamps whole nanoseconds.
_SLACK_S = 1e-9


def is_due(event: Event, elapsed_ns: int) -> bool:
    """Whether the time of a scripted event has come, so long after the mission's epoch [ns]."""
    return elapsed_ns / 1e9 >= event.time - _SLACK_S


def first_step(event: Event, period_ns: int) -> int:
    """Number of the first control cycle at which an event is due."""
    step = max(0, math.floor(event.time * 1e9 / period_ns) - 1)
    while not is_due(event, step * period_ns):
        step += 1
    return step


def conflict(
    component_type: type[Component], canonical: Mapping[str, Any], name: str, in_force: Mapping[str, Any] | None = None
) -> str | None:
    """The first thing that is wrong between values that are each sane, or None.

    Args:
        in_force: values of the same node that were checked before; their faults are not parsed again.
    """
    values = shaped_values(component_type.table(), canonical)
    lines = () if in_force is None else fault_lines_of(in_force)
    return next(all_conflicts(component_type, values, name, lines), None)


def fault_lines_of(canonical: Mapping[str, Any]) -> frozenset[str]:
    """The lines of all faults of a node."""
    return frozenset(line for p in (FAULTS, LINK_FAULTS) for line in canonical.get(p.name, ()))


class Port(NamedTuple):
    """Where messages of one output of a component go."""

    key: str
    topic: str
    codec: Codec | TreeCodec
    real_fields: list  # those that must be finite
    events: bool  # as of `Output`


def _finite_fields(codec: Codec | TreeCodec, output: Output) -> list:
    return [field for field in codec.real_fields() if field.name not in output.may_lack]


def _is_gap(given: Any) -> bool:
    return type(given) is Sample and given.frame_id == GAP


def _raise(error: Exception) -> None:
    raise error


class Stepper:
    """One component as it is stepped.

    Attributes:
        component: what is stepped.
        canonical: its values in force.
        ports: its outputs by key.
        dividers: every how many steps it gives a message of each output that is none of events.
        is_active: it cycles; else it is idle.
        perform: called with each event that is due; `apply` unless a host has its own way to do it.
        tuned: called after each change of values.
        failed: called with what the component raises when it takes new values; raises it unless replaced.
        link: the way of its messages.
        skipped: cycles that there were not, because a message did not come.
        withheld: called with topic and field of a message that is not finite and therefore does not go out.
    """

    def __init__(
        self,
        component_type: type[Component],
        name: str,
        canonical: Mapping[str, Any],
        events: Iterable[Event] = (),
        epoch_ns: int = 0,
    ) -> None:
        """Builds the component, active.

        Args:
            component_type: what to step.
            name: of its node.
            canonical: checked values of all its parameters.
            events: scripted changes; those of other nodes are left out.
            epoch_ns: stamp from which events count.
        """
        self.canonical = dict(canonical)
        self.component = component_type(name, shaped_values(component_type.table(), self.canonical))
        self.ports = {
            output.key: Port(output.key, output.topic, codec, _finite_fields(codec, output), output.events)
            for output in component_type.all_outputs(name, self.component.values)
            for codec in (encoder_of(output.message_type),)
        }
        self._required = {i.key: i.divider for i in component_type.inputs(name, self.component.values) if i.required}
        self.dividers = {
            o.key: o.divider for o in component_type.all_outputs(name, self.component.values) if not o.events
        }
        self.link = Link(self.component, component_type.link_units(name, self.component.values))
        self.is_active = True
        self.perform: Callable[[Event], None] = self.apply
        self.tuned: Callable[[], None] = lambda: None
        self.failed: Callable[[Exception], None] = _raise
        self.withheld: Callable[[str, str], None] = lambda topic, field: None
        self.skipped = 0
        self._begins_anew = False
        self._epoch_ns = epoch_ns
        self._waiting = deque(event for event in events if event.node == name)

    def step(self, stamp_ns: int, received: Received) -> Outgoing:
        """What the component gives at a stamp, after the events that are due by then."""
        if self._waiting:
            self.apply_due(stamp_ns)
        component = self.component
        for given in received.values():
            if type(given) is Sample and given.frame_id == GAP:
                received = {key: None if _is_gap(one) else one for key, one in received.items()}
                if self._lacks(component.step_of(stamp_ns), received):
                    self.skipped += 1
                    return self.gaps(stamp_ns)
                break
        return (component.cycle if self.is_active else component.idle)(stamp_ns, received)

    def _lacks(self, step: int, received: Received) -> bool:
        """Whether there is no cycle because a message that it needs did not come."""
        return any(step % divider == 0 and received.get(key) is None for key, divider in self._required.items())

    def gaps(self, stamp_ns: int) -> Outgoing:
        """Gaps in the place of the messages of a cycle that there is not."""
        step = self.component.step_of(stamp_ns)
        due = (key for key, divider in self.dividers.items() if step % divider == 0)
        return {key: gap(self.ports[key], stamp_ns) for key in due}

    def is_quiet(self, stamp_ns: int) -> bool:
        """It cycles, its messages pass as they are, and no event is due up to a stamp."""
        return (
            self.is_active
            and self.link.is_quiet
            and not (self._waiting and is_due(self._waiting[0], stamp_ns - self._epoch_ns))
        )

    @property
    def offers_steps(self) -> bool:
        """The component can be stepped many times at once, by the class that says what one cycle is."""
        known = {"cycle", "cycle_through"}
        nearest = next(kind for kind in type(self.component).__mro__ if known & vars(kind).keys())
        return nearest is not Component and "cycle_through" in vars(nearest)

    def steps(self, cycles: Cycles) -> list[tuple[Port, list[tuple[int, bytes]]]] | None:
        """What the component gives at many quiet steps: stamp and serialised message of each, by output.

        None: it has to be stepped one by one, from where it was before.
        """
        outgoing = self.component.cycle_through(cycles)
        if outgoing is None:
            return None
        given = []
        for key, columns in outgoing.items():
            port = self.ports[key]
            assert isinstance(port.codec, Codec), f"{port.topic}: steps at once give messages of numbers alone"
            if not all(np.all(np.isfinite(getattr(columns, field.name))) for field in port.real_fields):
                return None
            messages = unstack(port.codec, self.component.frames[key], columns)
            given.append((port, list(zip(columns.stamp_ns.tolist(), messages, strict=True))))
        return given

    def checked(self, outgoing: Outgoing) -> Iterator[tuple[Port, Sample]]:
        """The messages that may go out, each with its port: those without NaN or infinity."""
        for key, given in outgoing.items():
            port = self.ports[key]
            for sample in given if isinstance(given, tuple) else (given,):
                bad = port.codec.first_not_finite(port.real_fields, sample)
                if bad is None:
                    yield port, sample
                else:
                    self.withheld(port.topic, bad)

    def sent(self, stamp_ns: int, outgoing: Outgoing) -> Iterator[tuple[Port, Sample, bytes]]:
        """What goes out at a stamp, in its order: the messages that may, and what becomes of them on their way."""
        link = self.link
        if not (link.faults or link.tells or link.held):  # as nearly always
            for port, sample in self.checked(outgoing):
                yield port, sample, port.codec.encode(sample)
            return
        told = link.told(stamp_ns)
        messages = self.checked({**outgoing, **told} if told else outgoing)
        for port, sample in self.link.carry(stamp_ns, messages):
            yield port, sample, port.codec.encode(sample)

    def apply_due(self, stamp_ns: int) -> None:
        """Performs the events that are due at a stamp, each once and in their order."""
        elapsed_ns = stamp_ns - self._epoch_ns
        while self._waiting and is_due(self._waiting[0], elapsed_ns):
            self.perform(self._waiting.popleft())

    def apply(self, event: Event) -> None:
        """Does what an event says.

        Raises:
            ParameterError: the value that it sets conflicts with others.
        """
        if event.action == "set":
            self.set_values({event.parameter: event.value})
        elif event.action == "deactivate":
            self.deactivate()
        elif not self.is_active:
            self.activate()

    def activate(self) -> bool:
        """Begins to cycle, from a fresh state if it was deactivated before; whether it was."""
        begins_anew, self._begins_anew = self._begins_anew, False
        if begins_anew:
            self.component.configure()
        self.is_active = True
        return begins_anew

    def deactivate(self) -> None:
        """Stops cycling; what the component publishes while idle goes on."""
        self.is_active = False
        self._begins_anew = True

    def snapshot(self) -> Any:
        """All that the coming steps hang on, for `restore`."""
        return copy.deepcopy(self._memory()), self.link.memory()

    def restore(self, snapshot: Any) -> None:
        """Goes back to a snapshot, which may be used again; it may be that of another stepper of the same kind."""
        memory, link = snapshot
        state, self.canonical, self.is_active, self._begins_anew, self._waiting = copy.deepcopy(memory)
        # the component stays the one that others know
        vars(self.component).clear()
        vars(self.component).update(state)
        self.link.recall(link)
        self.tuned()

    def _memory(self) -> tuple:
        return vars(self.component), self.canonical, self.is_active, self._begins_anew, self._waiting

    def set_values(self, changes: Mapping[str, Any]) -> None:
        """Changes some parameters, if they agree with the others.

        Raises:
            ParameterError: they do not; nothing changes.
        """
        reason = self.refusal({**self.canonical, **changes})
        if reason is not None:
            raise ParameterError(reason)
        self.tune(changes)

    def refusal(self, canonical: Mapping[str, Any]) -> str | None:
        """Why it cannot take values that are each sane: the first thing that is wrong between them, or None."""
        reason = conflict(type(self.component), canonical, self.component.name, self.canonical)
        return reason or self.component.untimely(shaped_values(self.component.table(), canonical))

    def tune(self, changes: Mapping[str, Any]) -> None:
        """Gives the component new values, which are known to be sane; its state stays."""
        self.canonical.update(changes)
        try:
            self.component.tune(shaped_values(self.component.table(), self.canonical))
            self.link.take()
        except Exception as error:
            self.failed(error)
        self.tuned()
