# SPDX-License-Identifier: Apache-2.0
"""The way of frames to a board and back: a serial line or UDP."""

import select
import socket
import time
from abc import ABC, abstractmethod
from typing import Any

from css_common.schema import Table, Values, choice, integer, text
from css_drivers.device_errors import GONE, DeviceError, of_device, reason

SERIAL, UDP = "serial", "udp"
LINK = choice("link", SERIAL, (SERIAL, UDP), "how the board is reached")
PORT = text("serial.port", "/dev/ttyUSB0", "serial device, or a URL of pyserial")
BAUD = integer("serial.baud", 921_600, "1/s", "bits a second", low=1200, high=12_000_000)
HOST = text("udp.host", "127.0.0.1", "address of the board")
HOST_PORT = integer("udp.port", 47_000, "-", "its port", low=1, high=65_535)
LISTEN = integer("udp.listen", 0, "-", "own port; 0: any, boards answer to where a frame came from", low=0, high=65_535)

PARAMETERS: Table = (LINK, PORT, BAUD, HOST, HOST_PORT, LISTEN)

_DATAGRAM = 65_536
BITS_PER_BYTE = 10
"""On a serial line: start bit, eight of data, stop bit."""


class HilLink(ABC):
    """Carries bytes.

    Attributes:
        name: for people.
        whole: what is received at once is one frame or none.
    """

    name: str
    whole = False

    @abstractmethod
    def send(self, data: bytes) -> None:
        """Sends bytes.

        Raises:
            DeviceError: they cannot be.
        """

    @abstractmethod
    def receive(self, seconds: float) -> bytes:
        """What has come, waiting so long for it; empty when nothing has.

        Raises:
            DeviceError: the link is gone.
        """

    @abstractmethod
    def close(self) -> None:
        """Gives the link up; never fails."""


class SerialLink(HilLink):
    """A serial line."""

    def __init__(self, port: str, baud: int) -> None:
        """Opens the line.

        Raises:
            DeviceError: it cannot be opened.
        """
        import serial  # here, so that studies that read node files do not load it

        self.name = port
        try:
            self._port: Any = serial.serial_for_url(port, baudrate=baud, timeout=0.0, write_timeout=1.0)
        except (OSError, ValueError) as error:
            raise DeviceError(GONE, f"{port}: {reason(error)}") from error

    def send(self, data: bytes) -> None:
        with of_device(self.name):
            self._port.write(data)

    def receive(self, seconds: float) -> bytes:
        with of_device(self.name):
            waiting = self._port.in_waiting
            self._port.timeout = 0.0 if waiting else max(0.0, seconds)
            data: bytes = self._port.read(waiting or 1)
            return data

    def close(self) -> None:
        try:
            self._port.close()
        except OSError:
            return  # what it was is gone already


class UdpLink(HilLink):
    """UDP, a frame a datagram."""

    whole = True

    def __init__(self, host: str, port: int, listen: int = 0) -> None:
        """Opens a socket.

        Raises:
            DeviceError: the address is none, or the own port is taken.
        """
        self.name = f"{host}:{port}"
        with of_device(self.name):
            self._address = socket.getaddrinfo(host, port, socket.AF_INET, socket.SOCK_DGRAM)[0][4]
            self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            with of_device(f"own port {listen}"):
                self._socket.bind(("", listen))
        except DeviceError:
            self._socket.close()
            raise
        self._socket.setblocking(False)

    def send(self, data: bytes) -> None:
        try:
            self._socket.sendto(data, self._address)
        except ConnectionRefusedError:
            return  # nobody listens there yet: news of an earlier datagram
        except OSError as error:
            raise DeviceError(GONE, f"{self.name}: {reason(error)}") from error

    def receive(self, seconds: float) -> bytes:
        end = time.monotonic() + seconds
        while True:
            ready, _, _ = select.select([self._socket], [], [], max(0.0, end - time.monotonic()))
            if not ready:
                return b""
            try:
                data, sender = self._socket.recvfrom(_DATAGRAM)
            except ConnectionRefusedError:
                continue
            except OSError as error:
                raise DeviceError(GONE, f"{self.name}: {reason(error)}") from error
            if sender[0] == self._address[0]:
                return data

    def close(self) -> None:
        self._socket.close()


def open_link(values: Values) -> HilLink:
    """The link that some values describe, open.

    Raises:
        DeviceError: it cannot be opened.
    """
    if values[LINK] == SERIAL:
        return SerialLink(values[PORT], values[BAUD])
    return UdpLink(values[HOST], values[HOST_PORT], values[LISTEN])
