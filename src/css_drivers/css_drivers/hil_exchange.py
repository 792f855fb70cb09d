# SPDX-License-Identifier: Apache-2.0
"""One exchange of frames with a board a cycle, on a link that may fail in any way."""

import time
from collections import Counter
from collections.abc import Callable

from css_drivers.device_errors import DeviceError
from css_drivers.hil_frame import (
    KIND_COMMAND,
    Command,
    Frame,
    FrameError,
    FrameReader,
    Sensors,
    command_of,
    sensors_frame,
)
from css_drivers.hil_link import HilLink
from css_drivers.latency_record import LatencyRecord

_GREETING_EVERY = 0.25  # [s]
_RETRY = 1.0  # [s] from one attempt to open a link to the next

SENT, ANSWERED = "frames_sent", "frames_answered"
LOST = "frames_lost"
"""Frames of sensors that were not answered in time."""
LATE = "frames_late"
"""Answers that came after their cycle."""
CORRUPT = "frames_corrupt"
"""What looked like a frame and was damaged."""
WRONG = "frames_wrong"
"""Whole frames that answer nothing: of another kind, of a sequence that was not sent, for other actuators."""
DOWN = "link_down"
"""Cycles without a link."""
TROUBLES = (LOST, LATE, CORRUPT, WRONG, DOWN)


class Exchange:
    """Sends what sensors say and takes the command that answers it.

    Attributes:
        counts: of frames, by the names above.
        round_trip: from the begin of sending to the command.
        silent_since: time.monotonic() of the first frame since the last answer; None while there is none.
        trouble: what the link said when it failed; empty while it is there.
    """

    def __init__(self, open_link: Callable[[], HilLink], wheels: int, rods: int) -> None:
        """Prepares exchanges; the link is opened with the first one.

        Args:
            open_link: opens it, or raises DeviceError.
            wheels: that a command must have.
            rods: that a command must have.
        """
        self._open_link = open_link
        self._wheels, self._rods = wheels, rods
        self._link: HilLink | None = None
        self._reader = FrameReader()
        self._next_attempt = 0.0
        self._gone_corrupt = 0
        self.counts = Counter({name: 0 for name in (SENT, ANSWERED, *TROUBLES)})
        self.round_trip = LatencyRecord()
        self.silent_since: float | None = None
        self.trouble = ""

    def close(self) -> None:
        """Gives the link up."""
        link, self._link = self._link, None
        if link is not None:
            link.close()

    def ask(self, sequence: int, stamp_ns: int, told: Sensors, within: float) -> Command | None:
        """Tells a board what sensors say, and waits for its command.

        Args:
            sequence: of the cycle, rising.
            stamp_ns: of the cycle.
            told: what sensors say.
            within: time [s] to wait.

        Returns:
            the command, None when there is none in time.
        """
        begin = time.monotonic()
        if self.silent_since is None:
            self.silent_since = begin
        try:
            link = self._opened()
            command = None if link is None else self._exchange(link, sequence, stamp_ns, told, begin + within)
        except DeviceError as error:
            self._fail(error)
            command = None
        self.counts[CORRUPT] = self._gone_corrupt + self._reader.corrupt
        if command is None:
            self.counts[DOWN if self._link is None else LOST] += 1
            return None
        self.counts[ANSWERED] += 1
        self.silent_since = None
        self.round_trip.note(round((time.monotonic() - begin) * 1e9))
        return command

    def _opened(self) -> HilLink | None:
        if self._link is None and time.monotonic() >= self._next_attempt:
            self._next_attempt = time.monotonic() + _RETRY
            self._link = self._open_link()
            self._gone_corrupt += self._reader.corrupt
            self._reader = FrameReader()
            self.trouble = ""
        return self._link

    def _fail(self, error: DeviceError) -> None:
        self.trouble = str(error)
        self.close()

    def _exchange(self, link: HilLink, sequence: int, stamp_ns: int, told: Sensors, end: float) -> Command | None:
        for frame in [*self._reader.give_up_waiting(), *self._taken(link, 0.0)]:
            self._answer(frame, sequence, stamp_ns)  # nothing can answer what has not been sent
        link.send(sensors_frame(sequence, stamp_ns, told))
        self.counts[SENT] += 1
        while (left := end - time.monotonic()) > 0.0:
            for frame in self._taken(link, left):
                command = self._answer(frame, sequence, stamp_ns)
                if command is not None:
                    return command
        return None

    def _taken(self, link: HilLink, seconds: float) -> list[Frame]:
        """Frames that have come."""
        data = link.receive(seconds)
        if not link.whole:
            return self._reader.feed(data)
        if not data:
            return []
        # a datagram is a frame or none; nothing of it can belong to another
        reader = FrameReader()
        frames = reader.feed(data)
        self._gone_corrupt += 1 if not frames else reader.corrupt
        return frames

    def _answer(self, frame: Frame, sequence: int, stamp_ns: int) -> Command | None:
        """The command of a frame, if it answers this cycle; all else is counted."""
        if frame.kind != KIND_COMMAND:
            self.counts[WRONG] += 1
            return None
        behind = (sequence - frame.sequence) & 0xFFFFFFFF
        if behind or frame.stamp_ns != stamp_ns:
            self.counts[LATE if 0 < behind <= self.counts[SENT] else WRONG] += 1
            return None
        try:
            return command_of(frame, self._wheels, self._rods)
        except FrameError:
            self.counts[WRONG] += 1
            return None


GREETING = 0xFFFFFFFF
"""Sequence of the frames that ask whether a board is there, before a flight."""


def greet(
    link: HilLink, told: Sensors, wheels: int, stamp_ns: int, wait: float, stopped: Callable[[], bool]
) -> Exchange:
    """Asks on an open link until a board answers, which may have to boot.

    Args:
        link: stays open.
        told: what frames hold; nothing is measured yet.
        wheels: that a command must have.
        stamp_ns: of the frames.
        wait: time [s] to ask for.
        stopped: somebody does not want to wait any longer.

    Returns:
        the exchange, whose counts tell what came of it.
    """
    exchange = Exchange(lambda: link, wheels, told.rods)
    end = time.monotonic() + wait
    while time.monotonic() < end and not stopped():
        if exchange.ask(GREETING, stamp_ns, told, min(_GREETING_EVERY, wait)) is not None or exchange.trouble:
            break
    return exchange
