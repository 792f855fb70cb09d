# SPDX-License-Identifier: Apache-2.0
"""A line of text that holds the outputs of cells, as a microcontroller prints them, in a format that is described.

    $CSS,1042,0.131,0.847,1.902,0.020*5C

Prefix, fields between separators, and a checksum as in NMEA 0183: two hexadecimal digits of the exclusive or of
all bytes between `$` and `*`. What the fields are is listed: `sequence`, `cell.K`, or `-` for what is left alone.
"""

import math
import re
from collections.abc import Iterable, Sequence
from functools import reduce
from operator import xor
from typing import NamedTuple

SEQUENCE, IGNORED = "sequence", "-"
_CELL = re.compile(r"cell\.(\d{1,2})", re.ASCII)
_WHOLE = re.compile(r"\d{1,19}", re.ASCII)
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
MISSING = frozenset(("", "nan", "-nan", "n/a", "inf", "-inf"))
"""Words, in lower case, of a cell that has no output: the others of the line count."""
LONGEST = 1024
"""Bytes of a line; more without an end is no line."""


class LineError(ValueError):
    """A line that is none, with a word for the kind of trouble."""

    def __init__(self, kind: str, text: str) -> None:
        super().__init__(text)
        self.kind = kind


class LineFormat(NamedTuple):
    """How a line is written."""

    prefix: str
    separator: str
    checksum: str  # "xor" or "none"
    fields: tuple[str, ...]  # SEQUENCE, IGNORED or cell.K each
    cells: int

    def wrong(self) -> Iterable[str]:
        """What is wrong with the description, one message each."""
        numbers = [int(found[1]) for name in self.fields if (found := _CELL.fullmatch(name))]
        for name in self.fields:
            if name not in (SEQUENCE, IGNORED) and not _CELL.fullmatch(name):
                yield f"line.fields: {name!r} given, expected {SEQUENCE}, cell.0 to cell.{self.cells - 1} or {IGNORED}"
        if sorted(numbers) != list(range(self.cells)):
            yield f"line.fields: cells {sorted(numbers)} given, expected each of the {self.cells} cells once"
        if self.fields.count(SEQUENCE) > 1:
            yield f"line.fields: {SEQUENCE} given twice, expected once"
        if len(self.separator) != 1 or self.separator in "+-.*$" or self.separator.isalnum():
            yield f"line.separator: {self.separator!r} given, expected one character that no number holds"


class CellLine(NamedTuple):
    """What a line says."""

    sequence: int | None
    values: tuple[float, ...]  # of each cell, NaN where it has none


def usual_fields(cells: int) -> tuple[str, ...]:
    """A sequence number, then the cells in their order."""
    return (SEQUENCE, *(f"cell.{i}" for i in range(cells)))


def checksum(body: bytes) -> int:
    """Exclusive or of all bytes."""
    return reduce(xor, body, 0)


def parse_line(form: LineFormat, line: bytes) -> CellLine:
    """What a line says, without its end.

    Raises:
        LineError: `prefix`, `checksum`, `fields` or `number`: the line is of no use.
    """
    try:
        text = line.decode("ascii").strip()
    except UnicodeDecodeError as error:
        raise LineError("prefix", f"byte {error.object[error.start]:#04x} is no character of a line") from error
    if form.checksum == "xor":
        text = _checked(text)
    if not text.startswith(form.prefix):
        raise LineError("prefix", f"{text[:20]!r} given, expected a line that begins with {form.prefix}")
    rest = text.removeprefix(form.prefix)
    given = rest.removeprefix(form.separator).split(None if form.separator == " " else form.separator)
    if len(given) != len(form.fields):
        raise LineError("fields", f"{len(given)} fields given, expected {len(form.fields)}")
    sequence: int | None = None
    values = [math.nan] * form.cells
    for name, word in zip(form.fields, map(str.strip, given), strict=True):
        if name == SEQUENCE:
            if not _WHOLE.fullmatch(word):
                raise LineError("number", f"{SEQUENCE}: {word[:20]!r} given, expected a whole number")
            sequence = int(word)
        elif name != IGNORED:
            values[int(name.partition(".")[2])] = _value(name, word)
    return CellLine(sequence, tuple(values))


def _checked(text: str) -> str:
    """A text without its checksum, which is right."""
    body, star, given = text.rpartition("*")
    if not star or not re.fullmatch(r"[0-9A-Fa-f]{2}", given):
        raise LineError("checksum", f"{text[-20:]!r} given, expected an end of * and two hexadecimal digits")
    expected = checksum(body.removeprefix("$").encode())
    if int(given, 16) != expected:
        raise LineError("checksum", f"checksum {given} given, expected {expected:02X}")
    return body


def _value(name: str, word: str) -> float:
    if word.lower() in MISSING:
        return math.nan
    if not _NUMBER.fullmatch(word) or not math.isfinite(value := float(word)):
        raise LineError("number", f"{name}: {word[:20]!r} given, expected a number")
    return value


def write_line(form: LineFormat, sequence: int, values: Sequence[float]) -> bytes:
    """The line that says something, with its end; for tests and for those who write the other side."""
    words = []
    for name in form.fields:
        if name == SEQUENCE:
            words.append(str(sequence))
        else:
            words.append("0" if name == IGNORED else f"{values[int(name.partition('.')[2])]:.6g}")
    text = form.separator.join([form.prefix, *words]) if form.prefix else form.separator.join(words)
    if form.checksum == "xor":
        text += f"*{checksum(text.removeprefix('$').encode()):02X}"
    return text.encode() + b"\r\n"


class LineBuffer:
    """Cuts bytes as they come into lines; what has no end within `LONGEST` is thrown away."""

    def __init__(self) -> None:
        self._held = b""
        self._skipping = False

    def feed(self, data: bytes) -> tuple[list[bytes], int]:
        """Takes bytes: the lines that they end, and how many were too long to be one."""
        *ended, self._held = (self._held + data).split(b"\n")
        too_long = 0
        lines = []
        for line in ended:
            if self._skipping:
                self._skipping = False
            elif len(line) > LONGEST:
                too_long += 1
            elif line.strip():
                lines.append(line.rstrip(b"\r"))
        if len(self._held) > LONGEST:
            too_long += not self._skipping
            self._skipping, self._held = True, b""
        return lines, too_long
