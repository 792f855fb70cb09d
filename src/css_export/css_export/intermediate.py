# SPDX-License-Identifier: Apache-2.0
"""Intermediate code as numba has it before it is optimised for the processor of this machine."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numba
from numba.core.codegen import JITCPUCodegen


@contextmanager
def kept_module(outermost: str) -> Iterator[list[str]]:
    """Keeps the text of the module of a function that is compiled inside the context.

    What numba tells of a finished function is its module after LLVM has prepared it for the processor of this machine.
    Functions that it compiles on the way are prepared so before they are linked into it. They are left without
    instructions on several numbers at once, as many as this processor has: another one can only take them apart again.
    numba is locked; a version without what is replaced here is noticed at once.

    Args:
        outermost: name of the function.
    """
    kept: list[str] = []
    library: Any = JITCPUCodegen._library_class
    optimise = library._optimize_final_module

    def keep(self: Any) -> None:
        if self.name == outermost:
            kept.append(str(self._final_module))
            optimise(self)
            return
        settings: Any = numba.config
        before, settings.LOOP_VECTORIZE = settings.LOOP_VECTORIZE, 0
        try:
            optimise(self)
        finally:
            settings.LOOP_VECTORIZE = before

    library._optimize_final_module = keep
    try:
        yield kept
    finally:
        library._optimize_final_module = optimise
