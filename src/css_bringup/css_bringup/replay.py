# SPDX-License-Identifier: Apache-2.0
"""Replay: a recording read once, stepped through any set of estimators, compared.

No topics and no clock: the components that fly are stepped directly, with the same checks at the edge and the same
matching of stamps. The estimator that flew therefore gives the same bytes again.
"""

import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from css_common.codec import Codec, Sample, codec_of
from css_common.component import Component, Input, messages_of
from css_common.edge import Edge, Matcher
from css_common.mission import Mission, Node, find_component
from css_common.mission_file import MissionError
from css_recording.bag_metadata import Topic, absolute
from css_recording.bag_reader import BagReader
from css_recording.bag_writer import BagWriter

ESTIMATORS = "css_estimation"
_GYRO = {"on": "true", "off": "false"}


@dataclass(frozen=True)
class EstimatorRequest:
    """An estimator to replay: which, under what name, with which parameters changed."""

    label: str
    kind: str
    changes: Mapping[str, str]


def parse_request(text: str) -> EstimatorRequest:
    """A request from `NAME[:KEY=VALUE[,KEY=VALUE]...]`; `gyro=on|off` is short for `use_gyro`.

    Raises:
        MissionError: the text has another form.
    """
    kind, _, rest = text.partition(":")
    changes: dict[str, str] = {}
    label = [kind]
    for item in filter(None, rest.split(",")):
        key, separator, value = item.partition("=")
        if not separator:
            raise MissionError(f"estimator {text!r}: {item!r} given, expected KEY=VALUE")
        if key == "gyro":
            if value not in _GYRO:
                raise MissionError(f"estimator {text!r}: gyro={value} given, expected on or off")
            changes["use_gyro"] = _GYRO[value]
        else:
            changes[key] = value
        label.append("".join(c if c.isalnum() else "_" for c in f"{key}_{value}"))
    if not kind.isidentifier():
        raise MissionError(f"estimator {text!r} given, expected NAME[:KEY=VALUE,...]")
    return EstimatorRequest("_".join(label), kind, changes)


class Comparison:
    """Bytes that flew against bytes that the replay gives, matched by stamp."""

    def __init__(self) -> None:
        self.compared = 0
        self.different: list[int] = []
        self._flown: dict[int, bytes] = {}
        self._replayed: dict[int, bytes] = {}

    def add_flown(self, stamp_ns: int, data: bytes) -> None:
        """Takes a message of the flight."""
        self._match(stamp_ns, data, self._flown, self._replayed)

    def add_replayed(self, stamp_ns: int, data: bytes) -> None:
        """Takes a message of the replay."""
        self._match(stamp_ns, data, self._replayed, self._flown)

    @property
    def unmatched(self) -> int:
        """Messages that only one side has."""
        return len(self._flown) + len(self._replayed)

    @property
    def identical(self) -> bool:
        """Every message of both sides is the same to the byte."""
        return self.compared > 0 and not self.different and not self.unmatched

    def _match(self, stamp_ns: int, data: bytes, own: dict[int, bytes], other: dict[int, bytes]) -> None:
        counterpart = other.pop(stamp_ns, None)
        if counterpart is None:
            own[stamp_ns] = data
            return
        self.compared += 1
        if counterpart != data:
            self.different.append(stamp_ns)


@dataclass
class Replayed:
    """One estimator in a replay.

    Attributes:
        label: its name in the new recording.
        changed: what was asked of it besides its gyro, as KEY=VALUE,...
        node: its component and values.
        component: the component being stepped.
        matcher: brings its inputs together.
        comparison: against the flight; None when it did not fly with these parameters.
        messages: estimates given.
        failures: cycles that failed and messages withheld.
    """

    label: str
    changed: str
    node: Node
    component: Component
    matcher: Matcher
    comparison: Comparison | None = None
    messages: int = 0
    failures: int = 0
    outputs: dict[str, tuple[str, Codec]] = field(default_factory=dict)


