# SPDX-License-Identifier: Apache-2.0
"""How many processors a program may use."""

import os
import sys


def usable_processors() -> int:
    """Processors that this process may run on; all of the machine where the system has no say in it."""
    if sys.platform == "linux":
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
