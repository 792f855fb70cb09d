# SPDX-License-Identifier: Apache-2.0
"""Texas Instruments ADS1115: four single-ended inputs, 16 bits, I2C (data sheet SBAS444).

Each input is a single-shot conversion: bit OS of the config register starts it and reads 1 again when it is over. The
register is read back with the result, as a chip that lost its supply in between has its defaults there, and a
result of another input or range would look like any other.
"""

from collections.abc import Sequence
from typing import Any

from css_drivers.converter import Conversion, Patience
from css_drivers.device_errors import TIMEOUT, TRASH, DeviceError, of_device

CONVERSION, CONFIG = 0x00, 0x01
"""Registers, of 16 bits, the higher byte first."""

OS = 1 << 15
_MUX_AT, _SINGLE_ENDED = 12, 0b100  # 100: AIN0 against ground, 101: AIN1, ...
_PGA_AT, _RATE_AT = 9, 5
_SINGLE_SHOT = 1 << 8
_NO_COMPARATOR = 0b11

RANGES = (6.144, 4.096, 2.048, 1.024, 0.512, 0.256)
"""Full scales [V], by the number in PGA. An input may not be above the supply, whatever the range."""
RATES = (8, 16, 32, 64, 128, 250, 475, 860)
"""Conversions per second, by the number in DR; the oscillator is good to 10 %."""

ADDRESSES = range(0x48, 0x4C)
_LARGEST = 0x7FFF
_WAKE_UP = 30e-6  # [s] from power-down to the begin of a conversion


def config_word(channel: int, full_scale: float, rate: int) -> int:
    """Config register that starts a single-shot conversion of one input against ground."""
    return (
        OS
        | (_SINGLE_ENDED | channel) << _MUX_AT
        | RANGES.index(full_scale) << _PGA_AT
        | _SINGLE_SHOT
        | RATES.index(rate) << _RATE_AT
        | _NO_COMPARATOR
    )


def swapped(word: int) -> int:
    """A word with its bytes exchanged: SMBus sends the lower byte first, this chip the higher one."""
    return (word & 0xFF) << 8 | word >> 8


def signed(word: int) -> int:
    """The two's complement of 16 bits."""
    return word - (1 << 16) if word & 1 << 15 else word


class Ads1115:
    """One chip."""

    channels = 4

    def __init__(self, bus: Any, address: int, full_scale: float, rate: int) -> None:
        """Knows where the chip is; nothing is sent yet.

        Args:
            bus: an open `smbus2.SMBus`.
            address: of the chip.
            full_scale: one of `RANGES` [V].
            rate: one of `RATES` [1/s].
        """
        self._bus = bus
        self._address = address
        self._full_scale, self._rate = full_scale, rate
        self._name = f"ADS1115 at 0x{address:02x}"

    def begin(self) -> None:
        """Looks whether a chip answers; each conversion brings its own configuration."""
        self._read(CONFIG)

    def scan(self, inputs: Sequence[int]) -> list[Conversion]:
        """Converts some inputs, one after the other."""
        return [self._convert(channel) for channel in inputs]

    def _convert(self, channel: int) -> Conversion:
        word = config_word(channel, self._full_scale, self._rate)
        with of_device(self._name):
            self._bus.write_word_data(self._address, CONFIG, swapped(word))
        needed = 1.0 / self._rate + _WAKE_UP
        patience = Patience(needed, 1.5 * needed + 0.01)
        while not (given := self._read(CONFIG)) & OS:
            if not patience.again():
                raise DeviceError(TIMEOUT, f"{self._name}: input {channel} is not converted, bit OS stays 0")
        if given != word:
            raise DeviceError(TRASH, f"{self._name}: config register reads 0x{given:04x}, 0x{word:04x} was written")
        code = signed(self._read(CONVERSION))
        return Conversion(code * self._full_scale / (_LARGEST + 1), code == _LARGEST)

    def _read(self, register: int) -> int:
        with of_device(self._name):
            return swapped(self._bus.read_word_data(self._address, register))
