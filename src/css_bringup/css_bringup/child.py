# SPDX-License-Identifier: Apache-2.0
"""One supervised process: its start, its end, its log, and whether it works."""

import contextlib
import os
import signal
import subprocess
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO

from css_common.security import of_process
from css_common.supervised import announced, duties

_STOPPED = "T"
_TRACED = "t"


@dataclass
class Pulse:
    """Whether a process works, looked at now and then.

    Time counts as far as the supervisor was awake itself: one that was stopped finds nobody guilty of it.

    Attributes:
        pid: the process.
        source: descriptor of the pipe into which it writes once a second from the loop that runs its callbacks.
        silent_s: for how long it has written nothing, counted from its first word on [s].
        stopped_s: for how long it has been stopped by a signal [s].
        announced: faults of its own that it has told beforehand.
    """

    pid: int
    source: int
    silent_s: float = 0.0
    stopped_s: float = 0.0
    announced: list[str] = field(default_factory=list)
    _heard: bool = False

    def look(self, elapsed_s: float) -> None:
        """Takes notice of the process, `elapsed_s` after the last look."""
        state = self._state()
        self.stopped_s = self.stopped_s + elapsed_s if state == _STOPPED else 0.0
        if self._beats() or state == _TRACED:  # somebody is looking into it with a debugger
            self.silent_s = 0.0
        elif self._heard:
            self.silent_s += elapsed_s

    def frozen(self, stopped_limit_s: float, silent_limit_s: float) -> str:
        """Why it counts as frozen; empty while it does not."""
        if self.stopped_s > stopped_limit_s:
            return f"stopped by a signal for {self.stopped_s:.1f} s"
        if self.silent_s > silent_limit_s:
            return f"no sign of life for {self.silent_s:.1f} s"
        return ""

    def close(self) -> None:
        """Gives the pipe up."""
        os.close(self.source)

    def _beats(self) -> bool:
        with contextlib.suppress(BlockingIOError):
            beats = os.read(self.source, 65536)
            self.announced += announced(beats)
            self._heard = self._heard or bool(beats)
            return bool(beats)
        return False

    def _state(self) -> str:
        try:
            # the name in parentheses may hold anything
            return Path(f"/proc/{self.pid}/stat").read_text(errors="replace").rpartition(")")[2].split()[0]
        except (OSError, IndexError):
            return ""


@dataclass
class Child:
    """One supervised process."""

    name: str
    command: list[str]
    log: Path
    process: subprocess.Popen | None = None
    stream: IO[bytes] | None = None
    pulse: Pulse | None = None
    deaths: list[float] = field(default_factory=list)
    asked_to_end: bool = False
    done: list[str] = field(default_factory=list)

    def start(self) -> int:
        """Starts the process, whose number it returns; its log begins anew with the flight and survives a restart."""
        self.asked_to_end = False
        self.stream = self.log.open("wb" if self.process is None else "ab")
        source, beating = os.pipe()
        os.set_blocking(source, False)
        environment = {**os.environ, **of_process(os.environ, self.name), **duties(beating, self.done)}
        try:
            # its own session: Ctrl-C goes to the supervisor, which stops the nodes in order
            self.process = subprocess.Popen(
                self.command, stdout=self.stream, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL,
                start_new_session=True, pass_fds=(beating,), env=environment,
            )  # fmt: skip
        except OSError:
            os.close(source)
            raise
        finally:
            os.close(beating)
        self.pulse = Pulse(self.process.pid, source)
        return self.process.pid

    def announced(self) -> list[str]:
        """Faults of its own that it has told since the last look, and that are done when it is started again."""
        if self.pulse is None:
            return []
        self.pulse.look(0.0)
        told, self.pulse.announced = self.pulse.announced, []
        self.done += told
        return told

    def poll(self) -> int | None:
        """Exit code, or None while it runs."""
        return self.process.poll() if self.process else None

    def interrupt(self) -> None:
        """Asks the process to end, if it runs; once, because an interpreter that is ending dies of a second SIGINT."""
        if self.process is not None and self.process.poll() is None and not self.asked_to_end:
            self.asked_to_end = True
            self.process.send_signal(signal.SIGINT)
            self.wake()

    def wake(self) -> None:
        """Lets the process go on if a signal has stopped it: it neither answers nor hears that it is to end."""
        if self.process is not None and self.process.poll() is None:
            self.process.send_signal(signal.SIGCONT)

    def stop(self, limit: float) -> None:
        """Asks the process to end, and insists after `limit` seconds."""
        if self.process is None:
            return
        self.interrupt()
        try:
            self.process.wait(limit)
        except subprocess.TimeoutExpired:
            self.kill()
        if self.stream is not None:
            self.stream.close()
            self.stream = None
        if self.pulse is not None:
            self.pulse.close()
            self.pulse = None

    def kill(self) -> None:
        """Ends the process at once."""
        if self.process is not None:
            self.process.kill()
            self.process.wait()

    def log_tail(self, lines: int = 20) -> str:
        """The end of its log."""
        text = self.log.read_text(encoding="utf-8", errors="replace").splitlines()
        return "\n".join(text[-lines:])
