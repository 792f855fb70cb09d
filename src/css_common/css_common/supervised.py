# SPDX-License-Identifier: Apache-2.0
"""What a process owes the supervisor that started it: to end with it, and to say once a second that it works.

Standard library only. A process that nobody supervises has neither duty.
"""

import contextlib
import os
import re
import signal
from collections.abc import Iterable, Mapping

_SUPERVISOR = "SUNPOINT_SUPERVISOR"
_PULSE = "SUNPOINT_PULSE"
_DONE = "SUNPOINT_FAULTS_DONE"
_PR_SET_PDEATHSIG = 1

_pulse: int | None = None
_done: tuple[str, ...] = ()


def duties(pulse: int, done: Iterable[str] = ()) -> Mapping[str, str]:
    """Environment of a process that this one starts and supervises.

    Args:
        pulse: file descriptor of a pipe, inherited by the process, into which it writes.
        done: what it has announced when it was started before.
    """
    return {_SUPERVISOR: str(os.getpid()), _PULSE: str(pulse), _DONE: "\n".join(done)}


def take_on() -> None:
    """Takes the duties from the environment, out of reach of what this process starts itself.

    The death of the supervisor comes as an interrupt, on which recordings are closed. The kernel sends it when the
    thread ends that started this process; one that is gone already is found by the number of the parent.
    """
    global _pulse, _done
    supervisor, pulse = os.environ.pop(_SUPERVISOR, ""), os.environ.pop(_PULSE, "")
    done = os.environ.pop(_DONE, "")
    if not supervisor:
        return
    _done = tuple(done.splitlines())
    import ctypes  # only what is supervised pays for it

    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGINT)
    if os.getppid() != int(supervisor):
        os.kill(os.getpid(), signal.SIGINT)
    _pulse = int(pulse)
    os.set_inheritable(_pulse, False)
    os.set_blocking(_pulse, False)


def beat() -> None:
    """Says that the process works; called where it does."""
    if _pulse is not None:
        with contextlib.suppress(OSError):  # a supervisor that is gone or stopped hears nothing
            os.write(_pulse, b".")


def is_supervised() -> bool:
    """Whether somebody starts this process anew when it is gone."""
    return _pulse is not None


def announce(text: str) -> None:
    """Tells the supervisor beforehand of what it will have to answer."""
    if _pulse is not None:
        with contextlib.suppress(OSError):
            os.write(_pulse, f"!{text}\n".encode())


def announced_before() -> tuple[str, ...]:
    """What this process announced before it was started again."""
    return _done


def announced(beats: bytes) -> list[str]:
    """What a process has announced, of all that it has written."""
    return [text.decode(errors="replace") for text in re.findall(rb"!([^\n]*)\n", beats)]
