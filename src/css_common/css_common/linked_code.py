# SPDX-License-Identifier: Apache-2.0
"""Code that numba only links into other code: neither optimised by itself nor made machine code.

Numba takes every function that it compiles through all of LLVM, also one that is only ever called from another: the
caller links it, optimises the whole again and makes machine code of that. Of what kernels call the first round is
thrown away, and it takes a quarter of the time of a first start. `only_linked` leaves it out; what is linked in the end
is optimised as before, and gives the same bits.

Numba has no option for it. What is replaced here is the last step of its code library, and what asks a library for
machine code afterwards; the lock file holds the version that this was written for.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from numba.core.codegen import JITCodeLibrary, JITCPUCodegen
from numba.core.environment import lookup_environment

_ENVIRONMENT = "_ZN08NumbaEnv"  # how names of the places begin where machine code finds its environment


class _Depth:
    """How many compilations of code that is only linked are under way; numba compiles under one lock."""

    now = 0


@contextmanager
def only_linked() -> Iterator[None]:
    """What numba compiles, or loads from its cache, meanwhile is called from other compiled code alone."""
    _Depth.now += 1
    try:
        yield
    finally:
        _Depth.now -= 1


class _Library(JITCodeLibrary):
    """Numba's library of compiled functions, whose last steps are left out of what is only linked."""

    _is_only_linked = False

    def _optimize_final_module(self) -> None:
        if not _Depth.now:
            super()._optimize_final_module()
            return
        # the passes that numba puts first: they inline, so that less is linked
        passes, builder = self._codegen._module_pass_manager(
            loop_vectorize=False, slp_vectorize=False, opt=self._codegen._opt_level, cost="cheap"
        )
        passes.run(self._final_module, builder)

    def _finalize_final_module(self) -> None:
        if not _Depth.now:
            super()._finalize_final_module()
            for variable in self._final_module.global_variables:
                environment = lookup_environment(variable.name) if variable.name.startswith(_ENVIRONMENT) else None
                if environment is not None:
                    _set_environment_if_there(self._codegen, variable.name, environment)
            return
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._is_only_linked = self._finalized = True

    def serialize_using_object_code(self) -> Any:
        """What the cache holds: without machine code where there is none."""
        return self.serialize_using_bitcode() if self._is_only_linked else super().serialize_using_object_code()


_set_environment = JITCPUCodegen.set_env


def _set_environment_if_there(self: Any, name: str, environment: Any) -> None:
    """Tells machine code its environment; code that is only linked has its place in that of its callers."""
    if self._engine.get_global_value_address(name):
        _set_environment(self, name, environment)


JITCPUCodegen._library_class = _Library
JITCPUCodegen.set_env = _set_environment_if_there  # type: ignore[method-assign]  # as the module says
