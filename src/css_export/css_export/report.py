# SPDX-License-Identifier: Apache-2.0
"""What came of an export: a row for each library and target, as a table and as JSON."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console

from css_analysis.readable_table import ReadableTable
from css_export.library import MUSL, Library, MachineCode
from css_export.operations import OPERATIONS, Cost, at_most
from css_export.verification import Verdict

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
    instructions: int | None = None  # of the longest step, with those of all that it calls
    time_ratio: float | None = None  # of a step here, over that of the kernel that the nodes call
    messages: int | None = None  # of the component over the recording, as made anew
    as_recorded: int | None = None  # of them, those that are the bytes in the recording
    counted: Cost | None = None  # the most operations and calls over the steps, where this machine takes the code

    @property
    def is_within_bound(self) -> bool:
        """No step has made more operations, or calls, than it can at most."""
        bound, counted = self.code.bound, self.counted
        if bound.operations is None or counted is None:
            return True
        most = {OPERATIONS: bound.operations, **bound.calls}
        return all(count <= most.get(kind, 0) for kind, count in counted.items())

    @property
    def is_right(self) -> bool:
        """Every step is equal but for the last bits of named functions, or cannot be compared on any machine."""
        if not self.is_within_bound:
            return False
        if self.verdict is None:
            return self.why_not is None or not self.code.target.runs
        traced = bool(self.differing) and self.verdict.largest_relative_difference < _LAST_BITS
        return self.verdict.equal == self.verdict.steps or traced


def print_report(
    rows: list[Row], verified: bool, folder: Path, lines: Sequence[str], missing: Mapping[str, str]
) -> None:
    """Prints the table, what was not run, and what remains to be linked."""
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
        if row.verdict is not None and row.verdict.equal != row.verdict.steps:
            console.print(_where(row, row.verdict), soft_wrap=True)
        if row.differing is not None:
            told = ", ".join(f"{name} ({100.0 * share:.2f} %)" for name, share in row.differing.items())
            why = f"its C library gives other bits than that of this machine: {told}" if told else "no function of the "
            why += "" if told else "C library that it links gives other bits; the reason lies in the code"
            console.print(f"{row.library.function.name} on {row.code.target.name}: {why}", soft_wrap=True)
        if row.instructions is not None or row.time_ratio is not None:
            console.print(_effort(row), soft_wrap=True)
    for line in lines:
        console.print(line, soft_wrap=True)
    for library in {row.library.prefix: row.library for row in rows}.values():
        _print_flight(console, next(row for row in rows if row.library is library))
        for row in rows:
            if row.library is library:
                console.print(_bounded(row), soft_wrap=True)
                linked = ", ".join(row.code.contents.missing) or "nothing"
                console.print(f"{library.function.name} on {row.code.target.name} links {linked}", soft_wrap=True)
    for name, reason in missing.items():
        console.print(f"{name}: left out: {reason}", soft_wrap=True)
    console.print(f"written: {folder}", soft_wrap=True)


def _where(row: Row, verdict: Verdict) -> str:
    """Which output differs most, and in how many steps it is the state alone."""
    told = f"{row.library.function.name} on {row.code.target.name}: "
    if verdict.largest:
        told += f"{max(verdict.largest, key=verdict.largest.__getitem__)} differs most; "
    told += f"outputs are equal after {verdict.equal_outputs} of {verdict.steps} steps"
    return f"{told}, outputs and state after {verdict.equal}"


def _effort(row: Row) -> str:
    """What the longest of the steps took on an emulated machine, or all of them on this one."""
    where = f"{row.library.function.name} on {row.code.target.name}"
    if row.instructions is not None:
        counted = "with those of what is linked, counted in forties"
        return f"{where}: {row.instructions} instructions in the longest of these steps, {counted}"
    return f"{where}: a step takes {row.time_ratio:.2f} of the time of the kernel that the node calls"


def _bounded(row: Row) -> str:
    """How many operations a step makes at most, and how many those of the flight made."""
    told = f"{row.library.function.name} on {row.code.target.name}: {at_most(row.code.bound)}"
    if row.counted is None:
        return told
    told += f"; the longest of these steps made {row.counted[OPERATIONS]}"
    return told if row.is_within_bound else f"{told}, or more calls of a function: the bound is wrong"


def _print_flight(console: Console, row: Row) -> None:
    if row.messages is None or row.library.mathematics != MUSL:
        return
    name = row.library.function.name
    told = f"{name}: compared with its own library on this machine, which gave {row.as_recorded} of {row.messages} "
    told += "messages as the recording has them"
    if row.as_recorded != row.messages:
        told += f"; `fly --component {name}=LIBRARY` records a flight of it"
    console.print(told, soft_wrap=True)


def _texts(row: Row, verified: bool) -> list[str]:
    code = row.code
    texts = [row.library.function.name, code.target.name, f"{code.contents.code}", f"{code.contents.constants}"]
    texts += [f"{row.library.interface.structs['state'].size}", f"{code.stack}"]
    if verified:
        v = row.verdict
        texts += ["-", "-", "-"] if v is None else [f"{v.steps}", f"{v.equal}", f"{v.largest_relative_difference:.1e}"]
    return texts


def result(row: Row) -> dict[str, Any]:
    """A row as JSON has it."""
    contents, verdict = row.code.contents, row.verdict
    compared: dict[str, Any] = dict.fromkeys(
        ("steps", "equal_steps", "steps_of_equal_outputs", "largest_relative_difference", "largest_difference_of")
    )
    if verdict is not None:
        largest = verdict.largest_relative_difference
        compared = {
            "steps": verdict.steps,
            "equal_steps": verdict.equal,
            "steps_of_equal_outputs": verdict.equal_outputs,
            "largest_relative_difference": largest if largest != float("inf") else "infinite",
            "largest_difference_of": max(verdict.largest, key=verdict.largest.__getitem__, default=None),
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
        "most_instructions": row.instructions,
        "operations_at_most": row.code.bound.operations,
        "calls_at_most": row.code.bound.calls,
        "not_bounded": row.code.bound.reason or None,
        "operations_counted": None if row.counted is None else row.counted[OPERATIONS],
        "time_to_kernel": row.time_ratio,
        "mathematics": row.library.mathematics,
        "messages": row.messages,
        "messages_as_recorded": row.as_recorded,
    }
