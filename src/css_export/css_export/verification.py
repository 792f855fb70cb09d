# SPDX-License-Identifier: Apache-2.0
"""An exported library beside the kernel that flew: every output and every state, bit by bit."""

import math
import struct
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

from css_export.c_main import PARAMETERS, STEP
from css_export.flown import INPUT, OUTPUT
from css_export.flown import PARAMETERS as PARAMETERS_ROLE
from css_export.layout import Scalar, Struct, leaves, other_order, struct_of
from css_export.library import Library
from css_export.programs import compiled_program, counted_run
from css_export.recorded_calls import Calls
from css_export.targets import Target


@dataclass
class Verdict:
    """How a library did.

    Attributes:
        steps: that it made.
        equal: of them, those after which outputs and state were the same bits.
        equal_outputs: those after which the outputs were.
        largest: relative difference of an output, by its name in C; those that differ alone.
    """

    steps: int
    equal: int
    equal_outputs: int
    largest: dict[str, float] = field(default_factory=dict)

    @property
    def largest_relative_difference(self) -> float:
        """Over all outputs; infinite where one is a number and the other is none."""
        return max(self.largest.values(), default=0.0)


def run_library(library: Library, target: Target, folder: Path, calls: Calls) -> tuple[bytes, int | None]:
    """What the program of a library writes for the calls of a flight, and instructions of its longest step.

    Instructions are those of the step with all that it calls; None where the emulator counts none.

    Raises:
        ToolError: it cannot be compiled or run here.
    """
    built, source = folder / target.name, folder / f"{library.prefix}_main.c"
    with tempfile.TemporaryDirectory() as aside:
        # an image that counts is none that anybody wants
        program = (Path(aside) if target.machine else built) / f"{library.prefix}_main"
        packed = built / f"lib{library.prefix}.a"
        compiled_program(target, [source], [packed], program, f"{library.prefix}_step")
        if not target.big_endian:
            return counted_run(target, program, bytes(calls.stream))
        written, instructions = counted_run(target, program, _stream_of_big_endian(library, calls))
    output = library.interface.structs[OUTPUT]
    record = struct_of("record", [("output", output), ("hash", Scalar("uint64_t", "Q", 8))])
    return other_order(record, written[: len(written) // record.size * record.size]), instructions


def _stream_of_big_endian(library: Library, calls: Calls) -> bytes:
    """The calls for a processor whose numbers begin with the most significant byte."""
    structs, stream = library.interface.structs, bytes(calls.stream)
    layouts = {STEP: structs[INPUT], PARAMETERS: structs[PARAMETERS_ROLE]}
    parts, at = [], 0
    while at < len(stream):
        (command,) = struct.unpack_from("<Q", stream, at)
        size = layouts[command].size if command in layouts else 0
        parts.append(struct.pack(">Q", command))
        if size:
            parts.append(other_order(layouts[command], stream[at + 8 : at + 8 + size]))
        at += 8 + size
    return b"".join(parts)


def judged(library: Library, calls: Calls, written: bytes, *, big_endian: bool = False) -> Verdict:
    """What was written, held against what the kernel gave.

    Args:
        library: that was run.
        calls: of the flight.
        written: as `run_library` gives it.
        big_endian: by a processor whose numbers begin with the most significant byte.
    """
    hashes = calls.hashes_of_big_endian if big_endian else calls.hashes
    size = library.interface.structs[OUTPUT].size
    record = size + 8
    steps = min(len(written) // record, calls.steps)
    verdict = Verdict(steps, 0, 0)
    for k in range(steps):
        output = written[k * record : k * record + size]
        (state,) = struct.unpack_from("<Q", written, k * record + size)
        if output == calls.outputs[k]:
            verdict.equal_outputs += 1
            verdict.equal += state == hashes[k]
        else:
            _note(verdict.largest, library.interface.structs[OUTPUT], calls.outputs[k], output)
    return verdict


def _note(largest: dict[str, float], layout: Struct, expected: bytes, given: bytes) -> None:
    for name, scalar, at in leaves(layout):
        if expected[at : at + scalar.size] == given[at : at + scalar.size]:
            continue
        (a,), (b,) = (struct.unpack_from("<" + scalar.code, data, at) for data in (expected, given))
        largest[name] = max(largest.get(name, 0.0), relative_difference(a, b))


def relative_difference(a: float, b: float) -> float:
    """|a - b| over the larger of both; infinite where only one is a number."""
    if a == b or (a != a and b != b):
        return 0.0
    scale = max(abs(a), abs(b))
    return abs(a - b) / scale if math.isfinite(scale) and a == a and b == b else math.inf
