# SPDX-License-Identifier: Apache-2.0
"""How long a step of a library takes on this machine, held against the kernel that the nodes call.

Both are called in a loop of machine code with the inputs of the flight, from the same state on, by turns; of several
runs the shortest counts, in processor time: the machine may have other work.
"""

import ctypes
from pathlib import Path
from time import thread_time

import llvmlite.binding as llvm
import numpy as np

from css_export.flown import INPUT, OUTPUT, PARAMETERS, STATE
from css_export.layout import pack
from css_export.library import Library, state_values
from css_export.recorded_calls import Calls

_RUNS, _MOST_STEPS = 7, 1000
_LOOP = """
define void @{name}(ptr %f, ptr %p, ptr %s, ptr %i, ptr %o, i64 %size, i64 %count) {{
entry:
  %result = alloca ptr
  %exception = alloca ptr
  br label %body
body:
  %k = phi i64 [ 0, %entry ], [ %next, %body ]
  %at = mul i64 %k, %size
  %in = getelementptr i8, ptr %i, i64 %at
  {call}
  %next = add i64 %k, 1
  %more = icmp slt i64 %next, %count
  br i1 %more, label %body, label %over
over:
  ret void
}}
"""
_CALLS = {
    "library": "call void %f(ptr %p, ptr %s, ptr %in, ptr %o)",
    "kernel": "%status = call i32 %f(ptr %result, ptr %exception, ptr %p, ptr %s, ptr %in, ptr %o)",
}


def time_ratio(library: Library, file: Path, calls: Calls) -> float | None:
    """Time of a step of a library over that of the kernel; None where the recording has no step.

    Args:
        library: as exported, its kernel compiled for this machine.
        file: the shared library for this machine.
        calls: of the flight.
    """
    structs = library.interface.structs
    inputs = b"".join(calls.inputs[:_MOST_STEPS])
    if not inputs:
        return None
    function = library.function
    fresh = struct_at(pack(structs[STATE], state_values(function, function.sample)))
    p = struct_at(pack(structs[PARAMETERS], function.sample[function.places(PARAMETERS)[0]]))
    given, written = struct_at(inputs), struct_at(bytes(structs[OUTPUT].size))
    step = getattr(ctypes.CDLL(str(file.absolute())), f"{library.prefix}_step")
    addresses = {"library": ctypes.cast(step, ctypes.c_void_p).value, "kernel": library.native.address}
    engine = engine_of("".join(_LOOP.format(name=name, call=call) for name, call in _CALLS.items()))
    loop = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 5, *[ctypes.c_int64] * 2)
    loops = {name: loop(engine.get_function_address(name)) for name in _CALLS}
    shortest = dict.fromkeys(_CALLS, float("inf"))
    size = structs[INPUT].size
    for _ in range(_RUNS):
        for name, run in loops.items():
            state = fresh.copy()
            pointers = (addresses[name], *(array.ctypes.data for array in (p, state, given, written)))
            begun = thread_time()
            run(*pointers, size, len(inputs) // size)
            shortest[name] = min(shortest[name], thread_time() - begun)
    return shortest["library"] / shortest["kernel"]


def struct_at(data: bytes | bytearray) -> np.ndarray:
    """A copy that begins where any struct may."""
    return np.frombuffer(bytes(data) + bytes(-len(data) % 8 + 8), np.uint64).copy()


def engine_of(text: str) -> llvm.ExecutionEngine:
    """Machine code of a module of intermediate code, in this process."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    machine = llvm.Target.from_default_triple().create_target_machine()
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(text), machine)
    engine.finalize_object()
    return engine
