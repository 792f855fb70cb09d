# SPDX-License-Identifier: Apache-2.0
"""A shared library behind pipes, in a process of its own, which it may end without ending the flight's.

Speaks as `sunpoint_NAME_main` does. Run by `stand_in`; loads little, for it starts with each flight.
"""

import ctypes
import os
import sys
from typing import BinaryIO

STEP, BEGIN, PARAMETERS, STATE, LAYOUT = 1, 2, 3, 4, 5


def serve(library: ctypes.CDLL, prefix: str, sizes: list[int], given: BinaryIO, answers: BinaryIO) -> None:
    """Answers records until there are no more.

    Args:
        library: with the step.
        prefix: of its symbols.
        sizes: [bytes] of parameters, state, inputs and outputs.
        given, answers: the pipes.
    """
    step = getattr(library, f"{prefix}_step")
    step.restype = None
    # whole words, so that each begins where any struct may
    params, state, inputs, outputs = ((ctypes.c_uint64 * (size // 8 + 1))() for size in sizes)
    while head := given.read(8):
        command = int.from_bytes(head, sys.byteorder)
        if command == LAYOUT:
            answers.write(_layout(library, prefix).to_bytes(8, sys.byteorder))
        elif command == PARAMETERS:
            _read(given, params, sizes[0])
        elif command == STATE:
            _read(given, state, sizes[1])
        else:
            _read(given, inputs, sizes[2])
            ctypes.memset(outputs, 0, sizes[3])
            step(*(ctypes.byref(struct) for struct in (params, state, inputs, outputs)))
            answers.write(ctypes.string_at(outputs, sizes[3]) + bytes(8) + ctypes.string_at(state, sizes[1]))
        answers.flush()


def _layout(library: ctypes.CDLL, prefix: str) -> int:
    """For which structs the library was made, as its header numbers them; 0: it does not say."""
    try:
        return ctypes.c_uint64.in_dll(library, f"{prefix}_layout").value
    except ValueError:
        return 0


def _read(given: BinaryIO, into: ctypes.Array[ctypes.c_uint64], size: int) -> None:
    data = given.read(size)
    ctypes.memmove(into, data, len(data))


def _main() -> None:
    file, prefix, *sizes = sys.argv[1:]
    # what the library prints goes to standard error: its answers are alone in the pipe
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    serve(ctypes.CDLL(file), prefix, [int(size) for size in sizes], sys.stdin.buffer, answers)


if __name__ == "__main__":
    _main()
