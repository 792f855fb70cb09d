# SPDX-License-Identifier: Apache-2.0
"""Flights with a board in the loop: its commands fly, and what goes wrong between is safe, counted and said.

Cycles are half a second long, so that a loaded machine answers in time.
"""

import json
import os
import pty
import select
import socket
import threading
import tty
from typing import Any

import numpy as np
import pytest
from flights import samples

from css_bringup.commands import hil
from css_drivers.hil_exchange import GREETING
from css_drivers.hil_frame import HAS_SUN, Command, FrameReader, command_frame
from css_msgs.msg import SunEstimate, WheelTorqueCommand

PERIOD, CYCLES = 0.5, 8
TORQUE = (0.001, -0.002, 0.003, 0.004)
SUN = (0.0, 0.6, 0.8)


def good(frame, sequence=None):
    """The answer to a frame of sensors."""
    torque = tuple(t * (1 + frame.sequence % 3) for t in TORQUE)
    return command_frame(
        frame.sequence if sequence is None else sequence, frame.stamp_ns, Command(HAS_SUN, SUN, torque, ())
    )


class Board(threading.Thread):
    """A board in Python. `answer` makes of a frame what it sends back, as several pieces."""

    file: Any
    options: list[str]

    def _open(self):
        raise NotImplementedError

    def _receive(self):
        raise NotImplementedError

    def _close(self):
        raise NotImplementedError

    def __init__(self, answer=lambda frame: [good(frame)]):
        super().__init__(daemon=True)
        self.answer, self.seen, self.over = answer, [], threading.Event()
        self._open()
        self.start()

    def run(self):
        reader = FrameReader()
        while not self.over.is_set():
            if not select.select([self.file], [], [], 0.05)[0]:
                continue
            data, send = self._receive()
            for frame in reader.feed(data):
                self.seen.append(frame)
                for piece in [good(frame)] if frame.sequence == GREETING else self.answer(frame):
                    send(piece)

    def end(self):
        self.over.set()
        self.join()
        self._close()


class UdpBoard(Board):
    def _open(self):
        self.file = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.file.bind(("127.0.0.1", 0))
        self.options = ["--udp", f"127.0.0.1:{self.file.getsockname()[1]}"]

    def _receive(self):
        data, peer = self.file.recvfrom(4096)
        return data, lambda piece: self.file.sendto(piece, peer)

    def _close(self):
        self.file.close()


class SerialBoard(Board):
    def _open(self):
        self.file, self._other = pty.openpty()
        tty.setraw(self._other)
        self.options = ["--serial", os.ttyname(self._other)]

    def _receive(self):
        return os.read(self.file, 4096), lambda piece: os.write(self.file, piece)

    def _close(self):
        os.close(self.file)
        os.close(self._other)


@pytest.fixture
def fly(tmp_path, capfd):
    """Flies with a board: exit code, result of `--json`, what was printed, the recording."""
    boards = []

    def fly(kind, answer=None, *options):
        board = kind() if answer is None else kind(answer)
        boards.append(board)
        bag = tmp_path / "bag"
        arguments = ["okeefe_2013", *board.options, "--set", f"mission.period={PERIOD}", "--json", "--out", str(bag)]
        code = hil.main([*arguments, "--duration", str(CYCLES * PERIOD), *options])
        printed = capfd.readouterr()
        return code, json.loads(printed.out.splitlines()[-1]), printed.out + printed.err, bag, board

    yield fly
    for board in boards:
        board.end()


@pytest.mark.parametrize("kind", [UdpBoard, SerialBoard])
def test_commands_of_the_board_fly_and_are_recorded(fly, kind):
    _, result, _, bag, board = fly(kind, None, "--estimate")
    assert result["hil"]["frames_answered"] == result["hil"]["frames_sent"] == CYCLES
    assert not result["failure"]
    assert [frame.sequence for frame in board.seen if frame.sequence != GREETING] == list(range(CYCLES))
    torques = [s.torque for s in samples(bag, "/wheels/torque_command", WheelTorqueCommand)]
    np.testing.assert_allclose(torques, [np.array(TORQUE) * (1 + k % 3) for k in range(CYCLES)], rtol=1e-7)
    estimates = samples(bag, "/hil_bridge/sun_estimate", SunEstimate)
    np.testing.assert_allclose([e.sun_b for e in estimates], [SUN] * CYCLES, atol=1e-7)
    assert {run["estimator"] for run in result["runs"]} == {"ekf", "hil_bridge"}
    told = board.seen[-1].values
    assert (told["cells"], told["wheels"], told["rods"], told["period"]) == (8, 4, 0, 500_000)
    assert np.linalg.norm(told["gyro"]) > 0.0


def test_lost_late_and_damaged_frames_are_safe_counted_and_said(fly):
    def answer(frame):
        if frame.sequence == 2:
            return []
        if frame.sequence == 3:
            return [good(frame, 2), good(frame)]
        if frame.sequence == 4:
            damaged = bytearray(good(frame))
            damaged[25] ^= 0x10
            return [bytes(damaged)]
        return [b"noise", good(frame)] if frame.sequence == 5 else [good(frame)]

    code, result, printed, bag, _ = fly(SerialBoard, answer)
    counts = result["hil"]
    assert (counts["frames_sent"], counts["frames_lost"], counts["frames_late"]) == (CYCLES, 2, 1)
    assert counts["frames_corrupt"] == 1
    torques = [s.torque for s in samples(bag, "/wheels/torque_command", WheelTorqueCommand)]
    assert [not np.any(torque) for torque in torques] == [k in (2, 4) for k in range(CYCLES)]
    assert code == 1
    assert "2 frames that the board did not answer in time" in printed
    assert "1 frames of the board that were damaged" in printed
    assert any("did not answer in time" in line for line in result["incidents"])


def test_board_that_falls_silent_ends_the_flight_with_its_recording_whole(fly):
    code, result, printed, bag, _ = fly(
        UdpBoard, lambda frame: [good(frame)] if frame.sequence < 2 else [], "--silence", "1"
    )
    assert code == 1
    assert "has not answered for 1 s" in result["failure"]
    assert result["hil"]["frames_answered"] == 2
    assert len(samples(bag, "/wheels/torque_command", WheelTorqueCommand)) >= 3
    assert "Traceback" not in printed


def test_no_board_at_all(tmp_path, capfd):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as deaf:
        deaf.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{deaf.getsockname()[1]}"
        code = hil.main(["okeefe_2013", "--udp", address, "--wait", "0.3", "--out", str(tmp_path / "bag")])
    printed = capfd.readouterr()
    assert code == 1
    assert f"no answer of the board on {address} within 0.3 s" in printed.err
    assert "4 wheels and 0 rods" in printed.err
    assert not (tmp_path / "bag").exists()


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["okeefe_2013", "--serial", "/dev/no_such_port"], "/dev/no_such_port: No such file or directory"),
        (["okeefe_2013", "--udp", "somewhere"], "expected HOST:PORT"),
        (["okeefe_2013", "--udp", "127.0.0.1:99999"], "udp.port"),
        (["okeefe_2013", "--udp", "127.0.0.1:1", "--baud", "9600"], "--baud goes with --serial"),
        (["okeefe_2013", "--serial", "/dev/null", "--baud", "9600"], "expected at least"),
        (["esprit_2006", "--udp", "127.0.0.1:1"], "no node commands wheels or rods"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(capfd, arguments, reason):
    assert hil.main(arguments) == 2
    (line,) = capfd.readouterr().err.strip().splitlines()
    assert reason in line
