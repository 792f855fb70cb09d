# SPDX-License-Identifier: Apache-2.0
"""Replay: a recording read once, stepped through any set of estimators, compared.

No topics and no clock: the components that fly are stepped directly, with the same checks at the edge, the same
matching of stamps and the same scripted events. The estimator that flew therefore gives the same bytes again.
"""

import time
from collections.abc import Callable, Iterable, Mapping
from typing import Protocol

from css_bringup.comparison import Comparison
from css_bringup.estimator_request import EstimatorRequest, parse_request
from css_bringup.replay_stretch import Stretch, stretches
from css_bringup.replayed import Replayed, replayed
from css_common.codec import DecodeError, Sample, codec_of, stamp_of, type_name
from css_common.component import Input
from css_common.edge import Edge
from css_common.mission import Mission, mission_from_text
from css_common.mission_file import MissionError
from css_recording.bag_metadata import Topic, absolute
from css_recording.bag_reader import BagMessage, BagReader
from css_recording.parameter_events import PARAMETER_EVENTS, RecordedSetting, read_setting

__all__ = ["EstimatorRequest", "Replay", "parse_request"]


LONG = 10_000
"""Messages of an input from which on it is worth loading the loops that take many at once."""


class Taker(Protocol):
    """What takes the estimates of a replay: a new recording, or who looks at them at once."""

    def add_topic(self, topic: Topic) -> None:
        """Announces a topic before its first message."""

    def write(self, topic: str, stamp_ns: int, data: bytes) -> None:
        """Takes a message."""


