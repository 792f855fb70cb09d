# SPDX-License-Identifier: Apache-2.0
"""What a first start waits for: lines on standard error while kernels are compiled, none when the cache holds them.

Numba says when it compiles a function and when it is done, and says nothing of what it loads from its cache. Kernels
that a kernel calls are compiled within it. Commands and nodes tell; a program that imports Sunpoint decides for itself.
"""

import sys
import threading
import time
from collections.abc import Callable
from typing import Any

from css_common.progress_lines import EVERY

FIRST = 2.0
"""Time of compiling [s] after which the first line comes."""

BEGINS = "compiling kernels"
"""How such a line begins."""

TYPICAL = "usually 1 to 2 minutes"
"""What the kernels of a whole mission take."""


class CompileNews:
    """Counts what is compiled, and says so while it is, also in the middle of a kernel that takes long."""

    def __init__(self, say: Callable[[str], None], now: Callable[[], float] = time.monotonic) -> None:
        """Nothing is compiled yet.

        Args:
            say: takes a line.
            now: wall clock [s].
        """
        self._say, self._now = say, now
        self._under_way: list[str] = []  # a kernel, what it calls, what that calls
        self._kernels = 0
        self._spent, self._began = 0.0, 0.0
        self._due = FIRST  # in time spent on compiling alone
        self._timer: threading.Timer | None = None
        self._lock = threading.Lock()

    def began(self, name: str) -> None:
        """A kernel of this name is being compiled from now on; empty: a function of numba's own within it."""
        with self._lock:
            self._kernels += bool(name)
            self._under_way.append(name or (self._under_way[-1] if self._under_way else "a function of numba"))
            if len(self._under_way) == 1:
                self._began = self._now()
                self._wait()

    def ended(self) -> None:
        """The kernel that began last is done."""
        with self._lock:
            self._under_way.pop()
            if not self._under_way:
                self._spent = self._so_far()
                if self._timer is not None:
                    self._timer.cancel()

    def tell(self) -> None:
        """Says a line if one is due, and looks again when the next one is."""
        with self._lock:
            if not self._under_way:
                return
            spent = self._so_far()
            if spent >= self._due:
                self._due = spent + EVERY
                self._say(
                    f"{BEGINS}, once for this machine and each kind of node ({TYPICAL} in all, kept for later "
                    f"starts): {self._kernels} in {spent:.0f} s so far, now {self._under_way[-1]}"
                )
            self._wait()

    def _so_far(self) -> float:
        return self._spent + self._now() - self._began

    def _wait(self) -> None:
        self._timer = threading.Timer(max(0.0, self._due - self._so_far()), self.tell)
        self._timer.daemon = True
        self._timer.start()


class _Wanted:
    """Whether this process tells; and whom."""

    news: CompileNews | None = None
    has_complained = False


def tell_of_compiling() -> None:
    """From now on this process says on standard error what it compiles."""
    _Wanted.news = CompileNews(lambda line: print(line, file=sys.stderr, flush=True))


def not_kept(folder: str, error: OSError) -> None:
    """Says once that what is compiled cannot be written, so that the next start compiles it anew."""
    if _Wanted.news is not None and not _Wanted.has_complained:
        _Wanted.has_complained = True
        reason = error.strerror or str(error)
        print(f"compiled kernels are not kept: {folder}: cannot be written: {reason}", file=sys.stderr, flush=True)


def name_of(function: Callable[..., Any]) -> str:
    """How a function is named in lines, with its module; empty: it is one of numba's own."""
    package, _, module = (function.__module__ or "").rpartition(".")  # what was made of a text has no module
    return "" if package.partition(".")[0] == "numba" else ".".join(filter(None, (module, function.__qualname__)))


def follow_compiler() -> None:
    """Hears from numba what it compiles; called where kernels are made."""
    from numba.core import event  # not at the start of commands that have no kernels

    class Listener(event.Listener):
        def on_start(self, event: event.Event) -> None:
            if _Wanted.news is not None:
                _Wanted.news.began(name_of(event.data["dispatcher"].py_func))

        def on_end(self, event: event.Event) -> None:
            if _Wanted.news is not None:
                _Wanted.news.ended()

    event.register("numba:compile", Listener())
