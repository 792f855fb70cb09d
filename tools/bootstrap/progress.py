# SPDX-License-Identifier: Apache-2.0
"""Reports set-up steps on stderr and runs their commands with the output kept in a log file."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import FrameType

TAIL_LINES = 25
_STOPPING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class CommandFailed(Exception):
    """A set-up command ended with an error; `output` is the end of what it wrote."""

    def __init__(self, output: str, log: Path) -> None:
        super().__init__(output)
        self.output = output
        self.log = log


class Terminated(BaseException):
    """The set-up was asked to stop by a signal other than Ctrl-C."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.exit_code = 128 + number


@contextlib.contextmanager
def stoppable() -> Iterator[None]:
    """Turn SIGTERM and SIGHUP into an exception, so that running commands are stopped as on Ctrl-C."""

    def stop(number: int, _frame: FrameType | None) -> None:
        raise Terminated(number)

    previous = {number: signal.signal(number, stop) for number in (signal.SIGTERM, signal.SIGHUP)}
    try:
        yield
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)


def say(line: str) -> None:
    """Print one line of progress. Never on stdout, which belongs to the verb."""
    print(line, file=sys.stderr, flush=True)


class Step:
    """One line of progress: on a terminal with a running clock, elsewhere printed when it begins and ends."""

    def __init__(self, label: str) -> None:
        self.label = label
        self.live = sys.stderr.isatty()
        self.began = time.monotonic()
        self.shown = ""

    def __enter__(self) -> Step:
        if self.live:
            self.tick()
        else:
            say(f"sunpoint: {self.label} ...")
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if self.live:
            self._show(self._ending(kind))
            say("")
        else:
            say(f"sunpoint: {self.label}: {self._ending(kind)}")

    def tick(self) -> None:
        """Show that the step is alive."""
        if self.live:
            self._show(f"{self._elapsed():.0f} s")

    def _ending(self, kind: type[BaseException] | None) -> str:
        if kind is None:
            return f"{self._elapsed():.1f} s"
        return "failed" if issubclass(kind, Exception) else "stopped"

    def _elapsed(self) -> float:
        return time.monotonic() - self.began

    def _show(self, note: str) -> None:
        line = f"sunpoint: {self.label} ... {note}"
        if line != self.shown:
            print(f"\r\033[K{line}", end="", file=sys.stderr, flush=True)
            self.shown = line


def run(step: Step, command: Sequence[str | Path], env: Mapping[str, str], cwd: Path, log: Path) -> None:
    """Run one command of a step, its output appended to the log. Raises CommandFailed with the tail."""
    with log.open("ab") as output:
        begin = output.tell()
        output.write(f"$ {' '.join(map(str, command))}\n".encode())
        output.flush()
        # a stop that comes while the command is being started waits until there is something to be stopped
        before = signal.pthread_sigmask(signal.SIG_BLOCK, _STOPPING)
        process = None
        try:
            process = subprocess.Popen(
                command,
                env=dict(env),
                cwd=cwd,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                process_group=0,  # stopped as a whole, with the compilers that it started
                close_fds=False,  # the installation lock is inherited, to last while any command still works
                preexec_fn=lambda: signal.pthread_sigmask(signal.SIG_SETMASK, before),
            )
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
            while True:
                with contextlib.suppress(subprocess.TimeoutExpired):
                    code = process.wait(timeout=0.2)
                    break
                step.tick()
        except BaseException:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
            if process is not None:
                _stop(process)
            raise
    if code != 0:
        with log.open("rb") as written:
            written.seek(begin)
            lines = written.read().decode(errors="replace").splitlines()
        raise CommandFailed("\n".join(lines[-TAIL_LINES:]), log)


def _stop(process: subprocess.Popen[bytes]) -> None:
    """End a command with everything it started: asked first, then whatever is left by force."""
    for number in (signal.SIGINT, signal.SIGKILL):
        with contextlib.suppress(ProcessLookupError, subprocess.TimeoutExpired):
            os.killpg(process.pid, number)
            process.wait(timeout=10)
