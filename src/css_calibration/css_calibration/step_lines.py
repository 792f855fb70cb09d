# SPDX-License-Identifier: Apache-2.0
"""A line for each step of a command that takes a while."""

import sys
import time
from collections.abc import Callable

_SHOWN_AFTER_S = 2.0


def step_lines() -> Callable[[str], None]:
    """What prints the steps on standard error, once the whole has taken two seconds."""
    began = time.monotonic()

    def tell(line: str) -> None:
        if time.monotonic() - began > _SHOWN_AFTER_S:
            print(f"... {line}", file=sys.stderr, flush=True)

    return tell
