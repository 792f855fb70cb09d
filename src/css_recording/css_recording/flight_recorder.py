# SPDX-License-Identifier: Apache-2.0
"""What a recorder does with each message: its stamp, its place in the recording, the gaps before it. No ROS here.

Log time is the stamp of the message's own header, so that a recording of simulated time is in simulated time. A
message without a stamp gets the latest one that was seen.
"""

import struct
import time
from collections import Counter
from collections.abc import Mapping
from typing import NamedTuple

from css_common.edge import HISTORY
from css_recording.bag_metadata import Topic
from css_recording.bag_writer import BagWriter
from css_recording.schemas import header_place, schema_of

_STAMP = struct.Struct("<iI")
# Their stamps are of the wall clock, also where everything else is in simulated time.
_WALL_CLOCK_TOPICS = ("/parameter_events", "/rosout")
_MOST_HELD = 1000


def stamp_place(topic: Topic) -> int | None:
    """Where in a serialised message the stamp lies that tells the time of the flight; None: it has none."""
    if topic.name in _WALL_CLOCK_TOPICS:
        return None
    return header_place(topic.schema or schema_of(topic.type))


class Gap(NamedTuple):
    """Messages of a topic that never came.

    Attributes:
        missing: how many, all gaps of the topic together.
        first_ns: stamp of the first of them.
    """

    missing: int
    first_ns: int


class FlightRecorder:
    """Files messages as they arrive.

    Attributes:
        writer: the recording.
        counters: messages received with `gaps` (stamps missing before them), `repeated` or `back` (stamps that do
            not go forward), `unstamped` (no stamp of their own, or none that can be), and `answered_again` (sent once
            more by a node that was restarted, and not filed twice).
        gaps: what is missing of each topic that has a fixed spacing and misses something.
    """

    def __init__(self, writer: BagWriter, spacing_ns: Mapping[str, int] | None = None) -> None:
        """Takes over a recording.

        Args:
            writer: where messages go; closing it is the caller's.
            spacing_ns: time from stamp to stamp of topics that have a fixed one; only there gaps are counted.
        """
        self.writer = writer
        self.counters: Counter[str] = Counter()
        self.gaps: dict[str, Gap] = {}
        self._filed_by_another: dict[str, int] = {}
        self._spacing_ns = dict(spacing_ns or {})
        self._stamp_places = {topic.name: stamp_place(topic) for topic in writer.topics}
        self._last_ns: dict[str, int] = {}
        self._latest_ns: int | None = None
        self._held: list[tuple[str, bytes, int]] = []
        self._received: Counter[str] = Counter({topic.name: 0 for topic in writer.topics})

    @property
    def counts(self) -> dict[str, int]:
        """Messages received of each topic."""
        return dict(self._received)

    @property
    def latest_ns(self) -> int:
        """Latest stamp seen [ns]; 0 before the first."""
        return self._latest_ns or 0

    @property
    def message_count(self) -> int:
        """Messages received."""
        return self._received.total()

    def add_topic(self, topic: Topic) -> None:
        """Makes a topic known."""
        self.writer.add_topic(topic)
        self._stamp_places[topic.name] = stamp_place(topic)
        self._received[topic.name] += 0

    def hand_over(self, topic: str) -> None:
        """The next messages of a topic come from another sender, which may repeat what is filed already."""
        if topic in self._last_ns:
            self._filed_by_another[topic] = HISTORY

    def receive(self, topic: str, data: bytes) -> int | None:
        """Files one serialised message; its own stamp [ns], if it has one.

        Raises:
            BagError: the recording cannot be written any more.
        """
        place = self._stamp_places[topic]
        if place is None or len(data) < place + _STAMP.size:
            self._received[topic] += 1
            self._file_unstamped(topic, data)
            return None
        seconds, nanoseconds = _STAMP.unpack_from(data, place)
        stamp_ns = seconds * 1_000_000_000 + nanoseconds
        if self._filed_by_another and self._is_repetition(topic, stamp_ns):
            self.counters["answered_again"] += 1
            return stamp_ns
        self._received[topic] += 1
        if stamp_ns <= 0 or nanoseconds >= 1_000_000_000:  # a driver that leaves its header empty, or fills it wrongly
            self._file_unstamped(topic, data)
            return None
        last_ns = self._last_ns.get(topic)
        self._last_ns[topic] = stamp_ns
        if last_ns is not None and topic in self._spacing_ns and stamp_ns - last_ns != self._spacing_ns[topic]:
            self._count_step(topic, last_ns, stamp_ns)
        if self._latest_ns is None or stamp_ns > self._latest_ns:
            self._latest_ns = stamp_ns
            if self._held:
                self._release(stamp_ns)
        self.writer.write(topic, stamp_ns, data)
        return stamp_ns

    def close(self, notes: Mapping[str, str] | None = None) -> None:
        """Finishes the recording.

        Args:
            notes: what is known only now, for the record `sunpoint_flight` and `custom_data` of `metadata.yaml`.
        """
        if not self.writer.closed:
            self._release(None)
        self.writer.close(notes)

    def _is_repetition(self, topic: str, stamp_ns: int) -> bool:
        left = self._filed_by_another.get(topic, 0)
        if left and stamp_ns <= self._last_ns[topic]:
            self._filed_by_another[topic] = left - 1
            return True
        self._filed_by_another.pop(topic, None)
        return False

    def _count_step(self, topic: str, last_ns: int, stamp_ns: int) -> None:
        step_ns, spacing_ns = stamp_ns - last_ns, self._spacing_ns[topic]
        if step_ns > spacing_ns:
            self.counters["gaps"] += 1
            before = self.gaps.get(topic, Gap(0, last_ns + spacing_ns))
            self.gaps[topic] = before._replace(missing=before.missing + max(1, round(step_ns / spacing_ns) - 1))
        else:
            self.counters["repeated" if step_ns == 0 else "back"] += 1

    def _file_unstamped(self, topic: str, data: bytes) -> None:
        """Files at the latest stamp. Before there is one, messages wait; too many get the wall clock's."""
        self.counters["unstamped"] += 1
        if self._latest_ns is not None:
            self.writer.write(topic, self._latest_ns, data)
            return
        self._held.append((topic, data, time.time_ns()))
        if len(self._held) > _MOST_HELD:
            self._latest_ns = self._held[-1][2]
            self._release(None)

    def _release(self, stamp_ns: int | None) -> None:
        """Files what waits, at a stamp or at the instants of the wall clock at which it came."""
        held, self._held = self._held, []
        for topic, data, received_ns in held:
            self.writer.write(topic, received_ns if stamp_ns is None else stamp_ns, data)
