# SPDX-License-Identifier: Apache-2.0
"""States of cases as bytes: a table of them for a compiled loop, whatever a state is made of.

Numba's own lists do the same, and take longer to compile for a new kind of state than the loop around them.
"""

from collections.abc import Callable
from typing import Any, cast

import numpy as np
from llvmlite import ir
from numba.core import errors, types
from numba.extending import intrinsic

from css_common.kernel import study_kernel

_ROW_BYTES = 8192


class StateTable:
    """The states of C cases, all of the same types.

    Attributes:
        rows: (C, bytes) uint8, for `state_of` and `keep_state`.
        like: a state, for its type.
    """

    def __init__(self, states: list[Any]) -> None:
        """Keeps states, and alive what arrays they have: a row has no more than the place of an array."""
        self._states = states
        self.like = states[0]
        self.rows = np.zeros((len(states), _ROW_BYTES), np.uint8)
        for c, state in enumerate(states):
            _keep(self.rows, c, self.like, state)


@study_kernel
def _keep(rows, c: int, like: Any, state: Any) -> None:
    keep_state(rows, c, like, state)


@intrinsic
def _state_of(typing_context, rows, c, like):
    def code(context, builder, signature, values):
        return context.unpack_value(builder, signature.return_type, _place(context, builder, signature, values))

    return like(rows, types.intp, like), code


@intrinsic
def _keep_state(typing_context, rows, c, like, state):
    if state != like:
        raise errors.TypingError(f"a state of type {like} has become {state}")

    def code(context, builder, signature, values):
        context.pack_value(builder, like, values[3], _place(context, builder, signature, values))
        return context.get_dummy_value()

    return types.void(rows, types.intp, like, state), code


state_of: Callable[[np.ndarray, int, Any], Any] = cast(Any, _state_of)
"""The state of case `c`, in a kernel: `state_of(rows, c, like)`, where `like` is a state of the same types."""

keep_state: Callable[[np.ndarray, int, Any, Any], None] = cast(Any, _keep_state)
"""Writes the state of case `c` into its row, in a kernel: `keep_state(rows, c, like, state)`."""


def _place(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    rows_type, _, like = signature.args[:3]
    kind = context.get_data_type(like)
    if context.get_abi_sizeof(kind) > _ROW_BYTES:
        raise errors.LoweringError(f"a state of type {like} has more than {_ROW_BYTES} bytes")
    rows = context.make_array(rows_type)(context, builder, values[0])
    at = builder.mul(values[1], ir.Constant(values[1].type, _ROW_BYTES))
    return builder.bitcast(builder.gep(rows.data, [at]), kind.as_pointer())
