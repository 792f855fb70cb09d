# SPDX-License-Identifier: Apache-2.0
"""The latest messages of the topics of a graph, looked at now and then: nothing runs when a message comes.

The middleware keeps the last few messages of each topic; whoever looks takes what is there. A flight at two hundred
times real time is watched at the cost of one at real time, and one that the watcher does not keep up with loses
nothing but what is not looked at. Of a topic that is faster than looks nothing is confirmed or sent again: to a watcher
of another process that is most of what its watching costs the flight. When such a topic falls silent, what it said last
is asked for again. Where the flight is in the process of the watcher, what its nodes published last is read from them,
and the flight sends nothing more than without.
"""

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from css_analysis.flight_topics import LOGGED_TYPES, TOLD_TYPES
from css_common.codec import DecodeError, Sample, codec_of, stamp_of, type_name
from css_common.output_port import RECENT, OutputPort
from css_common.qos import matching_qos
from css_common.ros_internals import bare_subscription
from css_msgs.msg import SpacecraftState, SunEstimate, WheelTorqueCommand

KEPT = RECENT
_FULL, _SILENT = 3, 5
"""Looks in a row with all that is kept, after which a topic hurries; without anything, after which it does no more."""
TYPES = {type_name(kind): kind for kind in (*LOGGED_TYPES.values(), *TOLD_TYPES) if kind is not WheelTorqueCommand}
"""Types of topics that are watched, by their full name: all of a flight but what the page has no place for."""


class Tap(ABC):
    """One topic.

    Attributes:
        topic: its full name.
        kind: class of its messages.
        taken: messages so far.
        malformed: of those the ones that are none.
    """

    def __init__(self, topic: str, kind: type) -> None:
        """Nothing is known yet."""
        self.topic, self.kind = topic, kind
        self.taken = self.malformed = 0
        self._messages: deque[tuple[int, bytes]] = deque(maxlen=KEPT)

    @property
    def tells(self) -> bool:
        """Its messages hold until the next one."""
        return self.kind in TOLD_TYPES

    def take(self) -> bool:
        """Takes what has come; whether its time went back meanwhile, as at the start of another flight."""
        went_back = False
        for data in self._fresh():
            self.taken += 1
            try:
                stamp_ns = stamp_of(data)
            except DecodeError:
                self.malformed += 1
                continue
            if self._messages and stamp_ns < self._messages[-1][0]:
                self._messages.clear()
                went_back = True
            self._messages.append((stamp_ns, data))
        return went_back

    @abstractmethod
    def _fresh(self) -> Iterable[bytes]:
        """What has come since the last look, the oldest first."""

    @abstractmethod
    def close(self) -> None:
        """Looks no more."""

    @property
    def stamps(self) -> list[int]:
        """Of the messages that are kept, the oldest first [ns]."""
        return [stamp_ns for stamp_ns, _ in self._messages]

    def forget(self) -> None:
        """Forgets what was of another flight."""
        self._messages.clear()

    def at(self, stamp_ns: int) -> Sample | None:
        """The last message up to a stamp; None without, and where it is damaged."""
        for stamp, data in reversed(self._messages):
            if stamp <= stamp_ns:
                try:
                    return codec_of(self.kind).decode(data)
                except DecodeError:
                    self.malformed += 1
                    return None
        return None


class HeardTap(Tap):
    """A topic to which the console listens as any node does.

    Attributes:
        hurries: it is faster than looks, and heard without confirmation.
    """

    def __init__(self, node: Node, topic: str, kind: type) -> None:
        """Begins to listen, to what is latched first."""
        super().__init__(topic, kind)
        self.hurries = False
        self._node = node
        self._full = self._silent = 0  # looks in a row
        self._sent_ns = self._known_ns = 0  # wall time at which the last message was sent; up to which it is known
        self._listen()

    def _fresh(self) -> Iterable[bytes]:
        fresh = []
        for _ in range(2 * KEPT):
            with self._handle:
                taken = self._handle.take_message(self.kind, True)
            if taken is None:
                break
            data, about = taken
            if 0 < about["source_timestamp"] <= self._known_ns:
                continue  # latched: it was heard before
            fresh.append(data)
            self._sent_ns = about["source_timestamp"]
        if not self.tells:
            self._adapt(len(fresh))
        return fresh

    def _adapt(self, fresh: int) -> None:
        """Listens in another way to a topic that has become faster than looks, or silent."""
        self._full = self._full + 1 if fresh >= KEPT else 0
        self._silent = 0 if fresh else self._silent + 1
        if (not self.hurries and self._full >= _FULL) or (self.hurries and self._silent >= _SILENT):
            self.hurries = not self.hurries
            self._known_ns = self._sent_ns
            before = self._handle
            self._listen()
            before.destroy_when_not_in_use()

    def _listen(self) -> None:
        publishers = self._node.get_publishers_info_by_topic(self.topic)
        latched = matching_qos(publishers, KEPT) if publishers else _LATCHED
        self._handle = bare_subscription(self._node, self.kind, self.topic, _UNCONFIRMED if self.hurries else latched)

    def close(self) -> None:
        """Listens no more."""
        self._handle.destroy_when_not_in_use()


