# SPDX-License-Identifier: Apache-2.0
"""Ending a process in order when it is asked to."""

import signal


class StopSignal:
    """Remembers that the process was asked to end, by SIGINT, SIGTERM or a closed terminal.

    Attributes:
        came: it was.
    """

    def __init__(self) -> None:
        self.came = False
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, self._note)

    def _note(self, number: int, frame: object) -> None:
        self.came = True
