# SPDX-License-Identifier: Apache-2.0
"""A recording stepped through the visualizer: what it would have published, whenever the flight was.

Checks at the edge and matching of stamps are those of the node.
"""

from collections.abc import Iterator
from typing import ClassVar, NamedTuple

from css_common.codec import type_name
from css_common.edge import Edge
from css_common.matching import Matcher
from css_common.mission import Mission, load_mission, mission_from_text
from css_common.stepping import Stepper
from css_common.tree_codec import named_only
from css_recording.bag_metadata import absolute
from css_recording.bag_reader import BagReader
from css_viewers.errors import ViewerError
from css_viewers.visualizer import DIVIDER, SceneComponent

PACKAGE, NODE = "css_viewers", "visualizer"


class OfflineScene(SceneComponent):
    """The visualizer with all that it can give, whatever is installed here."""

    markers_type: ClassVar[type] = named_only("visualization_msgs/msg/MarkerArray")
    transforms_type: ClassVar[type | None] = named_only("tf2_msgs/msg/TFMessage")


class Drawn(NamedTuple):
    """One message of the visualizer.

    Attributes:
        topic: absolute name.
        type_name: of the message, such as `visualization_msgs/msg/MarkerArray`.
        stamp_ns: of it.
        data: serialised.
    """

    topic: str
    type_name: str
    stamp_ns: int
    data: bytes


class ViewedBag:
    """What a recording looks like.

    Attributes:
        mission: that of the flight.
        topics: absolute name to type name of what is drawn.
        absent: topics of the flight that would be drawn and are not in the recording.
        reports: one line for each kind of message that was refused.
        drawn: messages so far.
    """

    def __init__(self, reader: BagReader, mission: Mission, every: int) -> None:
        """Looks at what is there.

        Args:
            reader: the recording.
            mission: its spacecraft.
            every: draws every so many control cycles.

        Raises:
            ViewerError: there is no truth, or a topic has another type.
            MissionError: the mission cannot have a visualizer.
        """
        self.mission = mission
        self.reports: list[str] = []
        self.drawn = 0
        self._first_ns = self._last_ns = 0
        self._reader = reader
        node = mission.with_node((PACKAGE, NODE, NODE), {DIVIDER.name: str(every)}).node(NODE)
        self._stepper = Stepper(OfflineScene, NODE, node.canonical, (), mission.epoch_ns)
        self.topics = {absolute(port.topic): port.codec.type_name for port in self._stepper.ports.values()}
        recorded = {entry.topic.name: entry.topic.type for entry in reader.topics if entry.count}
        sources = OfflineScene.inputs(NODE, node.values)
        self.absent = tuple(absolute(s.topic) for s in sources if absolute(s.topic) not in recorded)
        for source in sources:
            topic, expected = absolute(source.topic), type_name(source.message_type)
            if recorded.get(topic, expected) != expected:
                raise ViewerError(f"{reader.path}: topic {topic} is {recorded[topic]}, expected {expected}")
            if source.required and topic in self.absent:
                raise ViewerError(
                    f"{reader.path}: has no {topic}, by which the spacecraft is turned; it has "
                    f"{', '.join(sorted(recorded)) or 'nothing'}"
                )
        heard = [source for source in sources if absolute(source.topic) in recorded]
        self._edges = {absolute(s.topic): Edge(s, node.values, self._note) for s in heard}
        self._matcher = Matcher(self._stepper.component, sources, [source.key for source in heard])

    @property
    def refused(self) -> int:
        """Messages that were refused at the edge so far."""
        return sum(edge.rejected.total() for edge in self._edges.values())

    @property
    def seconds(self) -> float:
        """Time [s] from the first message drawn so far to the last one."""
        return (self._last_ns - self._first_ns) / 1e9

    def messages(self) -> Iterator[Drawn]:
        """Reads the recording once.

        Raises:
            BagError: it cannot be read to its end.
        """
        for drawn in self._messages():
            self.drawn += 1
            self._first_ns, self._last_ns = self._first_ns or drawn.stamp_ns, drawn.stamp_ns
            yield drawn

    def _messages(self) -> Iterator[Drawn]:
        for message in self._reader.messages(set(self._edges)):
            edge = self._edges[message.topic]
            sample = edge.accept(message.data)
            if sample is None:
                continue
            for stamp_ns, received in self._matcher.offer(edge.source.key, sample):
                for port, given, data in self._stepper.sent(stamp_ns, self._stepper.step(stamp_ns, received)):
                    yield Drawn(absolute(port.topic), port.codec.type_name, given.stamp_ns, data)
        self._matcher.give_up()
        if self._matcher.unmatched:
            self._note(f"{self._matcher.unmatched} messages are not drawn: nothing else of their stamp is recorded")

    def _note(self, line: str) -> None:
        if line not in self.reports:
            self.reports.append(line)


def mission_of(reader: BagReader, named: str | None) -> Mission:
    """The mission of a recording: the one that is asked for, else the one that it holds.

    Raises:
        ViewerError: there is none.
        MissionError: it is no valid mission.
    """
    if named is not None:
        return load_mission(named)
    text = reader.mission_text
    if text is None:
        raise ViewerError(f"{reader.path}: holds no mission; expected --mission NAME, whose spacecraft is drawn")
    return mission_from_text(text, f"{reader.path}: embedded mission")
