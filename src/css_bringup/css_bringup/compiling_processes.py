# SPDX-License-Identifier: Apache-2.0
"""What nodes in processes of their own compile, said where the flight was started: they write it into their logs."""

import os
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path

from css_common.compile_news import BEGINS
from css_common.progress_lines import EVERY

_TAIL = 400  # bytes: longer than such a line


class CompilingProcesses:
    """Looks at the logs of nodes now and then, and says the last line of one that compiles."""

    def __init__(self, now: Callable[[], float] = time.monotonic) -> None:
        """The first look is after a while.

        Args:
            now: wall clock [s].
        """
        self._now = now
        self._due = now() + EVERY
        self._said: set[str] = set()

    def tell(self, logs: Mapping[str, Path]) -> None:
        """Prints a line on standard error if one is due; to be called often.

        Args:
            logs: of the nodes, by name.
        """
        if self._now() < self._due:
            return
        self._due = self._now() + EVERY
        for name, log in logs.items():
            line = _last_line(log)
            if line.startswith(BEGINS) and line not in self._said:
                self._said.add(line)
                print(f"{name}: {line}", file=sys.stderr, flush=True)
                return  # the others compile much the same at the same time


def _last_line(log: Path) -> str:
    try:
        with log.open("rb") as stream:
            stream.seek(max(0, os.fstat(stream.fileno()).st_size - _TAIL))
            lines = stream.read().decode(errors="replace").splitlines()
    except OSError:  # not there yet
        return ""
    return lines[-1] if lines else ""
