# SPDX-License-Identifier: Apache-2.0
"""Exchanges with a board that answers, is late, says rubbish, is silent or is pulled out."""

import pytest

from css_drivers.device_errors import GONE, DeviceError
from css_drivers.hil_exchange import ANSWERED, CORRUPT, DOWN, LATE, LOST, SENT, WRONG, Exchange, greet
from css_drivers.hil_frame import Command, FrameReader, Sensors, command_frame, sensors_frame
from css_drivers.hil_link import HilLink

NONE3 = (0.0, 0.0, 0.0)
TOLD = Sensors(0, 100_000, NONE3, NONE3, (0.5,), (1.0, 2.0), 0)
COMMAND = Command(0, NONE3, (0.25, -0.5), ())
WITHIN = 0.02


class ScriptedLink(HilLink):
    """Answers each frame of sensors by what a function makes of its sequence and stamp."""

    name = "board"

    def __init__(self, answer, whole=False):
        self.answer, self.whole = answer, whole
        self.reader, self.waiting = FrameReader(), []
        self.closed = self.gone = False

    def send(self, data):
        if self.gone:
            raise DeviceError(GONE, "board: No such device")
        for frame in self.reader.feed(data):
            self.waiting += self.answer(frame.sequence, frame.stamp_ns)

    def receive(self, seconds):
        return self.waiting.pop(0) if self.waiting else b""

    def close(self):
        self.closed = True


def good(sequence, stamp_ns):
    return command_frame(sequence, stamp_ns, COMMAND)


def exchange(answer, cycles=3, whole=False):
    """Some exchanges, what they gave, and what was counted of troubles."""
    link = ScriptedLink(answer, whole)
    exchange = Exchange(lambda: link, 2, 0)
    given = [exchange.ask(k, 1000 + k, TOLD, WITHIN) for k in range(cycles)]
    return given, {key: n for key, n in exchange.counts.items() if n}


@pytest.mark.parametrize("whole", [False, True])
def test_board_that_answers(whole):
    given, counts = exchange(lambda k, t: [good(k, t)], whole=whole)
    assert given == [COMMAND] * 3
    assert counts == {SENT: 3, ANSWERED: 3}


def test_answer_may_come_byte_by_byte():
    given, counts = exchange(lambda k, t: [bytes([byte]) for byte in good(k, t)])
    assert given == [COMMAND] * 3
    assert counts == {SENT: 3, ANSWERED: 3}


def test_silent_board_loses_every_frame():
    given, counts = exchange(lambda k, t: [])
    assert given == [None] * 3
    assert counts == {SENT: 3, LOST: 3}


@pytest.mark.parametrize("whole", [False, True])
def test_answer_that_is_late_is_not_taken_for_the_next_one(whole):
    given, counts = exchange(lambda k, t: [good(k - 1, t - 1)] if k else [], whole=whole)
    assert given == [None] * 3
    assert counts == {SENT: 3, LOST: 3, LATE: 2}


@pytest.mark.parametrize("whole", [False, True])
def test_damaged_answer_is_counted_and_the_good_one_behind_it_taken(whole):
    def answer(k, t):
        damaged = bytearray(good(k, t))
        damaged[20] ^= 4
        return [bytes(damaged), good(k, t)]

    given, counts = exchange(answer, whole=whole)
    assert given == [COMMAND] * 3
    assert counts == {SENT: 3, ANSWERED: 3, CORRUPT: 3}


@pytest.mark.parametrize(
    "wrong",
    [
        lambda k, t: command_frame(k, t, Command(0, NONE3, (0.0,), ())),
        lambda k, t: command_frame(k, t, Command(0, NONE3, (0.0, float("nan")), ())),
        lambda k, t: command_frame(k, t + 1, COMMAND),
        lambda k, t: command_frame(k + 5, t, COMMAND),
        lambda k, t: sensors_frame(k, t, TOLD),
    ],
    ids=["wheels", "no number", "stamp", "sequence", "echo"],
)
def test_whole_frames_that_answer_nothing(wrong):
    given, counts = exchange(lambda k, t: [wrong(k, t)])
    assert given == [None] * 3
    assert counts == {SENT: 3, LOST: 3, WRONG: 3}


def test_board_that_is_pulled_out_and_plugged_in_again(monkeypatch):
    links: list[ScriptedLink] = []
    refused: list[bool] = []

    def open_link():
        if refused:
            refused.pop()
            raise DeviceError(GONE, "board: not there")
        links.append(ScriptedLink(lambda k, t: [good(k, t)]))
        return links[-1]

    monkeypatch.setattr("css_drivers.hil_exchange._RETRY", 0.0)
    exchange = Exchange(open_link, 2, 0)
    assert exchange.ask(0, 0, TOLD, WITHIN) == COMMAND
    links[-1].gone = True
    refused.append(True)
    assert exchange.ask(1, 1, TOLD, WITHIN) is None
    assert links[0].closed
    assert "No such device" in exchange.trouble
    assert exchange.ask(2, 2, TOLD, WITHIN) is None
    assert "not there" in exchange.trouble
    assert exchange.ask(3, 3, TOLD, WITHIN) == COMMAND
    assert exchange.trouble == ""
    assert {key: n for key, n in exchange.counts.items() if n} == {SENT: 2, ANSWERED: 2, DOWN: 2}


def test_board_that_has_to_boot_is_asked_until_it_answers():
    asked = []

    def answer(k, t):
        asked.append(k)
        return [good(k, t)] if len(asked) > 2 else [b"Booting...\r\n"]

    link = ScriptedLink(answer)
    exchange = greet(link, TOLD, 2, 0, 5.0, lambda: False)
    assert exchange.counts[ANSWERED] == 1
    assert len(asked) == 3
    assert not link.closed
    assert greet(ScriptedLink(lambda k, t: []), TOLD, 2, 0, 0.05, lambda: False).counts[ANSWERED] == 0
    assert greet(ScriptedLink(lambda k, t: []), TOLD, 2, 0, 60.0, lambda: True).counts[SENT] == 0
