# SPDX-License-Identifier: Apache-2.0
"""Where the outputs of cells come from: chips on a bus, or a line of text. Opened, read, closed and opened again."""

import math
import time
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from css_common.device import Stop
from css_drivers.converter import Converter
from css_drivers.device_errors import GONE, TIMEOUT, DeviceError, of_device, reason
from css_drivers.text_line import LineBuffer, LineError, LineFormat, parse_line

_MOST_MISSED = 10_000  # a counter that goes further ahead has begun anew


class Scan(NamedTuple):
    """All cells, read once."""

    values: tuple[float, ...]  # [V], or what a line is written in; NaN: that cell has no output
    at_limit: int  # bit i: the converter of cell i gave its largest code
    stamp_ns: int  # of the wall clock, the middle of the scan
    taken_ns: int  # the same instant of time.monotonic_ns()
    took_ns: int  # from the begin of the first conversion to the end of the last


class CellSource(ABC):
    """One way to the cells.

    Attributes:
        counts: what went wrong without costing a scan, by name.
        paces: a scan comes when the device gives one; else it is asked for.
    """

    paces = False

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()

    @abstractmethod
    def open(self) -> None:
        """Opens bus or line and prepares the device.

        Raises:
            DeviceError: it is not there.
        """

    @abstractmethod
    def close(self) -> None:
        """Gives the bus up; never fails."""

    @abstractmethod
    def scan(self, stop: Stop) -> Scan:
        """Reads all cells.

        Raises:
            DeviceError: there is no reading.
        """


class _Connected(NamedTuple):
    """A chip that cells hang on."""

    chip: Converter
    cells: list[int]
    channels: list[int]  # of the chip, for each of these


class ChipSource(CellSource):
    """Cells on one or several chips of a bus, read one after the other."""

    def __init__(
        self, open_bus: Callable[[], Any], make_chips: Callable[[Any], Sequence[Converter]], inputs: Sequence[int]
    ) -> None:
        """Prepares a source.

        Args:
            open_bus: opens the bus; what it gives has `close`.
            make_chips: the chips on an open bus.
            inputs: of each cell, counted through all chips.
        """
        super().__init__()
        self._open_bus, self._make_chips = open_bus, make_chips
        self._inputs = inputs
        self._bus: Any = None
        self._chips: list[_Connected] = []

    def open(self) -> None:
        self._bus = self._open_bus()
        first = 0
        for chip in self._make_chips(self._bus):
            cells = [i for i, channel in enumerate(self._inputs) if first <= channel < first + chip.channels]
            if cells:  # else it need not be there
                self._chips.append(_Connected(chip, cells, [self._inputs[i] - first for i in cells]))
                chip.begin()
            first += chip.channels

    def close(self) -> None:
        bus, self._bus, self._chips = self._bus, None, []
        if bus is not None:
            try:
                bus.close()
            except OSError:
                self.counts["close_failed"] += 1

    def scan(self, stop: Stop) -> Scan:
        values, at_limit = [math.nan] * len(self._inputs), 0
        wall, begin = time.time_ns(), time.monotonic_ns()
        for chip, cells, channels in self._chips:
            for i, conversion in zip(cells, chip.scan(channels), strict=True):
                values[i] = conversion.volts
                at_limit |= conversion.at_limit << i
        took = time.monotonic_ns() - begin
        return Scan(tuple(values), at_limit, wall + took // 2, begin + took // 2, took)


class LineSource(CellSource):
    """Cells on a serial line."""

    paces = True

    def __init__(self, port: str, baud: int, form: LineFormat, delay: float, patience: float) -> None:
        """Prepares a source.

        Args:
            port: device file, or a URL that pyserial knows.
            baud: bits a second.
            form: of the lines.
            delay: time [s] from the conversion to the end of its line, by which stamps are put back.
            patience: time [s] without a line after which it counts as silent.
        """
        super().__init__()
        self._name, self._baud, self._form = port, baud, form
        self._delay_ns, self._patience = round(delay * 1e9), patience
        self._port: Any = None
        self._buffer = LineBuffer()
        self._last: int | None = None

    def open(self) -> None:
        import serial  # here, so that studies that read node files do not load it

        try:
            self._port = serial.serial_for_url(self._name, baudrate=self._baud, timeout=min(0.05, self._patience))
        except (OSError, ValueError) as error:
            raise DeviceError(GONE, f"{self._name}: {reason(error)}") from error
        self._buffer, self._last = LineBuffer(), None

    def close(self) -> None:
        port, self._port = self._port, None
        if port is not None:
            try:
                port.close()
            except OSError:
                self.counts["close_failed"] += 1

    def scan(self, stop: Stop) -> Scan:
        end = time.monotonic() + self._patience
        while not stop:
            found = self._newest(self._received())
            if found is not None:
                wall, now = time.time_ns(), time.monotonic_ns()
                return Scan(found, 0, wall - self._delay_ns, now - self._delay_ns, 0)
            if time.monotonic() >= end:
                break
        raise DeviceError(TIMEOUT, f"{self._name}: no line within {self._patience:g} s")

    def _received(self) -> bytes:
        with of_device(self._name):
            data: bytes = self._port.read(max(1, self._port.in_waiting))
            return data

    def _newest(self, data: bytes) -> tuple[float, ...] | None:
        """The cells of the last good line that some bytes end; what came before it is too old to be stamped now."""
        lines, too_long = self._buffer.feed(data)
        self.counts["lines_too_long"] += too_long
        values = None
        for line in lines:
            try:
                read = parse_line(self._form, line)
            except LineError as error:
                self.counts[f"lines_bad_{error.kind}"] += 1
                continue
            self.counts["lines_skipped"] += values is not None
            self.counts["lines_lost"] += self._missed(read.sequence)
            values = read.values
        return values

    def _missed(self, sequence: int | None) -> int:
        """How many lines there were between the last and this one; a counter that begins anew lost none."""
        last, self._last = self._last, sequence
        if last is None or sequence is None:
            return 0
        missed = sequence - last - 1
        return missed if 0 < missed <= _MOST_MISSED else 0
