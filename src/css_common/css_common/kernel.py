# SPDX-License-Identifier: Apache-2.0
"""The decorators that compile Sunpoint's algorithms, and the place of the compile cache.

Most of the time that a first start takes is spent on what stands around the arithmetic of a kernel: a function that
takes apart Python's objects, of which a loop of a study has hundreds, and as many copies as there are constants in
calls. A kernel is therefore compiled once for calls from Python and once for calls from kernels, each when the first
one comes, and constants count by their type.

Numba checks only the file of the function it loads from its cache: a cached caller keeps an old copy of a
function that lives in another file. The cache folder of a kernel is therefore named by a hash of every source file
that it can be made from, and of the versions that compile it: edit one, and what is made from it is compiled anew.
"""

import os
import shutil
import sys
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import Any, ParamSpec, Protocol, TypeVar, cast

import llvmlite
import numba
from numba.core.types import unliteral

from css_common import boxed_tuples as boxed_tuples  # kernels hand over tuples as it says
from css_common import places
from css_common.kernel_sources import hash_of, kernel_modules, sources_of
from css_common.linked_code import only_linked

P = ParamSpec("P")
R = TypeVar("R", covariant=True)

_COMPILER = f"{sys.version_info[:2]} {numba.__version__} {llvmlite.__version__}"
_OPTIONS: dict[str, Any] = {"cache": True, "error_model": "numpy", "fastmath": False, "no_cfunc_wrapper": True}
_UNCOUNTED: dict[str, Any] = _OPTIONS | {"_nrt": False}
_ONLY_FROM_KERNELS = {"no_cpython_wrapper": True}


def _say_what_is_compiled() -> None:
    # not at the beginning of a line, where it would count among what kernels are made from
    from css_common.compile_news import follow_compiler

    follow_compiler()


def _say_not_kept(folder: str, error: OSError) -> None:
    from css_common.compile_news import not_kept  # as above

    not_kept(folder, error)


_say_what_is_compiled()


def _folder(of_sources: str) -> Path:
    # a user who names a folder has one for all sources, as numba has it
    return Path(os.environ.get("NUMBA_CACHE_DIR") or _kernels() / of_sources)


@cache
def study_hash(module: str) -> str:
    """Hash of all that a module of studies compiles: what it imports, all kernels below it, and the compiler."""
    return hash_of(kernel_modules() | sources_of(module), _COMPILER)


@cache
def cache_folder(module: str) -> Path:
    """Folder of a module's compiled kernels: inside the project when started by `./sunpoint`, else the user's cache."""
    return _folder(hash_of(sources_of(module), _COMPILER))


@cache
def _kernels() -> Path:
    return places.scratch("kernels")


def _compiled(function: Callable[..., Any], folder: Path, options: dict[str, Any]) -> Any:
    # Numba takes the folder that its configuration names while it makes the dispatcher, and reads the configuration
    # anew from its environment whenever a variable of it has changed.
    numba.config.CACHE_DIR = str(folder)  # type: ignore[attr-defined]  # made at run time
    dispatcher: Any = numba.njit(**options)(function)
    if not numba.config.DISABLE_JIT:  # type: ignore[attr-defined]  # made at run time
        _forgive(dispatcher)
    return dispatcher


def _forgive(dispatcher: Any) -> None:
    """Lets the cache be made anew that names a type which cannot be imported here, and kernels run that it cannot hold.

    Who calls a kernel with a type of its own, as tests do, leaves its name among what is cached of that kernel; numba
    reads the names of all types whichever is asked for.
    """
    compile_types = dispatcher.compile

    def compile_anew(signature: Any) -> Any:
        try:
            return compile_types(signature)
        except (ImportError, AttributeError):
            shutil.rmtree(dispatcher.stats.cache_path, ignore_errors=True)
            return compile_types(signature)
        except OSError as error:  # it is compiled, and a full disk has no room for it
            _say_not_kept(dispatcher.stats.cache_path, error)
            return compile_types(signature)

    dispatcher.compile = compile_anew


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
    return _uncounted(function, cache_folder(function.__module__), _UNCOUNTED)


def study_kernel(function: Callable[P, R]) -> "Kernel[P, R]":
    """Compiles the loop of a study: as `kernel` does, and other threads go on meanwhile.

    Which kernels it calls may follow from the types of its arguments: it is compiled anew with any of them.
    """
    return _uncounted(function, _folder(study_hash(function.__module__)), _UNCOUNTED | {"nogil": True})


def kernel_of(function: Callable[P, R], *modules: str) -> "Kernel[P, R]":
    """Compiles a loop around kernels of other modules, which it finds by the types of its arguments.

    Unlike that of a study, which may call any kernel there is, it has a folder for each set of such modules.
    """
    sources = sources_of(function.__module__).union(*(sources_of(module) for module in modules))
    return _uncounted(function, _folder(hash_of(sources, _COMPILER)), _UNCOUNTED)


def outer_kernel(function: Callable[P, R]) -> "Kernel[P, R]":
    """Compiles an outermost loop: it may make and return arrays, and other threads go on meanwhile."""
    return _compiled(function, cache_folder(function.__module__), _OPTIONS | {"nogil": True})


def _uncounted(function: Callable[P, R], folder: Path, options: dict[str, Any]) -> "Kernel[P, R]":
    dispatcher: Any = _compiled(function, folder, options)
    if numba.config.DISABLE_JIT:  # type: ignore[attr-defined]  # made at run time
        return dispatcher

    @cache
    def called() -> Any:
        return _without_arrays(_linked(_compiled(function, folder / "called", options | _ONLY_FROM_KERNELS)))

    def call_template(args: Iterable[Any], kws: Mapping[str, Any]) -> Any:
        types = tuple(map(unliteral, args))
        return called().get_call_template(types, {name: unliteral(kws[name]) for name in kws})

    # numba asks these two of a dispatcher when it compiles a call of it
    dispatcher.get_call_template = call_template
    dispatcher.get_overload = lambda types: called().get_overload(types)
    return _without_arrays(dispatcher)


def _linked(dispatcher: Any) -> Any:
    """The dispatcher, whose code is linked into that of others and never called from Python."""
    compile_types = dispatcher.compile

    def compile_to_link(signature: Any) -> Any:
        with only_linked():
            return compile_types(signature)

    dispatcher.compile = compile_to_link
    return dispatcher


def _without_arrays(dispatcher: Any) -> Any:
    """The dispatcher, which from now on refuses to compile what returns an array."""
    compile_types = dispatcher.compile

    def compile_checked(signature: Any) -> Any:
        entry = compile_types(signature)
        for compiled in dispatcher.overloads.values():
            if _holds_array(compiled.signature.return_type):
                name = dispatcher.py_func.__qualname__
                raise TypeError(f"{name}: a kernel must not return an array; let it write into one")
        return entry

    dispatcher.compile = compile_checked
    return dispatcher


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
