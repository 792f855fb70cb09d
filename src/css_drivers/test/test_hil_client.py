# SPDX-License-Identifier: Apache-2.0
"""The reference client in C: it compiles without a warning, and answers what it should over UDP and a serial line."""

import os
import pty
import shutil
import socket
import subprocess
import tty
from pathlib import Path

import numpy as np
import pytest

from css_drivers.hil_exchange import ANSWERED, CORRUPT, Exchange
from css_drivers.hil_frame import HAS_GYRO, HAS_SUN, HAS_WHEELS, Sensors, sensors_frame
from css_drivers.hil_link import HilLink, UdpLink

CLIENTS = Path(__file__).parents[1] / "clients"
A = np.sqrt(0.5)
NORMALS = A * np.array([[1, 0, 1], [0, 1, 1], [-1, 0, 1], [0, -1, 1], [1, 0, -1], [0, 1, -1], [-1, 0, -1], [0, -1, -1]])
WHEELS = A * np.array([[0, 1, 1], [0, 1, -1], [1, -1, 0], [-1, -1, 0]])
NONE3 = (0.0, 0.0, 0.0)


@pytest.fixture(scope="module")
def client(tmp_path_factory):
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        pytest.skip("there is no C compiler")
    program = tmp_path_factory.mktemp("client") / "hil_client"
    flags = ["-std=c11", "-O1", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]
    subprocess.run([compiler, *flags, CLIENTS / "hil_client.c", "-lm", "-o", program], check=True)
    return program


class PtyLink(HilLink):
    """The master of a pseudo-terminal whose other side is the client's serial device."""

    name = "pty"

    def __init__(self):
        self.end, other = pty.openpty()
        tty.setraw(other)
        self.port = os.ttyname(other)
        self._other = other  # held open until the client has it, or there is no line

    def send(self, data):
        os.write(self.end, data)

    def receive(self, seconds):
        import select

        return os.read(self.end, 4096) if select.select([self.end], [], [], seconds)[0] else b""

    def close(self):
        for file in (self.end, self._other):
            os.close(file)


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_one:
        any_one.bind(("127.0.0.1", 0))
        return any_one.getsockname()[1]


@pytest.fixture(params=["udp", "serial"])
def board(client, request):
    """The client at work, and the link to it."""
    link: HilLink
    if request.param == "udp":
        port = free_port()
        link, arguments = UdpLink("127.0.0.1", port), ["udp", str(port)]
    else:
        link = line = PtyLink()
        arguments = [line.port]
    process = subprocess.Popen([client, *arguments])
    try:
        yield link
    finally:
        process.kill()
        process.wait()
        link.close()


def command(link, told, wheels=4):
    """What it answers; it is asked again until it is up."""
    exchange = Exchange(lambda: link, wheels, told.rods)
    for k in range(100):
        given = exchange.ask(k, 10 * k, told, 0.1)
        if given is not None:
            return given, exchange
    raise AssertionError(f"no answer: {exchange.counts}")


def test_it_finds_the_sun_damps_rates_and_turns_the_arrays_to_the_sun(board):
    sun = np.array([0.36, 0.48, 0.8])
    rate = np.array([0.002, -0.004, 0.001])
    cells = np.where(NORMALS @ sun > 0.5, NORMALS @ sun, 0.0)
    cells[6] = np.nan
    told = Sensors(HAS_GYRO | HAS_WHEELS, 100_000, tuple(rate), NONE3, tuple(cells), (0.0,) * 4, 0)
    given, exchange = command(board, told)
    expected = np.nansum(cells[:, None] * NORMALS, axis=0)
    expected /= np.linalg.norm(expected)
    assert given.flags == HAS_SUN
    np.testing.assert_allclose(given.sun, expected, atol=1e-6)
    torque_b = 0.03 * np.cross([0.0, 0.0, 1.0], expected) - 0.7 * rate
    motors = -np.linalg.pinv(WHEELS.T) @ torque_b
    assert np.max(np.abs(motors)) < 0.03
    np.testing.assert_allclose(given.torque, motors, atol=1e-7)
    assert exchange.counts[ANSWERED] == 1


def test_without_sun_or_gyro_it_commands_nothing_that_it_does_not_know(board):
    dark = Sensors(0, 100_000, (9.0, 9.0, 9.0), NONE3, (0.0,) * 8, (0.0,) * 4, 3)
    given, _ = command(board, dark)
    assert given.flags == 0
    assert given.sun == NONE3
    assert given.torque == (0.0,) * 4
    assert given.dipole == (0.0,) * 3


def test_torques_are_cut_to_what_the_wheels_can(board):
    spinning = Sensors(HAS_GYRO, 100_000, (1.0, 1.0, 1.0), NONE3, (0.0,) * 8, (0.0,) * 4, 0)
    given, _ = command(board, spinning)
    assert np.max(np.abs(given.torque)) == pytest.approx(0.03)


def test_rubbish_and_damaged_frames_are_passed_over(board):
    told = Sensors(HAS_GYRO, 100_000, NONE3, NONE3, (0.0,) * 8, (0.0,) * 4, 0)
    command(board, told)
    damaged = bytearray(sensors_frame(1, 1, told))
    damaged[30] ^= 1
    for rubbish in (bytes(damaged), b"\x53\xa7\x01", b"\x53" * 50, b"\x00" * 300):
        board.send(rubbish)
    _, exchange = command(board, told)
    assert exchange.counts[CORRUPT] == 0
