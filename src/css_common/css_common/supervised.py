# SPDX-License-Identifier: Apache-2.0
"""What a process owes the supervisor that started it: to end with it, and to say once a second that it works.

Standard library only. A process that nobody supervises has neither duty.
"""

import contextlib
import os
import signal
from collections.abc import Mapping

_SUPERVISOR = "SUNPOINT_SUPERVISOR"
_PULSE = "SUNPOINT_PULSE"
_PR_SET_PDEATHSIG = 1

_pulse: int | None = None


def duties(pulse: int) -> Mapping[str, str]:
    """Environment of a process that this one starts and supervises.

    Args:
        pulse: file descriptor of a pipe, inherited by the process, into which it writes.
    """
    return {_SUPERVISOR: str(os.getpid()), _PULSE: str(pulse)}


def take_on() -> None:
    """Takes the duties from the environment, out of reach of what this process starts itself.

    The death of the supervisor comes as an interrupt, on which recordings are closed. The kernel sends it when the
    thread ends that started this process; one that is gone already is found by the number of the parent.
    """
    global _pulse
    supervisor, pulse = os.environ.pop(_SUPERVISOR, ""), os.environ.pop(_PULSE, "")
    if not supervisor:
        return
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
