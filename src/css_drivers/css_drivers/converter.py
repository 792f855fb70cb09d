# SPDX-License-Identifier: Apache-2.0
"""What a driver of cells needs of an analog-to-digital converter."""

import time
from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol


class Conversion(NamedTuple):
    """One input, read."""

    volts: float
    at_limit: bool  # the converter gave its largest code


class Converter(Protocol):
    """One chip on a bus that is open."""

    channels: int

    def begin(self) -> None:
        """Brings the chip into the state in which it is read.

        Raises:
            DeviceError: it is not there, or is another one.
        """

    def scan(self, inputs: Sequence[int]) -> list[Conversion]:
        """Converts some inputs, one after the other.

        Raises:
            DeviceError: it does not answer, does not finish, or answers what cannot be.
        """


_LEAST_LOOKS = 5


class Patience:
    """Waits for a chip that needs a known time: sleeps through most of it, then asks again and again.

    Time in which the process itself did not run is no fault of the chip: it is asked a few times in any case.
    """

    def __init__(self, expected: float, limit: float, sleep: Callable[[float], object] = time.sleep) -> None:
        """Begins to wait.

        Args:
            expected: time [s] that it needs.
            limit: time [s] after which it is taken for stuck.
            sleep: how to wait.
        """
        self._sleep = sleep
        self._looks = 0
        self._end = time.monotonic() + limit
        self._pause = max(1e-4, 0.05 * expected)
        sleep(expected)

    def again(self) -> bool:
        """Waits a little longer; False when that is enough."""
        self._looks += 1
        if self._looks >= _LEAST_LOOKS and time.monotonic() >= self._end:
            return False
        self._sleep(self._pause)
        return True
