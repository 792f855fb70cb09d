# SPDX-License-Identifier: Apache-2.0
"""One estimator in a replay: from which node of the flight it comes, what is changed in it, what it gave."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from css_bringup.comparison import Comparison
from css_bringup.estimator_request import EstimatorRequest
from css_bringup.flight_changes import ParameterChange, settings_in_flight
from css_bringup.retracing import Given, Retrace
from css_common.component import Cycles, Input, Output, Received
from css_common.matching import Matcher
from css_common.mission import Event, Mission, find_component
from css_common.mission_file import MissionError
from css_common.mission_node import Node
from css_common.schema import shaped_values
from css_common.sensor_inputs import uses_gyro
from css_common.stepping import Stepper
from css_recording.bag_metadata import absolute
from css_recording.parameter_events import RecordedSetting

ESTIMATORS = "css_estimation"


@dataclass
class Replayed:
    """One estimator in a replay.

    Attributes:
        label: its name in the new recording.
        changed: what was asked of it besides its gyro, as KEY=VALUE,...
        node: its component and values.
        flown: the node of the flight that it comes from; None: it did not fly.
        epoch_ns: stamp from which events count.
        flew_so: it flew, with the same parameters and the same changes to them.
        script: events that happen to it, addressed to its own name.
        changes: parameters that were set in flight.
        present: keys of those that the recording has.
        comparison: against the flight; None when there is nothing to compare with.
        messages: estimates given.
        failures: cycles that failed and messages withheld.
        notes: what happened to it in flight, and what of that was left out, one line each.
    """

    label: str
    changed: str
    node: Node
    flown: Node | None
    epoch_ns: int
    flew_so: bool = False
    script: list[Event] = field(default_factory=list)
    changes: list[ParameterChange] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    present: tuple[str, ...] = ()
    comparison: Comparison | None = None
    messages: int = 0
    failures: int = 0

    @property
    def inputs(self) -> tuple[Input, ...]:
        """What it listens to: the inputs that it heeds at some time of the flight."""
        heeded: dict[str, Input] = {}
        canonical = dict(self.node.canonical)
        settings = [{e.parameter: e.value} for e in self.script if e.action == "set"]
        for values in ({}, *settings, *(change.values for change in self.changes)):
            canonical |= values
            shaped = shaped_values(self.node.component.table(), canonical)
            for source in self.node.component.inputs(self.label, shaped):
                if source.heeded:
                    heeded.setdefault(source.key, source)
        return tuple(heeded.values())

    @property
    def flown_outputs(self) -> tuple[Output, ...]:
        """What the node that flew published."""
        return self.flown.outputs if self.flown is not None else ()

    def begin(self, report: Callable[[str], None]) -> None:
        """Builds the component; what goes wrong in it from now on is reported, each kind once."""
        self._report = report
        self.stepper = self._new_stepper()
        self.topics = {key: absolute(port.topic) for key, port in self.stepper.ports.items()}
        # those that are not heeded at first belong to the matching too
        sources = self.node.component.inputs(self.label, self.node.values)
        self.matcher = Matcher(self.stepper.component, sources, self.present)
        self.stepper.tuned = self.matcher.retune
        self.retrace = Retrace(self.stepper, self.comparison, self.changes, self._new_stepper)

    def step(self, stamp_ns: int, received: Mapping[str, Any]) -> Given:
        """The messages of a step; none when the cycle fails, as in flight."""
        try:
            given = self.retrace.step(stamp_ns, received)
        except Exception as error:  # no estimate for this stamp, and the next cycle goes on
            self._note_failure(f"cycle failed: {error!r}")
            return []
        for port, sample, data in given:
            if port.events:
                continue
            self.messages += 1
            if self.comparison is not None:
                self.comparison.add(sample.stamp_ns, data)
        return given

    def is_quiet(self, stamp_ns: int) -> bool:
        """Nothing happens to it up to a stamp, as far as is known."""
        return self.retrace.is_quiet(stamp_ns)

    def steps(self, cycles: Cycles, received: Callable[[int], Received]) -> Iterator[tuple[int, str, int, bytes]]:
        """The messages of many quiet steps, at once or one by one: number of the step, topic, stamp and message.

        Args:
            cycles: the steps.
            received: inputs of one of them.
        """
        given = self.retrace.steps(cycles, received)
        if given is None:
            for step, stamp_ns in enumerate(cycles.stamps_ns.tolist()):
                for port, sample, data in self.step(stamp_ns, received(step)):
                    yield step, self.topics[port.key], sample.stamp_ns, data
            return
        for port, messages in given:
            self.messages += len(messages)
            topic = self.topics[port.key]
            for step, (stamp_ns, data) in enumerate(messages):
                if self.comparison is not None:
                    self.comparison.add(stamp_ns, data)
                yield step, topic, stamp_ns, data

    def finish(self) -> None:
        """Closes the books at the end of the recording."""
        self.matcher.give_up()
        self.retrace.finish()
        warning = self.stepper.component.standing().warning
        self.notes += [warning] if warning else []
        self.notes += self.retrace.notes
        self.notes += [
            f"{change.text()} was set about stamp {change.stamp_ns} ns; the step was not found, "
            "estimates from there on may differ"
            for change in self.retrace.unplaced
        ]

    def _new_stepper(self) -> Stepper:
        stepper = Stepper(self.node.component, self.label, self.node.canonical, self.script, self.epoch_ns)
        stepper.failed = lambda error: self._note_failure(f"a change of parameters failed: {error!r}")
        stepper.withheld = lambda topic, name: self._note_failure(f"{name} is not finite, message withheld")
        return stepper

    def _note_failure(self, text: str) -> None:
        self.failures += 1
        if self.failures == 1:
            self._report(f"{self.label}: {text} (further ones are counted, not reported)")


def replayed(
    request: EstimatorRequest,
    mission: Mission,
    flown_mission: Mission,
    settings: Iterable[RecordedSetting],
    overridden: frozenset[str],
) -> Replayed:
    """What a request asks for.

    Scripted events and parameters set in flight happen to the replay of the node that they were addressed to, and to
    nobody else's. A parameter that was asked for keeps its value over them.

    Args:
        request: the estimator.
        mission: its parameters and events.
        flown_mission: those of the flight.
        settings: parameters that were set in flight.
        overridden: keys of the mission that were asked for.

    Raises:
        MissionError: the estimator or one of its parameters is unknown.
    """
    base = _node(mission, request.kind)
    node = _node_with(mission, base, request)
    flown = _node(flown_mission, request.kind)
    changed = ",".join(f"{key}={value}" for key, value in request.changes.items() if key != "use_gyro")
    run = Replayed(request.label, changed, node, flown, mission.epoch_ns)
    if base is None:
        return run
    pinned = {*request.changes, *(key.removeprefix(f"{base.name}.") for key in overridden)}
    if flown is not None:
        pinned |= {key for key, value in node.canonical.items() if flown.canonical.get(key) != value}
    took_script = _take_script(run, [e for e in mission.events if e.node == base.name], pinned)
    in_flight = settings_in_flight(settings, base.name, base.component.table(), flown_mission.events)
    took_settings = _take_settings(run, in_flight, pinned)
    run.flew_so = (
        flown is not None
        and node.canonical == flown.canonical
        and _script_of(mission, base.name) == _script_of(flown_mission, base.name)
        and took_script
        and took_settings
    )
    return run


def _node(mission: Mission, name: str) -> Node | None:
    return next((n for n in mission.nodes if n.name == name and n.package == ESTIMATORS), None)


def _node_with(mission: Mission, base: Node | None, request: EstimatorRequest) -> Node:
    """The node that is asked for: that of the mission, or one more, with what is to be changed."""
    component = find_component(ESTIMATORS, request.kind, "replay") if base is None else base.component
    if "use_gyro" in request.changes and not uses_gyro(component):
        raise MissionError(f"estimator {request.kind}: gyro given, but it uses none; expected no gyro=on or gyro=off")
    if base is not None:
        changed = mission.with_node((base.package, base.executable, base.name), request.changes)
        return changed.node(base.name) if request.changes else base
    if not request.changes:
        return mission.node_of(component, request.kind)
    return mission.with_node((ESTIMATORS, request.kind, request.kind), request.changes).node(request.kind)


def _script_of(mission: Mission, node: str) -> list[tuple]:
    return [(e.time, e.action, e.parameter, e.value) for e in mission.events if e.node == node]


def _take_script(run: Replayed, events: Iterable[Event], pinned: set[str]) -> bool:
    """Gives a run the events of its node, addressed to it; False when some are left out."""
    took_all = True
    for event in events:
        what = f"event {event.name} at {event.time:g} s, {event.action} {event.parameter}".rstrip()
        if event.action == "set" and event.parameter in pinned:
            run.notes.append(f"{what}: left out, {event.parameter} keeps the value that was asked for")
            took_all = False
        else:
            run.script.append(replace(event, node=run.label))
            run.notes.append(f"{what}: as in flight")
    return took_all


def _take_settings(run: Replayed, changes: Iterable[ParameterChange], pinned: set[str]) -> bool:
    """Gives a run the parameters that were set in flight; False when some are left out."""
    took_all = True
    for change in changes:
        kept = {key: value for key, value in change.values.items() if key not in pinned}
        for key in change.values.keys() - kept.keys():
            run.notes.append(
                f"{key}={change.values[key]}, set in flight about stamp {change.stamp_ns} ns: left out, {key} keeps "
                "the value that was asked for"
            )
            took_all = False
        if kept:
            run.changes.append(change._replace(values=kept))
    return took_all
