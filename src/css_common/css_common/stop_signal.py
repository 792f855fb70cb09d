# SPDX-License-Identifier: Apache-2.0
"""Being asked to stop: signals that are noted and looked at when nothing is under way that they could tear apart."""

import signal

_STOPPING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class StopSignal:
    """Remembers that the process was asked to end, by SIGINT, SIGTERM or a closed terminal.

    As a context manager it does so inside only: at the end signals mean again what they meant before.

    Attributes:
        came: it was.
        raises: the first signal also raises KeyboardInterrupt, for a start that has no loop to look at `came`.
    """

    def __init__(self, *, raises: bool = False) -> None:
        self.came = False
        self.raises = raises
        self._before = {number: signal.signal(number, self._note) for number in _STOPPING}

    def __enter__(self) -> "StopSignal":
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def ignore(self) -> None:
        """Makes further signals nothing, for the end of a process: Python gives up handlers before it has ended."""
        for number in _STOPPING:
            signal.signal(number, signal.SIG_IGN)

    def _note(self, number: int, frame: object) -> None:
        first, self.came = not self.came, True
        if first and self.raises:
            raise KeyboardInterrupt
