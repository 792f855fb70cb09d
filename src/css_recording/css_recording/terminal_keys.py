# SPDX-License-Identifier: Apache-2.0
"""Single keys typed on the terminal that a process was started from."""

import os
import select
import sys
import termios
import tty
from types import TracebackType
from typing import Self

_NAMES = {b"\x1b[A": "up", b"\x1b[B": "down", b"\x1b[C": "right", b"\x1b[D": "left", b" ": "space"}


class TerminalKeys:
    """Keys as they are typed, while the context lasts; the terminal is as it was afterwards.

    Where the input is no terminal, or one that belongs to another job just now, there are none. Ctrl-C stays a signal.
    """

    def __init__(self, file: int | None = None) -> None:
        """Changes nothing yet.

        Args:
            file: descriptor of the terminal; default: standard input.
        """
        self._file = _standard_input() if file is None else file
        self._before: list | None = None
        self._typed = b""

    @property
    def active(self) -> bool:
        """Whether keys are read."""
        return self._before is not None

    def __enter__(self) -> Self:
        if self._file >= 0 and os.isatty(self._file) and _is_ours(self._file):
            self._before = termios.tcgetattr(self._file)
            tty.setcbreak(self._file, termios.TCSADRAIN)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._before is not None:
            termios.tcsetattr(self._file, termios.TCSADRAIN, self._before)
            self._before = None

    def read(self) -> list[str]:
        """Keys typed since the last call: `space`, `up`, `down`, `right`, `left`, or a letter; others are left out."""
        while self.active and select.select([self._file], [], [], 0.0)[0]:
            typed = os.read(self._file, 64)
            if not typed:  # the terminal is gone
                self._before = None
            self._typed += typed
        keys = []
        while self._typed:
            name, length = _first_key(self._typed)
            if length == 0:
                break  # the rest of it is still to come
            self._typed = self._typed[length:]
            if name:
                keys.append(name)
        return keys


def _first_key(typed: bytes) -> tuple[str, int]:
    """Name and length of the key that was typed first; no name: unknown, no length: not all of it is there."""
    for text, name in _NAMES.items():
        if typed.startswith(text):
            return name, len(text)
    if any(text.startswith(typed) for text in _NAMES):
        return "", 0
    letter = typed[:1].decode("ascii", errors="ignore")
    return (letter if letter.isalpha() else ""), 1


def _standard_input() -> int:
    try:
        return sys.stdin.fileno()
    except (AttributeError, OSError, ValueError):  # there is none
        return -1


def _is_ours(file: int) -> bool:
    """A job in the background would be stopped for touching the terminal."""
    try:
        return os.tcgetpgrp(file) == os.getpgrp()
    except OSError:
        return False
