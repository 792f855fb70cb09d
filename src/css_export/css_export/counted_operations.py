# SPDX-License-Identifier: Apache-2.0
"""Operations of each step of a flight, counted: the code that `operations` bounds, with a counter in each block."""

import ctypes
import struct
from collections.abc import Iterable, Iterator

from css_export.c_main import BEGIN, STEP
from css_export.c_main import PARAMETERS as PARAMETERS_WORD
from css_export.code_numbers import literal
from css_export.code_text import Block, callee, functions_of, is_call
from css_export.flown import INPUT, OUTPUT, PARAMETERS, STATE
from css_export.layout import pack
from css_export.library import Library, state_values
from css_export.operations import OPERATIONS, Cost, cost_of
from css_export.range_arithmetic import ANY, Range
from css_export.recorded_calls import Calls
from css_export.shipped_mathematics import PREFIX
from css_export.speed import engine_of, struct_at

_COUNTS = "sunpoint.counts"


def counted(library: Library, text: str, calls: Calls) -> Iterator[Cost]:
    """Operations of each step of a flight, and calls of functions that are linked, by their names.

    Args:
        library: that is stepped.
        text: of it, optimised, in a form that this machine takes.
        calls: of the flight.
    """
    kinds, changed = with_counters(text)
    engine = engine_of(changed)
    counts = (ctypes.c_int64 * len(kinds)).from_address(engine.get_global_value_address(_COUNTS))
    step = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 4)(engine.get_function_address(f"{library.prefix}_step"))
    structs, function = library.interface.structs, library.function
    fresh = struct_at(pack(structs[STATE], state_values(function, function.sample)))
    p = struct_at(pack(structs[PARAMETERS], function.sample[function.places(PARAMETERS)[0]]))
    state, written = fresh.copy(), struct_at(bytes(structs[OUTPUT].size))
    sizes = {STEP: structs[INPUT].size, PARAMETERS_WORD: structs[PARAMETERS].size}
    stream, at = bytes(calls.stream), 0
    while at < len(stream):
        (command,) = struct.unpack_from("<Q", stream, at)
        size = sizes.get(command, 0)
        given = struct_at(stream[at + 8 : at + 8 + size])
        at += 8 + size
        if command == BEGIN:
            state = fresh.copy()
        elif command == PARAMETERS_WORD:
            p = given
        else:
            ctypes.memset(counts, 0, ctypes.sizeof(counts))
            step(*(array.ctypes.data for array in (p, state, given, written)))
            yield dict(zip(kinds, counts, strict=True))


def most_counted(library: Library, text: str, calls: Calls) -> Cost:
    """The most of each kind over the steps of a flight, as `counted` has them."""
    most: Cost = {}
    for cost in counted(library, text, calls):
        for kind, count in cost.items():
            most[kind] = max(most.get(kind, 0), count)
    return most


def with_counters(text: str) -> tuple[list[str], str]:
    """The kinds that are counted, and a module that counts them in the numbers of a global array."""
    codes = functions_of(text)
    costs: dict[int, Cost] = {}
    for code in codes.values():
        for block in () if code.name.startswith(PREFIX) else code.blocks.values():
            costs[block.at] = _own(block, codes, code.name)
    kinds = sorted({OPERATIONS, *(kind for cost in costs.values() for kind in cost)})
    changed: list[str] = []
    for at, line in enumerate(text.splitlines()):
        if at in costs:
            changed += _counting(costs[at], kinds, at)
        changed.append(line)
    zeros = f"@{_COUNTS} = global [{len(kinds)} x i64] zeroinitializer"
    return kinds, "\n".join([*changed, zeros, ""])


def _own(block: Block, codes: Iterable[str], function: str) -> Cost:
    """What a block counts, without the functions of the module that it calls."""
    total: Cost = {}
    for made in block.instructions:
        called = callee(made) if is_call(made) else None
        # of a length that stands nowhere no words are counted: less than there are, never more
        given = [literal(value) for value in called[1][2:3]] if called else []
        lengths = [Range(0, 0) if length == ANY else length for length in given]
        for kind, count in cost_of(made, codes, lengths, function).items():
            total[kind] = total.get(kind, 0) + count
    return total


def _counting(cost: Cost, kinds: list[str], at: int) -> Iterator[str]:
    for kind, count in cost.items():
        place, name = kinds.index(kind), f"%sunpoint.{at}.{kinds.index(kind)}"
        yield f"  {name}.at = getelementptr i64, ptr @{_COUNTS}, i64 {place}"
        yield f"  {name}.old = load i64, ptr {name}.at"
        yield f"  {name}.new = add i64 {name}.old, {count}"
        yield f"  store i64 {name}.new, ptr {name}.at"
