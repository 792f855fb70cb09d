# SPDX-License-Identifier: Apache-2.0
"""Chips as their data sheets describe them, behind the interfaces of smbus2 and spidev; with the ways they fail."""

import errno
import math
from typing import ClassVar


def nack(*_):
    raise OSError(errno.EREMOTEIO, "Remote I/O error")


class Ads1115Model:
    """Config and conversion register, a multiplexer, an amplifier, and time counted in reads of the config register."""

    FULL_SCALES: ClassVar[dict[int, float]] = {
        0: 6.144,
        1: 4.096,
        2: 2.048,
        3: 1.024,
        4: 0.512,
        5: 0.256,
        6: 0.256,
        7: 0.256,
    }

    def __init__(self, volts=(0.0, 0.0, 0.0, 0.0), busy_reads=1):
        self.volts = list(volts)
        self.busy_reads = busy_reads
        self.config, self.conversion = 0x8583, 0
        self.left = 0
        self.stuck = self.loses_supply = False

    def write_word(self, register, word):
        assert register == 1
        self.config = word & 0x7FFF
        if word & 0x8000 and word & 0x0100:  # OS, in single-shot mode
            self.left = self.busy_reads
            mux, full = word >> 12 & 7, self.FULL_SCALES[word >> 9 & 7]
            pairs = {0: (0, 1), 1: (0, 3), 2: (1, 3), 3: (2, 3)}
            plus = self.volts[mux - 4] if mux >= 4 else self.volts[pairs[mux][0]]
            minus = 0.0 if mux >= 4 else self.volts[pairs[mux][1]]
            code = math.floor((plus - minus) / full * 32768 + 0.5)
            self.conversion = max(-32768, min(32767, code)) & 0xFFFF

    def read_word(self, register):
        if register == 0:
            return self.conversion
        if self.stuck:
            return self.config
        if self.left:
            self.left -= 1
            return self.config
        if self.loses_supply:
            return 0x8583
        return self.config | 0x8000


class Adc128d818Model:
    """Registers of the ADC128D818 as far as single conversions of eight inputs need them."""

    def __init__(self, volts=(0.0,) * 8, reference=None, busy_reads=1):
        self.volts, self.reference, self.busy_reads = list(volts), reference, busy_reads
        self.registers = {}
        self.readings = [0] * 8
        self.left = 0
        self.not_ready_reads = 1
        self.stuck = False
        self.identity = (0x01, 0x09)
        self._reset()

    def _reset(self):
        self.registers = {0x00: 0x08, 0x07: 0, 0x08: 0, 0x09: 0, 0x0A: 0, 0x0B: 0}

    def write_byte(self, register, value):
        if register == 0x00 and value & 0x80:
            self._reset()
            return
        if register == 0x0B and self.registers[0x00] & 1:
            return  # only at rest
        if register == 0x09:
            if not self.registers[0x00] & 1:
                self._convert()
            return
        self.registers[register] = value

    def _convert(self):
        self.left = self.busy_reads
        assert self.registers[0x0B] >> 1 & 3 == 1, "mode 1 has eight single-ended inputs"
        reference = self.reference if self.registers[0x0B] & 1 else 2.56
        for channel, volts in enumerate(self.volts):
            if not self.registers[0x08] >> channel & 1:
                code = max(0, min(4095, math.floor(volts / reference * 4096)))
                self.readings[channel] = code << 4

    def read_byte(self, register):
        if register in (0x3E, 0x3F):
            return self.identity[register - 0x3E]
        if register == 0x0C:
            if self.not_ready_reads:
                self.not_ready_reads -= 1
                return 0b10
            if self.stuck:
                return 0b01
            busy, self.left = self.left > 0, max(0, self.left - 1)
            return int(busy)
        return self.registers[register]

    def read_word(self, register):
        return self.readings[register - 0x20]


class FakeSMBus:
    """An `smbus2.SMBus` with chips on it. SMBus words go lower byte first, these chips' higher byte first."""

    def __init__(self, chips):
        self.chips = chips
        self.gone = self.closed = False
        self.opened: list[int] = []

    def _chip(self, address):
        if self.gone:
            raise OSError(errno.ENODEV, "No such device")
        chip = self.chips.get(address)
        return chip if chip is not None else nack()

    def write_word_data(self, address, register, value):
        self._chip(address).write_word(register, value >> 8 | (value & 0xFF) << 8)

    def read_word_data(self, address, register):
        word = self._chip(address).read_word(register)
        return word >> 8 | (word & 0xFF) << 8

    def write_byte_data(self, address, register, value):
        self._chip(address).write_byte(register, value)

    def read_byte_data(self, address, register):
        return self._chip(address).read_byte(register)

    def close(self):
        self.closed = True


class Mcp3208Model:
    """A `spidev.SpiDev` with an MCP3208 on it, bit by bit: it waits for the start bit, whenever that comes."""

    def __init__(self, volts=(0.0,) * 8, reference=3.3):
        self.volts, self.reference = list(volts), reference
        self.absent = self.gone = self.closed = False
        self.mode = self.max_speed_hz = None

    def open(self, bus, device):
        if self.gone:
            raise FileNotFoundError(errno.ENOENT, "No such file or directory")

    def xfer2(self, sent):
        if self.gone:
            raise OSError(errno.ENODEV, "No such device")
        if self.absent:
            return [0xFF] * len(sent)  # pulled up
        bits = [byte >> (7 - i) & 1 for byte in sent for i in range(8)]
        start = bits.index(1)
        single, *number = bits[start + 1 : start + 5]
        assert single, "single-ended"
        channel = number[0] << 2 | number[1] << 1 | number[2]
        code = max(0, min(4095, math.floor(self.volts[channel] / self.reference * 4096)))
        # one clock of sampling after the last bit of the number, then the null bit and twelve bits
        answer = [0] * (start + 6) + [0] + [code >> (11 - i) & 1 for i in range(12)]
        answer = (answer + [0] * len(bits))[: len(bits)]
        return [sum(bit << (7 - i) for i, bit in enumerate(answer[k : k + 8])) for k in range(0, len(answer), 8)]

    def close(self):
        self.closed = True
