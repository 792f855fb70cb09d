# SPDX-License-Identifier: Apache-2.0
"""Intermediate code as numba has it before it is optimised for the processor of this machine."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from numba.core import codegen


@contextmanager
def kept_modules() -> Iterator[dict[str, str]]:
    """Texts of the modules that are compiled inside the context, by the names of their libraries.

    What numba tells of a finished library is its module after LLVM has prepared it for the processor of this machine.
    numba is locked; a version without this method is noticed at once.
    """
    kept: dict[str, str] = {}
    library: Any = codegen.CPUCodeLibrary
    optimise = library._optimize_final_module

    def keep(self: Any) -> None:
        kept[self.name] = str(self._final_module)
        optimise(self)

    library._optimize_final_module = keep
    try:
        yield kept
    finally:
        library._optimize_final_module = optimise
