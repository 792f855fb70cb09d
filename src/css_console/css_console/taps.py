# SPDX-License-Identifier: Apache-2.0
"""The latest messages of the topics of a graph, looked at now and then: nothing runs when a message comes.

The middleware keeps the last few messages of each topic; whoever looks takes what is there. A flight at two hundred
times real time is watched at the cost of one at real time, and one that the watcher does not keep up with loses
nothing but what is not looked at. Of a topic that is faster than looks nothing is confirmed or sent again: to a watcher
of another process that is most of what its watching costs the flight. When such a topic falls silent, what it said last
is asked for again.
"""

from collections import deque
from collections.abc import Iterable, Iterator
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from css_analysis.flight_topics import LOGGED_TYPES, TOLD_TYPES
from css_common.codec import DecodeError, Sample, codec_of, stamp_of, type_name
from css_common.qos import matching_qos
from css_common.ros_internals import bare_subscription
from css_msgs.msg import SpacecraftState, SunEstimate, WheelTorqueCommand

KEPT = 12
_FULL, _SILENT = 3, 5
"""Looks in a row with all that is kept, after which a topic hurries; without anything, after which it does no more."""
TYPES = {type_name(kind): kind for kind in (*LOGGED_TYPES.values(), *TOLD_TYPES) if kind is not WheelTorqueCommand}
"""Types of topics that are watched, by their full name: all of a flight but what the page has no place for."""


class Tap:
    """One topic.

    Attributes:
        topic: its full name.
        kind: class of its messages.
        taken: messages so far.
        malformed: of those the ones that are none.
        hurries: it is faster than looks, and heard without confirmation.
    """

    def __init__(self, node: Node, topic: str, kind: type) -> None:
        """Begins to listen, to what is latched first."""
        self.topic, self.kind = topic, kind
        self.taken = self.malformed = 0
        self.hurries = False
        self._node = node
        self._full = self._silent = 0  # looks in a row
        self._sent_ns = self._known_ns = 0  # wall time at which the last message was sent; up to which it is known
        self._messages: deque[tuple[int, bytes]] = deque(maxlen=KEPT)
        self._listen()

    @property
    def tells(self) -> bool:
        """Its messages hold until the next one."""
        return self.kind in TOLD_TYPES

    def take(self) -> bool:
        """Takes what has come; whether its time went back meanwhile, as at the start of another flight."""
        went_back, fresh = False, 0
        for _ in range(2 * KEPT):
            with self._handle:
                taken = self._handle.take_message(self.kind, True)
            if taken is None:
                break
            data, about = taken
            if 0 < about["source_timestamp"] <= self._known_ns:
                continue  # latched: it was heard before
            fresh += 1
            self._sent_ns = about["source_timestamp"]
            try:
                stamp_ns = stamp_of(data)
            except DecodeError:
                self.malformed += 1
                continue
            if self._messages and stamp_ns < self._messages[-1][0]:
                self._messages.clear()
                went_back = True
            self._messages.append((stamp_ns, data))
        self.taken += fresh
        if not self.tells:
            self._adapt(fresh)
        return went_back

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

    def close(self) -> None:
        """Listens no more."""
        self._handle.destroy_when_not_in_use()


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

    def follow(self, node: Node, topics: Iterable[tuple[str, type]]) -> bool:
        """Listens to these topics and to no other; whether that is a change."""
        wanted = dict(topics)
        gone = [topic for topic, tap in self._taps.items() if wanted.get(topic) is not tap.kind]
        for topic in gone:
            self._taps.pop(topic).close()
        fresh = [topic for topic in wanted if topic not in self._taps]
        for topic in fresh:
            self._taps[topic] = Tap(node, topic, wanted[topic])
        return bool(gone or fresh)

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
