# SPDX-License-Identifier: Apache-2.0
"""Keys typed on a terminal, which is as it was afterwards."""

import os
import termios

import pytest

from css_recording import terminal_keys
from css_recording.terminal_keys import TerminalKeys


@pytest.fixture
def terminal(monkeypatch):
    """Both ends of a pseudo terminal that counts as this process's own."""
    typist, reader = os.openpty()
    monkeypatch.setattr(terminal_keys, "_is_ours", lambda file: True)
    yield typist, reader
    os.close(typist)
    os.close(reader)


def test_keys_by_name(terminal):
    typist, reader = terminal
    with TerminalKeys(reader) as keys:
        assert keys.active
        assert keys.read() == []
        os.write(typist, b" \x1b[C\x1b[A\x1b[Bsq")
        assert keys.read() == ["space", "right", "up", "down", "s", "q"]
        os.write(typist, b"\x1b[")
        assert keys.read() == []
        os.write(typist, b"C7")
        assert keys.read() == ["right"]


@pytest.mark.parametrize("ending", [None, KeyboardInterrupt, RuntimeError])
def test_the_terminal_is_restored_however_it_ends(terminal, ending):
    _, reader = terminal
    before = termios.tcgetattr(reader)
    try:
        with TerminalKeys(reader):
            assert not termios.tcgetattr(reader)[3] & termios.ICANON
            assert termios.tcgetattr(reader)[3] & termios.ISIG  # Ctrl-C is still a signal
            if ending is not None:
                raise ending
    except (KeyboardInterrupt, RuntimeError):
        pass
    assert termios.tcgetattr(reader) == before


def test_a_terminal_of_another_job_is_left_alone(terminal, monkeypatch):
    typist, reader = terminal
    monkeypatch.setattr(terminal_keys, "_is_ours", lambda file: False)
    before = termios.tcgetattr(reader)
    with TerminalKeys(reader) as keys:
        os.write(typist, b" ")
        assert not keys.active
        assert keys.read() == []
        assert termios.tcgetattr(reader) == before


def test_no_terminal_no_keys():
    reading, writing = os.pipe()
    try:
        os.write(writing, b" ")
        with TerminalKeys(reading) as keys:
            assert not keys.active
            assert keys.read() == []
    finally:
        os.close(reading)
        os.close(writing)
