# SPDX-License-Identifier: Apache-2.0
"""Exports, compares where that is asked for, and prints the table of it."""

import argparse
import json
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console

from css_analysis.readable_table import ReadableTable
from css_common.mission import Mission, load_mission, mission_from_text
from css_export.build_files import write_build_files
from css_export.errors import ExportError, ToolError
from css_export.flown import flying_functions, functions_of, left_out
from css_export.glue import write_glue
from css_export.library import Library, MachineCode, made_library, write_library
from css_export.mathematics import differing_functions
from css_export.programs import can_link, shared_library, why_not
from css_export.recorded_calls import Calls, listen
from css_export.targets import HOST, Target, target_of
from css_export.verification import Verdict, judged, run_library
from css_recording.bag_reader import BagReader

# what differs between flights of one mission
_OF_THE_FLIGHT = {"mission.case", "mission.duration", "mission.seed"}

# relative difference of outputs over a flight below which the last bits of mathematics are taken for its reason
_LAST_BITS = 1e-12


@dataclass
class Row:
    """A library for a target, and how it did."""

    library: Library
    code: MachineCode
    verdict: Verdict | None = None
    why_not: str | None = None
    differing: dict[str, float] | None = None  # functions of the C library, by the share of arguments

    @property
    def is_right(self) -> bool:
        """Every step is equal but for the last bits of named functions, or cannot be compared on any machine."""
        if self.verdict is None:
            return self.why_not is None or not self.code.target.runs
        traced = bool(self.differing) and self.verdict.largest_relative_difference < _LAST_BITS
        return self.verdict.equal == self.verdict.steps or traced


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
        library = made_library(mission, function)
        codes = []
        for target in targets:
            _tell(f"{function.name}: machine code for {target.name}")
            codes.append(library.for_target(target))
        place = folder / function.name
        write_library(library, codes, place)
        write_build_files(library, codes, place)
        write_glue(library, place)
        lines += _link_shared(library, codes, place)
        of_library = [Row(library, code) for code in codes]
        rows += of_library
        if options.verify is not None:
            lines += _verify(of_library, options, mission, place)
    missing = [] if options.components else left_out(mission)
    _print(rows, options.verify is not None, folder, lines, missing)
    if options.json:
        print(json.dumps({"mission": mission.name, "results": [_result(row) for row in rows], "left_out": missing}))
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
    with BagReader(options.verify) as reader:
        calls = listen(reader, mission, library, options.steps)
    lines = _shortcomings(library, calls, options)
    for row in rows:
        row.why_not = why_not(row.code.target)
        if row.why_not is None:
            _tell(f"{library.function.name}: {calls.steps} steps on {row.code.target.name}")
            try:
                row.verdict = judged(library, calls, run_library(library, row.code.target, place, calls))
                if row.verdict.equal != row.verdict.steps:
                    row.differing = differing_functions(row.code.contents.missing, row.code.target, place)
            except ToolError as error:
                row.why_not = str(error)
    return lines


def _shortcomings(library: Library, calls: Calls, options: argparse.Namespace) -> list[str]:
    name = library.function.name
    lines = []
    if calls.steps == 0:
        lines.append(f"{name}: the recording has no step of it")
    if calls.as_recorded != calls.messages:
        lines.append(
            f"{name}: {calls.messages - calls.as_recorded} of {calls.messages} messages of the kernel here are not the "
            "bytes that were recorded: other software, or parameters that were set in flight"
        )
    if options.steps is not None and calls.steps < options.steps:
        lines.append(f"{name}: {options.steps} steps asked for, the recording has {calls.steps}")
    return lines


def _tell(text: str) -> None:
    print(f"export: {text} ...", file=sys.stderr, flush=True)


def _print(rows: list[Row], verified: bool, folder: Path, lines: list[str], missing: list[str]) -> None:
    console = Console(highlight=False)
    table = ReadableTable("C libraries, sizes in bytes")
    table.add_name("library")
    table.add_name("target")
    for heading in ("code", "read-only\ndata", "state", "stack"):
        table.add_number(heading)
    if verified:
        for heading in ("steps", "equal", "largest\ndifference"):
            table.add_number(heading)
    for row in rows:
        table.add_texts(_texts(row, verified))
    console.print(table)
    for row in rows:
        if row.why_not is not None:
            console.print(
                f"{row.library.function.name} on {row.code.target.name}: not run: {row.why_not}", soft_wrap=True
            )
        if row.differing is not None:
            told = ", ".join(f"{name} ({100.0 * share:.2f} %)" for name, share in row.differing.items())
            why = f"its C library gives other bits than that of this machine: {told}" if told else "no function of the "
            why += "" if told else "C library that it links gives other bits; the reason lies in the code"
            console.print(f"{row.library.function.name} on {row.code.target.name}: {why}", soft_wrap=True)
    for line in lines:
        console.print(line, soft_wrap=True)
    for library in {row.library.prefix: row.library for row in rows}.values():
        for row in rows:
            if row.library is library:
                linked = ", ".join(row.code.contents.missing) or "nothing"
                console.print(f"{library.function.name} on {row.code.target.name} links {linked}", soft_wrap=True)
    for name in missing:
        console.print(f"{name}: left out, it has no compiled function that flies", soft_wrap=True)
    console.print(f"written: {folder}", soft_wrap=True)


def _texts(row: Row, verified: bool) -> list[str]:
    code = row.code
    texts = [row.library.function.name, code.target.name, f"{code.contents.code}", f"{code.contents.constants}"]
    texts += [f"{row.library.interface.structs['state'].size}", f"{code.stack}"]
    if verified:
        v = row.verdict
        texts += ["-", "-", "-"] if v is None else [f"{v.steps}", f"{v.equal}", f"{v.largest_relative_difference:.1e}"]
    return texts


def _result(row: Row) -> dict[str, Any]:
    contents, verdict = row.code.contents, row.verdict
    compared: dict[str, Any] = {"steps": None, "equal_steps": None, "largest_relative_difference": None}
    if verdict is not None:
        largest = verdict.largest_relative_difference
        compared = {
            "steps": verdict.steps,
            "equal_steps": verdict.equal,
            "largest_relative_difference": largest if largest != float("inf") else "infinite",
        }
    return {
        "component": row.library.function.name,
        "target": row.code.target.name,
        **compared,
        "code_bytes": contents.code,
        "rodata_bytes": contents.constants,
        "data_bytes": contents.variables,
        "state_bytes": row.library.interface.structs["state"].size,
        "stack_bytes": row.code.stack,
        "linked": contents.missing,
        "not_run": row.why_not,
        "differing_functions": row.differing,
    }
