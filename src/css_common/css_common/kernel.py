# SPDX-License-Identifier: Apache-2.0
"""The decorators that compile Sunpoint's algorithms, and the place of the compile cache.

Numba checks only the file of the function it loads from its cache: a cached caller keeps an old copy of a
function that lives in another file. The cache folder of a kernel is therefore named by a hash of every source file
that it can be made from, and of the versions that compile it: edit one, and what is made from it is compiled anew.
"""

import os
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, ParamSpec, Protocol, TypeVar, cast

import llvmlite
import numba

from css_common import places
from css_common.kernel_sources import hash_of, kernel_modules, sources_of

P = ParamSpec("P")
R = TypeVar("R", covariant=True)

_COMPILER = f"{sys.version_info[:2]} {numba.__version__} {llvmlite.__version__}"
_OPTIONS: dict[str, Any] = {"cache": True, "error_model": "numpy", "fastmath": False}
_UNCOUNTED: dict[str, Any] = _OPTIONS | {"_nrt": False}


@cache
def study_hash(module: str) -> str:
    """Hash of all that a module of studies compiles: what it imports, all kernels below it, and the compiler."""
    return hash_of(kernel_modules() | sources_of(module), _COMPILER)


@cache
def cache_folder(module: str) -> Path:
    """Folder of a module's compiled kernels: inside the project when started by `./sunpoint`, else the user's cache."""
    return _kernels() / hash_of(sources_of(module), _COMPILER)


@cache
def _kernels() -> Path:
    return places.scratch("kernels")


def _compiled(function: Callable[..., Any], folder: Path, options: dict[str, Any]) -> Any:
    # Numba takes the folder that its configuration names while it makes the dispatcher, and reads the configuration
    # anew from its environment whenever a variable of it has changed.
    if not os.environ.get("NUMBA_CACHE_DIR"):
        numba.config.CACHE_DIR = str(folder)  # type: ignore[attr-defined]  # made at run time
    return numba.njit(**options)(function)


class Kernel(Protocol[P, R]):
    """A compiled function."""

    @property
    def py_func(self) -> Callable[P, R]:
        """The plain Python that it was made of."""

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> R:
        """Runs the compiled code, which is made at the first call with arguments of new types."""


def kernel(function: Callable[P, R]) -> "Kernel[P, R]":
    """Compiles a pure function on scalars, tuples and small arrays; `kernel_function.py_func` is the plain Python.

    Arrays that go in are not counted as references: counting costs as much as the arithmetic of a whole control
    cycle. A kernel can therefore make no array, and must return none (its owner would free it twice); it writes into
    those that it is given.

    Raises:
        TypeError: at the first call, when the function returns an array.
    """
    return _uncounted(function, cache_folder(function.__module__))


def steps_kernel(function: Callable[P, R]) -> "Kernel[P, R]":
    """The steps of a study's loop: a `kernel` that calls others by the types of its arguments, as `outer_kernel` does.

    Its sources do not name what it is made from, so that, as a `kernel`, it would keep old estimators.
    """
    return _uncounted(function, _kernels() / study_hash(function.__module__))


def _uncounted(function: Callable[P, R], folder: Path) -> "Kernel[P, R]":
    dispatcher: Any = _compiled(function, folder, _UNCOUNTED)
    if numba.config.DISABLE_JIT:  # type: ignore[attr-defined]  # made at run time
        return dispatcher
    compile_types = dispatcher.compile

    def compile_checked(signature: Any) -> Any:
        entry = compile_types(signature)
        for compiled in dispatcher.overloads.values():
            if _holds_array(compiled.signature.return_type):
                raise TypeError(f"{function.__qualname__}: a kernel must not return an array; let it write into one")
        return entry

    dispatcher.compile = compile_checked
    return dispatcher


def outer_kernel(function: Callable[P, R]) -> "Kernel[P, R]":
    """Compiles an outermost loop of a study: it may make and return arrays, and other threads go on meanwhile.

    Which kernels it calls may follow from the types of its arguments: it is compiled anew with any of them.
    """
    return _compiled(function, _kernels() / study_hash(function.__module__), _OPTIONS | {"nogil": True})


def _holds_array(numba_type: Any) -> bool:
    if isinstance(numba_type, numba.types.BaseTuple):
        members: Any = numba_type
        return any(map(_holds_array, members.types))
    return isinstance(numba_type, (numba.types.Array, numba.types.Record))


def typed_call(function: Callable[P, R]) -> Callable[P, R]:
    """A kernel bound to the argument types of its first call.

    Numba looks the types of all arguments up at every call from Python, which for nested parameters takes several
    times as long as the kernel itself. A component calls its kernels with the same types for ever and need not ask
    again. The types must really never change: they are not checked any more. Arguments go by position.
    """
    entry: Callable[..., Any] | None = None

    def call(*arguments: Any) -> Any:
        nonlocal entry
        if entry is not None:
            return entry(*arguments)
        result = function(*arguments)  # type: ignore[call-arg]  # as many as the caller was held to
        overloads = getattr(function, "overloads", None)  # none when compilation is switched off for debugging
        if overloads is not None:
            entry = overloads[tuple(map(numba.typeof, arguments))].entry_point
        else:
            entry = function
        return result

    return cast("Callable[P, R]", call)
