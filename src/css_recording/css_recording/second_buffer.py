# SPDX-License-Identifier: Apache-2.0
"""Puts messages that arrive in any order into the order in which a recording stores them.

Messages are held until their span of simulated time is over and handed out sorted by stamp and topic: the result
does not depend on the order of arrival, as long as no message is later than the hold-back time. Span and hold-back
time together are one second, and no more is lost with the process.
"""

from operator import itemgetter
from typing import NamedTuple

SECOND_NS = 1_000_000_000

Message = tuple[int, int, bytes, int]
"""Stamp [ns], index of the topic, serialised message, publish time [ns]."""

_STAMP_THEN_TOPIC = itemgetter(0, 1)


class BufferLimits(NamedTuple):
    """When messages are handed out.

    hold_back_ns: a span of time is over when a stamp this much later than its end has arrived; at least the delay,
        in stamps, with which the slowest topic follows the fastest.
    open_bytes: beyond this much held, the oldest span is handed out in parts, each sorted in itself.
    """

    hold_back_ns: int = SECOND_NS // 5
    open_bytes: int = 8 << 20

    @property
    def span_ns(self) -> int:
        """Time that is handed out at once: with the hold-back time a second, but never less than half a second."""
        return max(SECOND_NS - self.hold_back_ns, SECOND_NS // 2)


class SecondBuffer:
    """Messages waiting for their span of time to be over."""

    def __init__(self, limits: BufferLimits) -> None:
        self.late_messages = 0
        """Messages whose span had been handed out before they came. They are kept, out of order."""
        self._limits = limits
        self._span_ns = limits.span_ns
        self._open: dict[int, list[Message]] = {}
        self._open_bytes = 0
        self._late: list[Message] = []
        self._finished_span = -1
        self._due_ns = 0

    def add(self, message: Message) -> list[list[Message]] | None:
        """Take one message; gives the batches that are to be stored now, each sorted, or None."""
        stamp_ns = message[0]
        span = stamp_ns // self._span_ns
        self._open_bytes += len(message[2])
        if span <= self._finished_span:
            return self._add_late(span, message)
        waiting = self._open.get(span)
        if waiting is None:
            waiting = self._open[span] = []
            self._set_due()
        waiting.append(message)
        if stamp_ns >= self._due_ns or self._open_bytes > self._limits.open_bytes:
            return self._take_due(stamp_ns)
        return None

    def drain(self) -> list[list[Message]]:
        """Hand out everything held. Messages of the last span that come afterwards make another batch."""
        spans = sorted(self._open)
        batches = [self._sorted(self._open.pop(span)) for span in spans]
        if spans:
            self._finished_span = max(self._finished_span, spans[-1] - 1)
        return batches + self._take_late()

    def held(self) -> list[Message]:
        """Messages waiting, in no particular order."""
        return [message for waiting in (*self._open.values(), self._late) for message in waiting]

    def _set_due(self) -> None:
        self._due_ns = (min(self._open) + 1) * self._span_ns + self._limits.hold_back_ns

    def _take_due(self, now_ns: int) -> list[list[Message]]:
        batches = []
        while self._open and now_ns >= self._due_ns:
            batches.append(self._take(min(self._open)))
            if self._open:
                self._set_due()
        if self._open_bytes > self._limits.open_bytes and self._open:
            # The span stays open: what is still to come of it is not late.
            batches.append(self._sorted(self._open.pop(min(self._open))))
            if self._open:
                self._set_due()
        return batches + self._take_late()

    def _take(self, span: int) -> list[Message]:
        self._finished_span = max(self._finished_span, span)
        return self._sorted(self._open.pop(span))

    def _add_late(self, span: int, message: Message) -> list[list[Message]]:
        """Late messages are batched by themselves, in runs that stay within one span.

        They wait for the next span that is over, at most.
        """
        batches = self._take_late() if self._late and self._late[0][0] // self._span_ns != span else []
        self.late_messages += 1
        self._late.append(message)
        if self._open_bytes > self._limits.open_bytes:
            batches += self._take_late()
        return batches

    def _take_late(self) -> list[list[Message]]:
        late, self._late = self._late, []
        return [self._sorted(late)] if late else []

    def _sorted(self, messages: list[Message]) -> list[Message]:
        self._open_bytes -= sum(len(message[2]) for message in messages)
        messages.sort(key=_STAMP_THEN_TOPIC)
        return messages
