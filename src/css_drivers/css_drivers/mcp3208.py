# SPDX-License-Identifier: Apache-2.0
"""Microchip MCP3208: eight single-ended inputs, 12 bits, SPI (data sheet DS21298).

One transfer of three bytes is one conversion: five leading zeros, start bit, SGL, and the number of the input go out;
a null bit and twelve bits of code come back. Sample and conversion are done by the clock of the transfer.
"""

from collections.abc import Sequence
from typing import Any

from css_drivers.converter import Conversion
from css_drivers.device_errors import TRASH, DeviceError, of_device

_START, _SINGLE_ENDED = 1 << 2, 1 << 1
_NULL = 1 << 4  # in the second byte that comes back
_LARGEST = 0xFFF
FASTEST = 2_000_000
"""Clock [Hz] at a supply of 5 V; 1 MHz at 2.7 V."""
SLOWEST = 10_000
"""Clock [Hz] below which the sampled charge leaks away during a conversion."""


def request(channel: int) -> list[int]:
    """What goes out for one input."""
    return [_START | _SINGLE_ENDED | channel >> 2, (channel & 0b11) << 6, 0]


class Mcp3208:
    """One chip."""

    channels = 8

    def __init__(self, spi: Any, reference: float, name: str) -> None:
        """Takes over a chip.

        Args:
            spi: an open `spidev.SpiDev`.
            reference: at its pin VREF [V].
            name: of the device, for errors.
        """
        self._spi = spi
        self._reference = reference
        self._name = f"MCP3208 at {name}"

    def begin(self) -> None:
        """Looks whether a chip answers at all; it has no registers."""
        self.scan([0])

    def scan(self, inputs: Sequence[int]) -> list[Conversion]:
        """Converts some inputs, one after the other."""
        return [self._convert(channel) for channel in inputs]

    def _convert(self, channel: int) -> Conversion:
        with of_device(self._name):
            _, high, low = self._spi.xfer2(request(channel))
        if high & _NULL:
            raise DeviceError(TRASH, f"{self._name}: the null bit is 1, no chip drives the line")
        code = (high & 0xF) << 8 | low
        return Conversion(code * self._reference / (_LARGEST + 1), code == _LARGEST)
