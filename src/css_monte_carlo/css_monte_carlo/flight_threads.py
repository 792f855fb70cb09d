# SPDX-License-Identifier: Apache-2.0
"""Threads that fly, and give up what they fly as soon as nobody waits for it: an interrupt, an error of another.

A chunk of an orbit takes half a minute with some estimators. Whoever presses Ctrl-C waited for it, and it was thrown
away.
"""

import threading
from concurrent.futures import ThreadPoolExecutor
from types import TracebackType

from css_common.processors import usable_processors


class GivenUp(Exception):
    """The flight ended early: nobody waits for it any more."""


class _Thread(threading.local):
    given_up: threading.Event | None = None  # of the pool that it belongs to


_thread = _Thread()


class FlightThreads(ThreadPoolExecutor):
    """A pool for use as a context manager: an exception that leaves the context gives up all that flies or waits."""

    def __init__(self, threads: int | None = None) -> None:
        """No thread runs yet; None: as many as there are processors that this process may use."""
        self._given_up = threading.Event()
        super().__init__(threads or usable_processors(), "flight", _belong_to, (self._given_up,))

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Waits for what flies, to its end or up to where it next looks."""
        if kind is not None:
            self._given_up.set()
        self.shutdown(cancel_futures=kind is not None)


def _belong_to(given_up: threading.Event) -> None:
    _thread.given_up = given_up


def go_on_if_waited_for() -> None:
    """To be called by flights now and then; nothing, where they fly in no such thread.

    Raises:
        GivenUp: nobody waits for what this thread flies.
    """
    if _thread.given_up is not None and _thread.given_up.is_set():
        raise GivenUp
