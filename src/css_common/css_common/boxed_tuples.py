# SPDX-License-Identifier: Apache-2.0
"""How a kernel hands a NamedTuple to Python: made without running Python.

Numba makes one by calling its class, and finds the class by a function in Python. Both look for signals: a Ctrl-C that
comes there raises an exception in the middle of the machine code around a kernel, which is not made for it and goes on
with a null pointer. Here the class is a constant of the function, and the tuple is made by `tuple.__new__`, in C. A
signal then waits for the next line of Python, as anywhere else.

Numba has no option for it. What is replaced is its function for NamedTuples, once, when this module is imported; the
lock file holds the version that this was written for.
"""

from typing import Any

from numba.core import types
from numba.core.boxing import box_tuple
from numba.core.pythonapi import _boxers

_NEW_TUPLE = tuple.__new__


def _box(kind: Any, value: Any, context: Any) -> Any:
    """LLVM value of a new reference to an object of the class `kind.instance_class`."""
    constants, api = context.env_manager, context.pyapi
    new, of_class = (constants.read_const(constants.add_const(c)) for c in (_NEW_TUPLE, kind.instance_class))
    members = box_tuple(kind, value, context)
    made = api.call_function_objargs(new, (of_class, members))
    api.decref(members)
    return made


for _kind in (types.NamedTuple, types.NamedUniTuple):
    _boxers.functions[_kind] = _box
