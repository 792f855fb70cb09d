# SPDX-License-Identifier: Apache-2.0
"""The one decorator that compiles Sunpoint's algorithms, and the place of the compile cache.

Numba checks only the file of the function it loads from its cache: a cached caller keeps an old copy of a
function that lives in another file. The cache folder is therefore named by a hash of every source file that
can hold a kernel, and of the versions that compile them: edit one, and all are compiled anew.
"""

import hashlib
import importlib.util
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import llvmlite
import numba

from css_common import places

KERNEL_PACKAGES = (
    "css_common",
    "css_environment",
    "css_sim",
    "css_estimation",
    "sunpoint_control",
    "css_studies",
)
# Folders that call kernels but define none: an edit there must not cost a compilation.
_NOT_KERNELS = {"nodes", "commands", "data", "test"}


def kernel_source_hash() -> str:
    """Hash of all sources that can hold kernels and of the compiler that reads them."""
    digest = hashlib.sha256(
        f"{sys.version_info[:2]} {numba.__version__} {llvmlite.__version__}".encode()
    )
    for package in KERNEL_PACKAGES:
        spec = importlib.util.find_spec(package)
        if spec is None or not spec.submodule_search_locations:
            continue
        root = Path(spec.submodule_search_locations[0])
        for source in sorted(root.rglob("*.py")):
            relative = source.relative_to(root)
            if _NOT_KERNELS.isdisjoint(relative.parts):
                digest.update(f"{package}/{relative}".encode())
                digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


def cache_folder() -> Path:
    """Folder of the compiled kernels: inside the project when started by `./sunpoint`, else the user's cache."""
    return places.scratch("kernels") / kernel_source_hash()


def _use_cache_folder() -> None:
    # Numba reads its environment anew whenever any NUMBA_ variable changes, so the folder must stand there and not
    # only in its configuration. A child process inherits it but may find edited sources: it names its own.
    chosen_by_us = os.environ.get("SUNPOINT_KERNEL_CACHE")
    if os.environ.get("NUMBA_CACHE_DIR") in (None, chosen_by_us):
        folder = str(cache_folder())
        os.environ["NUMBA_CACHE_DIR"] = os.environ["SUNPOINT_KERNEL_CACHE"] = folder
        numba.config.CACHE_DIR = folder  # type: ignore[attr-defined]  # made at run time


_use_cache_folder()

_OPTIONS: dict[str, Any] = {"cache": True, "error_model": "numpy", "fastmath": False}
_UNCOUNTED: dict[str, Any] = _OPTIONS | {"_nrt": False}


def kernel(function: Callable[..., Any]) -> Any:
    """Compiles a pure function on scalars, tuples and small arrays; `kernel_function.py_func` is the plain Python.

    Arrays that go in are not counted as references: counting costs as much as the arithmetic of a whole control
    cycle. A kernel can therefore make no array, and must return none (its owner would free it twice); it writes into
    those that it is given.

    Raises:
        TypeError: at the first call, when the function returns an array.
    """
    dispatcher: Any = numba.njit(**_UNCOUNTED)(function)
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


outer_kernel = numba.njit(**_OPTIONS, nogil=True)
"""Compiles the outermost loops of a study: they may make and return arrays, and other threads go on meanwhile."""


def _holds_array(numba_type: Any) -> bool:
    if isinstance(numba_type, numba.types.BaseTuple):
        members: Any = numba_type
        return any(map(_holds_array, members.types))
    return isinstance(numba_type, (numba.types.Array, numba.types.Record))


def typed_call(function: Callable[..., Any]) -> Callable[..., Any]:
    """A kernel bound to the argument types of its first call.

    Numba looks the types of all arguments up at every call from Python, which for nested parameters takes several
    times as long as the kernel itself. A component calls its kernels with the same types for ever and need not ask
    again. The types must really never change: they are not checked any more.
    """
    entry: Callable[..., Any] | None = None

    def call(*arguments: Any) -> Any:
        nonlocal entry
        if entry is not None:
            return entry(*arguments)
        result = function(*arguments)
        overloads = getattr(function, "overloads", None)  # none when compilation is switched off for debugging
        if overloads is not None:
            entry = overloads[tuple(map(numba.typeof, arguments))].entry_point
        else:
            entry = function
        return result

    return call