class ReadTap(Tap):
    """A topic of a node of this process, read from what it published last: the flight sends nothing for it."""

    def __init__(self, port: OutputPort, kind: type) -> None:
        """Nothing is read yet."""
        super().__init__(port.full_name, kind)
        self.port = port
        self._last: bytes | None = None

    def _fresh(self) -> Iterable[bytes]:
        now = self.port.recent.copy()  # in one go: the flight goes on in another thread
        fresh: deque[bytes] = deque()
        while now and now[-1] is not self._last:
            fresh.appendleft(now.pop())
        if fresh:
            self._last = fresh[-1]
        return fresh

    def close(self) -> None:
        """There is nothing to end."""


_UNCONFIRMED = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=KEPT,
    reliability=ReliabilityPolicy.BEST_EFFORT,
    durability=DurabilityPolicy.VOLATILE,
)
_LATCHED = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=KEPT,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)


class Taps:
    """All topics of a graph that are watched."""

    def __init__(self) -> None:
        self._taps: dict[str, Tap] = {}

    def __iter__(self) -> Iterator[Tap]:
        return iter(self._taps.values())

    def follow(self, node: Node, topics: Iterable[tuple[str, type]], inside: Mapping[str, OutputPort]) -> None:
        """Looks at these topics and at no other.

        Args:
            node: listens.
            topics: full name and class of messages of each.
            inside: what nodes of this process publish, by full name. What holds until the next message is heard all
                the same: it is rare, and others may tell of themselves there too.
        """
        wanted = dict(topics)
        ports = {topic: inside.get(topic) for topic, kind in wanted.items() if kind not in TOLD_TYPES}
        for topic, tap in list(self._taps.items()):
            if wanted.get(topic) is not tap.kind or ports.get(topic) is not _port_of(tap):
                self._taps.pop(topic).close()
        for topic, kind in wanted.items():
            if topic not in self._taps:
                port = ports.get(topic)
                self._taps[topic] = HeardTap(node, topic, kind) if port is None else ReadTap(port, kind)

    def take(self) -> bool:
        """Takes what has come of all topics; whether time went back, and what is left is of the new flight alone."""
        went_back = [tap for tap in self if tap.take() and not tap.tells]
        if not went_back:
            return False
        newest = max(stamp for tap in went_back for stamp in tap.stamps)
        for tap in self:
            if tap not in went_back and tap.stamps and tap.stamps[-1] > newest:
                tap.forget()
        return True

    @property
    def taken(self) -> int:
        """Messages of all topics so far."""
        return sum(tap.taken for tap in self)

    def common_stamp(self) -> int | None:
        """The newest stamp of which truth, cells and estimates are all there; else the newest of any topic.

        Errors are differences of messages of one instant; at high speed the last of two topics are not.
        """
        together = [set(t.stamps) for t in self if t.kind in (SpacecraftState, SunEstimate) and t.stamps]
        shared = set.intersection(*together) if together else set()
        if shared:
            return max(shared)
        last = [tap.stamps[-1] for tap in self if tap.stamps and not tap.tells]
        return max(last, default=None)

    def samples(self, stamp_ns: int) -> dict[str, tuple[Any, Sample]]:
        """What was last said up to a stamp: class and message by topic."""
        found = ((tap, tap.at(stamp_ns)) for tap in self)
        return {tap.topic: (tap.kind, sample) for tap, sample in found if sample is not None}


def _port_of(tap: Tap) -> OutputPort | None:
    return tap.port if isinstance(tap, ReadTap) else None
