# SPDX-License-Identifier: Apache-2.0
"""A component that hardware paces: its host reads the device in a thread of its own, on the wall clock.

What blocks, times out and comes back (a bus, a line) happens in `readings`; what comes of it is a cycle like any
other, in the thread of the node.
"""

import threading
import time
from abc import abstractmethod
from collections.abc import Iterator
from typing import Any, ClassVar, NamedTuple

from css_common.component import Component, Outgoing, Received

READING = "reading"
"""Key under which a cycle of a device receives its reading."""


class Reading(NamedTuple):
    """What a device gave at one instant."""

    stamp_ns: int  # of the clock of all stamps, of the measurement
    taken_ns: int  # the same instant of time.monotonic_ns()
    value: Any


class Stop:
    """Tells the thread of a device to end, and lets it wait for that."""

    def __init__(self) -> None:
        self._event = threading.Event()

    def now(self) -> None:
        """Asks the thread to end."""
        self._event.set()

    def __bool__(self) -> bool:
        return self._event.is_set()

    def within(self, seconds: float) -> bool:
        """Waits so long at most; whether the thread is to end."""
        return self._event.wait(max(0.0, seconds))


class Device(Component):
    """A component that is read by its host instead of being sent messages."""

    rehearses: ClassVar[bool] = False

    @abstractmethod
    def readings(self, stop: Stop) -> Iterator[Reading]:
        """What the device gives, each as it comes, until told to stop; runs in a thread of its own.

        Whatever goes wrong with the device is dealt with in here; when it ends or raises, its host begins it anew.
        """

    @abstractmethod
    def cycle(self, stamp_ns: int, received: Received) -> Outgoing:
        """A `Reading` to the messages of its stamp."""

    def published(self, reading: Reading) -> None:
        """Takes note that the messages of a reading have been handed to the middleware."""

    @staticmethod
    def age_ns(reading: Reading) -> int:
        """How long ago a reading was taken [ns]."""
        return time.monotonic_ns() - reading.taken_ns
