# SPDX-License-Identifier: Apache-2.0
"""How far a command is, for those who read a log: a line on standard error now and then, none if it is soon done."""

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

EVERY = 10.0
"""Wall time [s] between lines."""


class ProgressLines:
    """Lines about work whose amount is known."""

    def __init__(self, what: str, unit: str, now: Callable[[], float] = time.monotonic) -> None:
        """Begins to count the time.

        Args:
            what: is being done.
            unit: of the amounts, with what follows them.
            now: wall clock [s].
        """
        self._what, self._unit = what, unit
        self._now = now
        self._told = now()

    def tell(self, done: float, total: float) -> None:
        """Prints a line when the last one was long ago; to be called often."""
        now = self._now()
        if now - self._told >= EVERY:
            self._told = now
            _say(f"{self._what}: {done:.0f} of {total:.0f} {self._unit}")


@contextmanager
def still_working(what: str) -> Iterator[None]:
    """Lines with the time passed while the context lasts, for work that does not tell how far it is.

    Where standard error is a terminal there are none: people see that it waits.

    Args:
        what: is being done.
    """
    if sys.stderr.isatty():
        yield
        return
    over = threading.Event()
    began = time.monotonic()

    def tell() -> None:
        while not over.wait(EVERY):
            _say(f"{what}: {time.monotonic() - began:.0f} s of wall time so far")

    teller = threading.Thread(target=tell, name="progress", daemon=True)
    teller.start()
    try:
        yield
    finally:
        over.set()
        teller.join()


def _say(line: str) -> None:
    print(line, file=sys.stderr, flush=True)
