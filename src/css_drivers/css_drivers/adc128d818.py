# SPDX-License-Identifier: Apache-2.0
"""Texas Instruments ADC128D818: eight single-ended inputs, 12 bits, I2C (data sheet SNAS483).

A scan is one round of all enabled inputs, started by the one-shot register while the chip rests (bit START is 0); the
bit Busy of the status register falls when it is over. Operation mode 1 has eight inputs and no temperature. Mode and
reference can only be set at rest.
"""

from collections.abc import Sequence
from typing import Any

from css_drivers.ads1115 import swapped
from css_drivers.converter import Conversion, Patience
from css_drivers.device_errors import TIMEOUT, TRASH, DeviceError, of_device

CONFIGURATION, DISABLED, ONE_SHOT = 0x00, 0x08, 0x09
ADVANCED, STATUS, READINGS = 0x0B, 0x0C, 0x20
MANUFACTURER, REVISION = 0x3E, 0x3F
"""Registers of 8 bits; readings have 16, the higher byte first, the code in the upper 12."""

INITIALISE = 0x80  # in CONFIGURATION: registers to their defaults
EIGHT_INPUTS = 1 << 1  # in ADVANCED: mode 1
EXTERNAL_REFERENCE = 1 << 0
BUSY, NOT_READY = 1 << 0, 1 << 1
IDENTITY = (0x01, 0x09)

INTERNAL_REFERENCE = 2.56
"""[V]"""
ADDRESSES = (0x1D, 0x1E, 0x1F, 0x2D, 0x2E, 0x2F, 0x35, 0x36, 0x37)

PER_INPUT = 12.2e-3
"""Time [s] that a conversion takes."""
_START_UP = 33e-3  # [s] from power-on to the first conversion
_LARGEST = 0xFFF


class Adc128d818:
    """One chip."""

    channels = 8

    def __init__(self, bus: Any, address: int, reference: float, inputs: Sequence[int]) -> None:
        """Knows where the chip is; nothing is sent yet.

        Args:
            bus: an open `smbus2.SMBus`.
            address: of the chip.
            reference: at its pin VREF [V]; 0: the internal one.
            inputs: those that will be read; others are left out of a round, which takes its time by their number.
        """
        self._bus = bus
        self._address = address
        self._advanced = EIGHT_INPUTS | (EXTERNAL_REFERENCE if reference else 0)
        self._reference = reference or INTERNAL_REFERENCE
        self._disabled = 0xFF & ~sum(1 << channel for channel in set(inputs))
        self._count = len(set(inputs))
        self._name = f"ADC128D818 at 0x{address:02x}"

    def begin(self) -> None:
        """Resets the chip and sets mode, reference and inputs."""
        identity = self._byte(MANUFACTURER), self._byte(REVISION)
        if identity != IDENTITY:
            given = ", ".join(f"0x{byte:02x}" for byte in identity)
            raise DeviceError(TRASH, f"{self._name}: identity {given} given, expected 0x01, 0x09: another chip")
        self._write(CONFIGURATION, INITIALISE)
        patience = Patience(0.0, 2.0 * _START_UP)
        while self._byte(STATUS) & NOT_READY:
            if not patience.again():
                raise DeviceError(TIMEOUT, f"{self._name}: does not become ready")
        self._write(CONFIGURATION, 0)  # at rest
        self._write(ADVANCED, self._advanced)
        self._write(DISABLED, self._disabled)

    def scan(self, inputs: Sequence[int]) -> list[Conversion]:
        """One round of all enabled inputs."""
        self._write(ONE_SHOT, 1)
        needed = self._count * PER_INPUT
        patience = Patience(needed, 1.5 * needed + 0.02)
        while self._byte(STATUS) & BUSY:
            if not patience.again():
                raise DeviceError(TIMEOUT, f"{self._name}: a round is not over, bit Busy stays 1")
        if self._byte(ADVANCED) != self._advanced or self._byte(DISABLED) != self._disabled:
            raise DeviceError(TRASH, f"{self._name}: has lost its configuration, as after a loss of supply")
        return [self._conversion(channel) for channel in inputs]

    def _conversion(self, channel: int) -> Conversion:
        with of_device(self._name):
            word = swapped(self._bus.read_word_data(self._address, READINGS + channel))
        code = word >> 4
        return Conversion(code * self._reference / (_LARGEST + 1), code == _LARGEST)

    def _byte(self, register: int) -> int:
        with of_device(self._name):
            given: int = self._bus.read_byte_data(self._address, register)
            return given

    def _write(self, register: int, value: int) -> None:
        with of_device(self._name):
            self._bus.write_byte_data(self._address, register, value)
