# SPDX-License-Identifier: Apache-2.0
"""One number of a paper beside ours, with what ours must be."""

import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

from css_report.blocks import MISSES


class Must(NamedTuple):
    """Range that a number must lie in, ends included; None: no limit on that side."""

    low: float | None = None
    high: float | None = None

    def admits(self, value: float | None) -> bool:
        """Whether a number is in the range; one that is unknown is not."""
        if value is None or not math.isfinite(value):
            return False
        return (self.low is None or value >= self.low) and (self.high is None or value <= self.high)

    def __str__(self) -> str:
        if self.low is None:
            return f"at most {number(self.high)}"
        if self.high is None:
            return f"at least {number(self.low)}"
        return f"{number(self.low)} to {number(self.high)}"


class Row(NamedTuple):
    """One line of the table "paper / here"."""

    quantity: str
    unit: str
    paper: float | None  # None: the text gives no number
    here: float | None  # None: there is none, for instance because no case ever converged
    must: Must | None
    ok: bool  # without a `must`, whether there is a number at all
    note: str = ""  # where we differ: how much of it is due to what
    relation: str = ""  # what the paper writes before its number, such as "<", or instead of one
    variant: str = ""  # of what flew; empty: as the paper has it
    digits: int = 3  # significant ones of a number


def row(
    quantity: str, unit: str, paper: float | None, here: float | None, must: Must | None = None, **rest: Any
) -> Row:
    """A row whose `ok` follows from `here` and `must`."""
    here = None if here is None or not math.isfinite(here) else float(here)
    return Row(quantity, unit, paper, here, must, (must or Must()).admits(here), **rest)


def full_name(line: Row) -> str:
    """The quantity with its variant behind it."""
    return f"{line.quantity}, {line.variant}" if line.variant else line.quantity


def row_object(line: Row) -> dict[str, Any]:
    """A row as plain data; the variant stands behind the quantity."""
    return {
        "quantity": full_name(line),
        "unit": line.unit,
        "paper": line.paper,
        "here": line.here,
        "must": None if line.must is None else str(line.must),
        "ok": line.ok,
    }


def number(value: float | None, significant: int = 3) -> str:
    """Some significant digits, or a dash for what is unknown."""
    if value is None:
        return "-"
    last = significant - 1
    digits = last if value == 0.0 else last - math.floor(math.log10(abs(value)) + 1e-12)
    text = f"{value:.{max(digits, 0)}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def printed(line: Row) -> str:
    """What the paper says of a quantity."""
    if line.paper is None:
        return line.relation or "-"
    return f"{line.relation} {number(line.paper, line.digits)}".strip()


def table_of(rows: Sequence[Row]) -> tuple[list[str], list[list[str]]]:
    """Heading and lines of the rows; those of one quantity share a line, with two columns for each variant."""
    variants = list(dict.fromkeys(line.variant for line in rows))
    heading = ["quantity", "unit", "paper"]
    for variant in variants:
        heading += [variant or "here", "must"]
    lines = []
    for quantity, unit in dict.fromkeys((line.quantity, line.unit) for line in rows):
        same = {line.variant: line for line in rows if line.quantity == quantity}
        first = next(iter(same.values()))
        line = [quantity, unit, printed(first)]
        for variant in variants:
            line += _result(same.get(variant))
        lines.append(line)
    return heading, lines


def _result(line: Row | None) -> list[str]:
    if line is None:
        return ["", ""]
    text = number(line.here, line.digits)
    return [text if line.ok else f"{text} {MISSES}", "" if line.must is None else str(line.must)]


def notes_of(rows: Iterable[Row]) -> list[str]:
    """The notes of the rows, each once, behind the quantities that it is about."""
    by_note: dict[str, list[str]] = {}
    for line in rows:
        if line.note:
            by_note.setdefault(line.note, []).append(full_name(line))
    return [f"{'; '.join(dict.fromkeys(quantities))}: {note}" for note, quantities in by_note.items()]