class Replay:
    """Steps estimators over a recording.

    Attributes:
        reader: the recording.
        runs: one entry an estimator.
        reports: one line for each kind of refusal and failure.
        long_from: messages of an input from which on ordinary parts of the recording are taken at once.
        first_ns, last_ns: earliest and latest stamp of the messages that the estimators took; zeros: none.
    """

    def __init__(
        self,
        reader: BagReader,
        mission: Mission,
        requests: Iterable[EstimatorRequest],
        overrides: Iterable[str] = (),
    ) -> None:
        """Builds the estimators.

        Args:
            reader: the recording, its topics renamed to those of the graph.
            mission: values for the estimators; that of the recording if it has one.
            requests: what to replay.
            overrides: KEY=VALUE of the mission that were asked for: they stay whatever changed in flight.

        Raises:
            MissionError: an estimator is unknown, a parameter is, or the recording lacks its inputs.
        """
        self.reader = reader
        self.mission = mission
        self.reports: list[str] = []
        self.runs: list[Replayed] = []
        self.first_ns = self.last_ns = 0
        self.long_from = LONG
        self._counts = {entry.topic.name: entry.count for entry in reader.topics}
        self._recorded = {entry.topic.name: entry.topic.type for entry in reader.topics if entry.count}
        self._listeners: dict[str, list[tuple[Edge, list[Replayed]]]] = {}
        text = reader.mission_text
        # without a mission in the recording those values are the only guess at what flew
        self._flown = mission if text is None else mission_from_text(text, f"{reader.path}: embedded mission")
        requests = tuple(requests)
        flown, settings = self._read_flown({request.kind for request in requests})
        overridden = frozenset(item.partition("=")[0].strip() for item in overrides)
        for request in requests:
            if any(run.label == request.label for run in self.runs):
                raise MissionError(f"estimator {request.label} is asked for twice")
            run = replayed(request, mission, self._flown, settings, overridden)
            self._check_inputs(run)
            self._compare(run, flown)
            run.begin(self._note)
            for source in run.inputs:
                self._connect(source, run)
            self.runs.append(run)

    @property
    def rejected(self) -> dict[str, dict[str, int]]:
        """Messages refused at the edge, by topic and kind."""
        return self._counted(lambda edge: edge.rejected)

    @property
    def missing(self) -> dict[str, dict[str, int]]:
        """Readings that counted as missing in messages that were taken, by topic, field and kind."""
        return self._counted(lambda edge: edge.missing)

    def _counted(self, of: Callable[[Edge], Mapping[str, int]]) -> dict[str, dict[str, int]]:
        counted: dict[str, dict[str, int]] = {}
        for topic, listeners in self._listeners.items():
            for edge, _ in listeners:
                kinds = counted.setdefault(topic, {})
                for kind, count in of(edge).items():
                    # several edges of a topic have seen the same messages
                    kinds[kind] = max(count, kinds.get(kind, 0))
        return {topic: kinds for topic, kinds in counted.items() if kinds}

    def run(self, writer: Taker | None, copied: Iterable[str] = ("/truth",)) -> float:
        """Reads the recording once; returns the processor time of reading and stepping [s].

        Args:
            writer: takes the estimates and copies of `copied` topics; None only compares.
            copied: absolute names of topics to copy; those that the recording lacks are left out.
        """
        copied = frozenset(copied) & self._recorded.keys()
        if writer is not None:
            self._announce(writer, copied)
        started = time.process_time()
        messages = self.reader.messages({*self._listeners, *copied} & self._recorded.keys())
        for part in stretches(messages) if self._is_long else ():
            if not self._leap(part, writer, copied):
                self._walk(part, writer, copied)
        self._walk(messages, writer, copied)
        for run in self.runs:
            run.finish()
        return time.process_time() - started

    @property
    def _is_long(self) -> bool:
        return any(self._counts.get(topic, 0) >= self.long_from for topic in self._listeners)

    def _leap(self, part: list[BagMessage], writer: Taker | None, copied: frozenset[str]) -> bool:
        """Takes an ordinary part of the recording at once; False: nothing of it is taken, as it is none."""
        stretch = Stretch.of(part, self._listeners, self.runs)
        if stretch is None:
            return False
        for first_ns, last_ns in stretch.spans():
            self._note_stamp(first_ns)
            self._note_stamp(last_ns)
        given = stretch.take()
        if writer is not None:
            waiting = iter(given)
            message = next(waiting, None)
            for place, read in enumerate(part):
                if read.topic in copied:
                    writer.write(read.topic, _header_stamp(read.data, read.stamp_ns), read.data)
                while message is not None and message.place == place:
                    writer.write(message.topic, message.stamp_ns, message.data)
                    message = next(waiting, None)
        return True

    def _walk(self, messages: Iterable[BagMessage], writer: Taker | None, copied: frozenset[str]) -> None:
        """Takes messages one by one."""
        for message in messages:
            if writer is not None and message.topic in copied:
                writer.write(message.topic, _header_stamp(message.data, message.stamp_ns), message.data)
            for edge, runs in self._listeners.get(message.topic, ()):
                sample = edge.accept(message.data)
                if sample is None:
                    continue
                self._note_stamp(sample.stamp_ns)
                for run in runs:
                    for stamp_ns, received in run.matcher.offer(edge.source.key, sample):
                        self._step(run, stamp_ns, received, writer)

    def _step(self, run: Replayed, stamp_ns: int, received: Mapping[str, Sample | None], writer: Taker | None) -> None:
        for port, sample, data in run.step(stamp_ns, received):
            if writer is not None:
                writer.write(run.topics[port.key], sample.stamp_ns, data)

    def _note(self, line: str) -> None:
        if line not in self.reports:
            self.reports.append(line)

    def _note_stamp(self, stamp_ns: int) -> None:
        if stamp_ns > self.last_ns:
            self.last_ns = stamp_ns
            self.first_ns = self.first_ns or stamp_ns
        elif stamp_ns < self.first_ns:
            self.first_ns = stamp_ns

    def _announce(self, writer: Taker, copied: Iterable[str]) -> None:
        for topic in sorted(copied):
            writer.add_topic(Topic(topic, self._recorded[topic]))
        for run in self.runs:
            for key, port in run.stepper.ports.items():
                writer.add_topic(Topic(run.topics[key], port.codec.type_name))

    def _read_flown(self, kinds: Iterable[str]) -> tuple[dict[str, dict[int, bytes]], list[RecordedSetting]]:
        """What the recording holds of the flight of some nodes: messages by topic and stamp, parameters set."""
        nodes = [node for node in self._flown.nodes if node.name in kinds]
        outputs = {absolute(output.topic) for node in nodes for output in node.outputs} & self._recorded.keys()
        topics = set(outputs)
        if PARAMETER_EVENTS in self._recorded:
            # the inputs tell the stamps at which parameters were set, as estimates may be missing
            topics |= {absolute(i.topic) for node in nodes for i in node.inputs} & self._recorded.keys()
            topics.add(PARAMETER_EVENTS)
        flown: dict[str, dict[int, bytes]] = {topic: {} for topic in outputs}
        settings: list[RecordedSetting] = []
        latest_ns = 0
        for message in self.reader.messages(topics) if topics else ():
            if message.topic == PARAMETER_EVENTS:
                settings.append(read_setting(message.data, latest_ns or message.stamp_ns))
                continue
            stamp_ns = _header_stamp(message.data, message.stamp_ns)
            latest_ns = max(latest_ns, stamp_ns)
            if message.topic in flown:
                # of a stamp that a restarted node answered twice the last answer counts
                flown[message.topic][stamp_ns] = message.data
        return flown, settings

    def _check_inputs(self, run: Replayed) -> None:
        inputs = [i for i in run.inputs if i.required or absolute(i.topic) in self._recorded]
        missing = [i.topic for i in inputs if absolute(i.topic) not in self._recorded]
        if missing:
            raise MissionError(
                f"{self.reader.path}: {run.label} needs {', '.join(missing)}; the recording has "
                f"{', '.join(sorted(self._recorded)) or 'nothing'} (--remap OLD:=NEW gives a topic its name)"
            )
        for source in inputs:
            recorded, expected = self._recorded[absolute(source.topic)], type_name(source.message_type)
            if recorded != expected:
                remedy = f"; {run.label}:gyro=off does without" if source.key == "gyro" else ""
                raise MissionError(
                    f"{self.reader.path}: topic {absolute(source.topic)} is {recorded}, {run.label} expected "
                    f"{expected} (--remap OLD:=NEW gives topics other names{remedy})"
                )
        run.present = tuple(i.key for i in inputs)

    def _compare(self, run: Replayed, flown: Mapping[str, Mapping[int, bytes]]) -> None:
        """Prepares the comparison, where the estimator flew as it is replayed and what it said is recorded."""
        if not run.flew_so:
            return
        for output in run.flown_outputs:
            topic = absolute(output.topic)
            if topic in flown:
                run.comparison = Comparison(flown[topic], codec_of(output.message_type))
                return

    def _connect(self, source: Input, run: Replayed) -> None:
        if source.key not in run.present:
            return
        listeners = self._listeners.setdefault(absolute(source.topic), [])
        for edge, runs in listeners:
            # estimators that expect the same of a topic share its checks and its decoding
            if edge.source == source:
                runs.append(run)
                return
        listeners.append((Edge(source, run.stepper.component.values, self._note), [run]))


def _header_stamp(data: bytes, log_time_ns: int) -> int:
    """Stamp of a message's header; the log time of one that has none."""
    try:
        return stamp_of(data)
    except DecodeError:
        return log_time_ns
