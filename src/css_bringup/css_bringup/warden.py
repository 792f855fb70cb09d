# SPDX-License-Identifier: Apache-2.0
"""Ends what a flight leaves behind when its supervisor is killed.

The supervisor starts this file as a program of its own and tells it each process on a line of its input, whose end is
the end of the supervisor, however it came. Nodes have heard of that themselves and close what they have open; one that
is stopped is woken to do so, one that hangs is killed. The flight's temporary folder goes last.
"""

import contextlib
import os
import select
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

_LIMIT_S = 20.0  # for nodes that answer, wait for listeners, and close a recording


class Warden:
    """The supervisor's side: the program, which is told whom to look after.

    Attributes:
        pid: its process.
    """

    def __init__(self, folder: Path) -> None:
        """Starts the program.

        Args:
            folder: what it removes in the end.
        """
        command = [sys.executable, "-I", "-S", __file__, str(folder)]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, start_new_session=True)
        self.pid = self._process.pid

    def look_after(self, pid: int) -> None:
        """Tells it of a process that was started."""
        assert self._process.stdin is not None
        with contextlib.suppress(BrokenPipeError):  # somebody has killed it: the nodes still hear of a death themselves
            self._process.stdin.write(b"%d\n" % pid)
            self._process.stdin.flush()

    def dismiss(self) -> None:
        """Lets it end, after all others have."""
        self._process.communicate()


def main(folder: str) -> None:
    """Waits for the end of the input, then for that of the processes."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    handles = []
    for line in sys.stdin.buffer:
        with contextlib.suppress(ProcessLookupError):
            handles.append(os.pidfd_open(int(line)))
    _signal(handles, signal.SIGCONT)
    _wait(handles, _LIMIT_S)
    _signal(handles, signal.SIGKILL)
    _wait(handles, _LIMIT_S)
    shutil.rmtree(folder, ignore_errors=True)


def _signal(handles: list[int], number: signal.Signals) -> None:
    for handle in handles:
        with contextlib.suppress(ProcessLookupError):
            signal.pidfd_send_signal(handle, number)


def _wait(handles: list[int], limit_s: float) -> None:
    deadline = time.monotonic() + limit_s
    for handle in handles:
        # readable once its process has ended
        select.select([handle], [], [], max(0.0, deadline - time.monotonic()))


if __name__ == "__main__":
    main(sys.argv[1])
