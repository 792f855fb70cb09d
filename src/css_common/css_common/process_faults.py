# SPDX-License-Identifier: Apache-2.0
"""Faults of a node's process, done to itself at the cycle at which they are due: killed, hanging, slow.

The supervisor is told before one that it may have to answer. It starts a process that is gone anew and tells it which
lines have acted, or they would act again when the node answers what it has missed.
"""

import os
import signal
import time
from collections.abc import Callable, Iterable

from css_common import supervised
from css_common.case_faults import CaseFault
from css_common.link_kinds import HUNG, KILLED, SLOWED, of_sorts
from css_common.schema import shown


def refusal(lines: Iterable[str], alone: bool | None = None) -> str | None:
    """Why a process cannot have such faults; None when it can.

    Args:
        lines: faults of messages, clock and process.
        alone: it is a supervised process of one node; None: found out of this process.
    """
    found = of_sorts(lines, "process")
    if not found or (supervised.is_supervised() if alone is None else alone):
        return None
    return f"{shown(found[0])}: nobody would start this process anew; processes fail in flights with --processes"


class ProcessFaults:
    """What befalls the process of a node."""

    def __init__(self, farewell: Callable[[], object]) -> None:
        """Begins.

        Args:
            farewell: lets others have what was published; called before the end.
        """
        self._farewell = farewell
        self._done: set[CaseFault] = set()

    def act(self, faults: Iterable[tuple[str, CaseFault]], step: int) -> None:
        """Does what is due at a control cycle.

        Args:
            faults: those of processes, each with its line.
            step: the cycle.
        """
        for line, fault in faults:
            if not fault.acts(step):
                continue
            if fault.kind == SLOWED:
                time.sleep(fault.values[0])
            elif fault not in self._done:
                self._done.add(fault)
                supervised.announce(line)
                if fault.kind == HUNG:
                    time.sleep(fault.values[0])
                elif fault.kind == KILLED:
                    self._farewell()
                    os.kill(os.getpid(), signal.SIGKILL)