class Replay:
    """Steps estimators over a recording."""

    def __init__(self, reader: BagReader, mission: Mission, requests: Iterable[EstimatorRequest]) -> None:
        """Builds the estimators.

        Args:
            reader: the recording, its topics renamed to those of the graph.
            mission: values for the estimators; that of the recording if it has one.
            requests: what to replay.

        Raises:
            MissionError: an estimator is unknown, a parameter is, or the recording lacks its inputs.
        """
        self.reader = reader
        self.mission = mission
        self.reports: list[str] = []
        self.runs: list[Replayed] = []
        self._recorded = {entry.topic.name: entry.topic.type for entry in reader.topics if entry.count}
        self._listeners: dict[str, list[tuple[Edge, list[Replayed]]]] = {}
        self._flown: dict[str, Comparison] = {}
        for request in requests:
            self._add(request)

    @property
    def rejected(self) -> dict[str, dict[str, int]]:
        """Messages refused at the edge, by topic and kind."""
        return {
            topic: dict(edge.rejected)
            for topic, listeners in self._listeners.items()
            for edge, _ in listeners
            if edge.rejected
        }

    def run(self, writer: BagWriter | None, copied: Iterable[str] = ("/truth",)) -> float:
        """Reads the recording once; returns the processor time of reading and stepping [s].

        Args:
            writer: takes the estimates and copies of `copied` topics; None only compares.
            copied: absolute names of topics to copy; those that the recording lacks are left out.
        """
        copied = frozenset(copied) & self._recorded.keys()
        if writer is not None:
            self._announce(writer, copied)
        started = time.process_time()
        for message in self.reader.messages({*self._listeners, *copied, *self._flown} & self._recorded.keys()):
            if writer is not None and message.topic in copied:
                writer.write(message.topic, message.stamp_ns, message.data)
            if message.topic in self._flown:
                self._flown[message.topic].add_flown(message.stamp_ns, message.data)
            for edge, runs in self._listeners.get(message.topic, ()):
                sample = edge.accept(message.data)
                if sample is None:
                    continue
                for run in runs:
                    for stamp_ns, received in run.matcher.offer(edge.source.key, sample):
                        self._step(run, stamp_ns, received, writer)
        return time.process_time() - started

    def _step(
        self, run: Replayed, stamp_ns: int, received: Mapping[str, Sample | None], writer: BagWriter | None
    ) -> None:
        try:
            outgoing = run.component.cycle(stamp_ns, received)
        except Exception as error:  # as in flight: no estimate for this stamp, and the next cycle goes on
            self._note_failure(run, f"cycle failed: {error!r}")
            return
        for key, sample in messages_of(outgoing):
            topic, codec = run.outputs[key]
            bad = codec.first_not_finite(codec.real_fields(), sample)
            if bad is not None:
                self._note_failure(run, f"{bad} is not finite, message withheld")
                continue
            data = codec.encode(sample)
            run.messages += 1
            if writer is not None:
                writer.write(topic, sample.stamp_ns, data)
            if run.comparison is not None:
                run.comparison.add_replayed(sample.stamp_ns, data)

    def _note_failure(self, run: Replayed, text: str) -> None:
        run.failures += 1
        if run.failures == 1:
            self.reports.append(f"{run.label}: {text} (further ones are counted, not reported)")

    def _announce(self, writer: BagWriter, copied: Iterable[str]) -> None:
        for topic in sorted(copied):
            writer.add_topic(Topic(topic, self._recorded[topic]))
        for run in self.runs:
            for topic, codec in run.outputs.values():
                writer.add_topic(Topic(topic, codec.type_name))

    def _add(self, request: EstimatorRequest) -> None:
        if any(run.label == request.label for run in self.runs):
            raise MissionError(f"estimator {request.label} is asked for twice")
        flown = next((n for n in self.mission.nodes if n.name == request.kind and n.package == ESTIMATORS), None)
        base = flown or self.mission.node_of(find_component(ESTIMATORS, request.kind, "replay"), request.kind)
        node = self._changed(base, request) if request.changes else base
        component = base.component(request.label, node.values)
        inputs = base.component.inputs(request.label, node.values)
        missing = [i.topic for i in inputs if i.required and absolute(i.topic) not in self._recorded]
        if missing:
            raise MissionError(
                f"{self.reader.path}: {request.label} needs {', '.join(missing)}; the recording has "
                f"{', '.join(sorted(self._recorded)) or 'nothing'} (--remap OLD:=NEW gives a topic its name)"
            )
        awaited = [i.key for i in inputs if i.required or absolute(i.topic) in self._recorded]
        changed = ",".join(f"{key}={value}" for key, value in request.changes.items() if key != "use_gyro")
        run = Replayed(request.label, changed, node, component, Matcher(component, inputs, awaited))
        for output in base.component.outputs(request.label, node.values):
            run.outputs[output.key] = (absolute(output.topic), codec_of(output.message_type))
        if flown is not None and node.canonical == flown.canonical:
            topic = absolute(flown.outputs[0].topic)
            if topic in self._recorded:
                run.comparison = self._flown[topic] = Comparison()
        for source in inputs:
            self._connect(source, run)
        self.runs.append(run)

    def _changed(self, base: Node, request: EstimatorRequest) -> Node:
        mission = self.mission
        if all(n.name != base.name for n in mission.nodes):
            nodes = [*mission.values.graph.nodes, f"{base.package}/{base.executable}:{base.name}"]
            mission = mission.with_overrides([f"graph.nodes={','.join(nodes)}"])
        return mission.with_overrides([f"{base.name}.{key}={value}" for key, value in request.changes.items()]).node(
            base.name
        )

    def _connect(self, source: Input, run: Replayed) -> None:
        listeners = self._listeners.setdefault(absolute(source.topic), [])
        for edge, runs in listeners:
            # estimators that expect the same of a topic share its checks and its decoding
            if edge.source == source:
                runs.append(run)
                return
        listeners.append((Edge(source, run.component.values, self.reports.append), [run]))
