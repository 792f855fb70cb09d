# SPDX-License-Identifier: Apache-2.0
"""Exports, compares where that is asked for, and prints the table of it."""

import argparse
import json
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

from css_common.mission import Mission, load_mission, mission_from_text
from css_export.build_files import write_build_files
from css_export.counted_operations import most_counted
from css_export.errors import ExportError, ToolError
from css_export.flown import flying_functions, functions_of, left_out
from css_export.glue import write_glue
from css_export.library import MUSL, Library, MachineCode, made_library, write_library
from css_export.mathematics import differing_functions
from css_export.programs import can_link, shared_library, why_not
from css_export.recorded_calls import Calls, listen
from css_export.report import Row, print_report, result
from css_export.speed import time_ratio
from css_export.stand_in import library_step
from css_export.targets import HOST, TARGETS, Target, target_of
from css_export.verification import judged, run_library
from css_recording.bag_reader import BagReader

# what differs between flights of one mission
_OF_THE_FLIGHT = {"mission.case", "mission.duration", "mission.seed"}


def run(options: argparse.Namespace) -> int:
    """Exports as the options say; the exit code."""
    targets = _targets(options.targets)
    mission = load_mission(options.mission, options.overrides)
    if options.verify is not None:
        _refuse_other(options.verify, mission)
    functions = flying_functions(mission, options.components)
    folder = options.out or Path("export") / mission.name
    rows: list[Row] = []
    lines: list[str] = []
    for function in functions:
        _tell(f"{function.name}: compiling")
        library = made_library(mission, function, options.mathematics)
        codes = []
        for target in targets:
            _tell(f"{function.name}: machine code for {target.name}")
            codes.append(library.for_target(target))
        place = folder / function.name
        write_library(library, codes, place)
        write_build_files(library, codes, place)
        write_glue(library, place)
        lines += _link_shared(library, codes, place)
        lines += _of_another_export(library, codes, place)
        of_library = [Row(library, code) for code in codes]
        rows += of_library
        if options.verify is not None:
            lines += _verify(of_library, options, mission, place)
    missing = {} if options.components else left_out(mission)
    print_report(rows, options.verify is not None, folder, lines, missing)
    if options.json:
        print(json.dumps({"mission": mission.name, "results": [result(row) for row in rows], "left_out": missing}))
    return 0 if all(row.is_right for row in rows) and not lines else 1


def _link_shared(library: Library, codes: list[MachineCode], place: Path) -> list[str]:
    """Makes the shared library for this machine, of what was made for it; why not."""
    for code in codes:
        if code.target.name != HOST:
            continue
        if not can_link(code.target):
            return [f"{library.function.name}: no shared library for `fly --component`: {why_not(code.target)}"]
        packed = place / HOST / f"lib{library.prefix}.a"
        shared_library(code.target, packed, packed.with_suffix(".so"))
    return []


def _of_another_export(library: Library, codes: list[MachineCode], place: Path) -> Iterator[str]:
    """What lies in the folder for other targets and is not of this header: of another mission, or older software."""
    made = {code.target.name for code in codes}
    for packed in sorted(place.glob(f"*/lib{library.prefix}.a")):
        if packed.parent.name not in made and library.version.encode("ascii", "replace") not in packed.read_bytes():
            yield (
                f"{packed}: of another export, of which {library.prefix}.h no longer is: make it anew with --target "
                f"{packed.parent.name}, or remove it"
            )


def _targets(names: Iterable[str]) -> list[Target]:
    return list({target.name: target for target in map(target_of, names)}.values())


def _refuse_other(bag: Path, mission: Mission) -> None:
    """Refuses a recording of a flight with other values: its outputs are no measure."""
    with BagReader(bag) as reader:
        text = reader.mission_text
    if text is None:
        raise ExportError(f"{bag}: holds no mission, so that nobody knows with which values its components flew")
    flown = mission_from_text(text, f"{bag}: embedded mission")
    for node in mission.nodes:
        other = next((n for n in flown.nodes if n.name == node.name), None)
        if other is None:
            raise ExportError(f"{bag}: {node.name} did not fly; expected a recording of mission {mission.name}")
        if not any(True for _ in functions_of(node)):
            continue
        for key, value in node.canonical.items():
            # as texts, for a value that is not a number is like no other
            if key not in _OF_THE_FLIGHT and repr(other.canonical.get(key)) != repr(value):
                raise ExportError(
                    f"{bag}: {node.name}.{key} was {other.canonical.get(key)!r} in flight, the mission has {value!r}; "
                    "expected a recording of this mission (--set gives it the values of the flight)"
                )


def _verify(rows: list[Row], options: argparse.Namespace, mission: Mission, place: Path) -> list[str]:
    library = rows[0].library
    _tell(f"{library.function.name}: the calls of the flight")
    with tempfile.TemporaryDirectory() as folder, BagReader(options.verify) as reader:
        through = reference_of(library, Path(folder)) if library.mathematics == MUSL else None
        big = any(row.code.target.big_endian for row in rows)
        calls = listen(reader, mission, library, options.steps, through, big_endian=big)
    lines = _shortcomings(library, calls, options)
    for row in rows:
        row.messages, row.as_recorded = calls.messages, calls.as_recorded
        row.why_not = why_not(row.code.target)
        if row.why_not is None:
            _tell(f"{library.function.name}: {calls.steps} steps on {row.code.target.name}")
            try:
                written, row.instructions = run_library(library, row.code.target, place, calls)
                row.verdict = judged(library, calls, written, big_endian=row.code.target.big_endian)
                shared = place / HOST / f"lib{library.prefix}.so"
                if row.code.target.name == HOST and shared.is_file():
                    row.time_ratio = time_ratio(library, shared, calls)
                if row.code.target.name == HOST and calls.steps and row.code.bound.operations is not None:
                    row.counted = most_counted(library, row.code.text, calls)
                if row.verdict.equal != row.verdict.steps:
                    with tempfile.TemporaryDirectory() as folder:
                        linked = row.code.contents.missing
                        row.differing = differing_functions(linked, row.code.target, Path(folder))
            except ToolError as error:
                row.why_not = str(error)
    return lines


def reference_of(library: Library, folder: Path) -> Callable[[Any], Any]:
    """What puts the library itself, on this machine, in the place of the kernel: that has another mathematics.

    Raises:
        ToolError: no compiler links it.
    """
    host = TARGETS[HOST]
    if not can_link(host):
        raise ToolError(f"{library.function.name}: nothing to compare with: {why_not(host)}")
    write_library(library, [library.for_target(host)], folder)
    packed = folder / HOST / f"lib{library.prefix}.a"
    file = shared_library(host, packed, packed.with_suffix(".so"))
    return lambda kernel: library_step(library.function, kernel, file)


def _shortcomings(library: Library, calls: Calls, options: argparse.Namespace) -> list[str]:
    name = library.function.name
    lines = []
    if calls.steps == 0:
        lines.append(f"{name}: the recording has no step of it")
    if calls.as_recorded != calls.messages and library.mathematics != MUSL:
        lines.append(
            f"{name}: {calls.messages - calls.as_recorded} of {calls.messages} messages of the kernel here are not the "
            "bytes that were recorded: other software, or parameters that were set in flight"
        )
    if options.steps is not None and calls.steps < options.steps:
        lines.append(f"{name}: {options.steps} steps asked for, the recording has {calls.steps}")
    return lines


def _tell(text: str) -> None:
    print(f"export: {text} ...", file=sys.stderr, flush=True)
