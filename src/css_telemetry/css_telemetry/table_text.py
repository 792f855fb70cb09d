# SPDX-License-Identifier: Apache-2.0
"""Reads the text of a table as spreadsheets, loggers and other programs write it: encoding, separator, decimal mark.

Nothing is guessed that changes a value without saying so: `Table.read_as` names what is out of the ordinary.
"""

import csv
import io
import re
from collections.abc import Callable, Collection, Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np

from css_recording.errors import BagError
from css_telemetry.description import PLAIN, TableForm
from css_telemetry.faults import Broken
from css_telemetry.units import is_unit
from css_telemetry.values import Column, is_number

SEPARATORS = {",": "comma", ";": "semicolon", "\t": "tabulator", "|": "bar", " ": "space"}
_BYTE_ORDER_MARKS = {b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16"}
# what no text holds; Latin-1 gives every byte a meaning, and would take any rubbish for one
_CONTROL = re.compile(r"[\x00-\x08\x0e-\x1b\x7f\ufffe\uffff]")
_COMMA_NUMBER = re.compile(r"[-+]?\d*,\d+(?:[eE][-+]?\d+)?", re.ASCII)
_POINT_NUMBER = re.compile(r"[-+]?(?:\d+\.\d*|\.\d+)(?:[eE][-+]?\d+)?", re.ASCII)
_UNIT = re.compile(r"\s*[\[(]([^\])]*)[\])]\s*$")
_BLOCK = 20_000
_LONGEST = 300  # characters of a header in a message
_LOOKED_AT = 2_000  # lines by which separator and decimal mark are found


class Block(NamedTuple):
    """Some lines of a table, by columns."""

    lines: np.ndarray  # (K,) numbers of the lines
    columns: list[Column]  # (K,) each
    broken: list[tuple[int, Broken]]  # further lines that cannot be taken apart: number and fault

    @property
    def size(self) -> int:
        """Lines, the broken ones included."""
        return len(self.lines) + len(self.broken)


class Table(NamedTuple):
    """A table whose header is read, and whose lines can be, as often as needed."""

    path: Path
    header: tuple[str, ...]
    header_line: int
    units: tuple[str, ...]  # of each column, by its name or the row of units; empty: not told
    decimal_comma: bool
    read_as: tuple[str, ...]  # what is not a UTF-8 text with commas and decimal points
    blocks: Callable[[], Iterator[Block]]
    doubt: str = ""  # what of the form had to be guessed against what stands there


def listed(header: Sequence[str]) -> str:
    """Names of columns for a message, which stays a line although a file may be anything."""
    names = ", ".join(header) or "empty"
    return names if len(names) <= _LONGEST else f"{names[:_LONGEST]} ... ({len(header)} in all)"


def name_and_unit(column: str) -> tuple[str, str]:
    """Name of a column and the unit that stands behind it in brackets, if one does."""
    found = _UNIT.search(column)
    return (column[: found.start()].strip(), found.group(1).strip()) if found else (column, "")


def text_table(
    path: Path,
    content: bytes,
    names: Collection[str],
    form: TableForm = PLAIN,
    is_used: Callable[[str], bool] | None = None,
) -> Table:
    """The table of a text.

    Args:
        path: named in messages.
        content: of the file.
        names: columns that are expected, by which the separator is found.
        form: what is known of it.
        is_used: whether a column of some name is; None: nobody knows yet.

    Raises:
        BagError: the content is no text, has no header, or names that are not those of its fields.
    """
    text, encoding = _decoded(path, content, form.encoding)
    first = list(islice(_numbered(text), _LOOKED_AT))
    if not first:
        raise BagError(f"{path}: line 1: nothing is there, expected the names of columns, and lines below them")
    separator = form.separator or _separator(first, names)
    header_line, header_text = first[0]
    header = _split(header_text, separator)
    if header is None:
        raise BagError(f"{path}: line {header_line}: the header cannot be taken apart: a quotation mark is left open")
    header, doubt = _fitting(path, header, first, separator, form.absent, is_used)
    fields = [field for _, line in first[1:] for field in _split(line, separator) or ()]
    decimal_comma = form.decimal == "," if form.decimal else separator != "," and _has_decimal_commas(fields)
    row = (_split(first[1][1], separator) if len(first) > 1 else None) or []
    has_units = _is_row_of_units(row, len(header)) if form.units_row is None else form.units_row
    read_as = [f"encoding {encoding}"] if encoding and encoding.lower() not in ("utf-8", "utf8") else []
    read_as += [f"separator {SEPARATORS.get(separator, separator)}"] if separator != "," else []
    read_as += ["decimal comma"] if decimal_comma else []
    read_as += [f"units in line {first[1][0]}"] if has_units else []

    def blocks() -> Iterator[Block]:
        lines = islice(_numbered(text), 2 if has_units else 1, None)
        while part := list(islice(lines, _BLOCK)):
            yield _block(part, separator, len(header))

    own = [name_and_unit(name)[1] for name in header]
    units = tuple(unit or (row[i] if has_units and i < len(row) else "") for i, unit in enumerate(own))
    return Table(path, tuple(header), header_line, units, decimal_comma, tuple(read_as), blocks, doubt)


def _fitting(
    path: Path,
    header: list[str],
    first: list[tuple[int, str]],
    separator: str,
    absent: tuple[str, ...],
    is_used: Callable[[str], bool] | None,
) -> tuple[list[str], str]:
    """The names that have a field in the lines, and what was guessed of that.

    Where all lines have too few fields, and just as many names are of no use, it is these that have none.

    Raises:
        BagError: all lines have too few fields, and it is not plain which names have none; or a name that a description
            has for absent is not there.
    """
    for name in absent:
        if name not in header:
            raise BagError(f"{path}: line {first[0][0]}: no column {name}, which table.absent names")
    header = [name for name in header if name not in absent]
    counts = {len(_split(line, separator) or ()) for _, line in first[1:]}
    # one line alone may as well be cut off
    alike = len(first) > 2 and len(counts) == 1 and 0 not in counts
    short = len(header) - counts.pop() if alike else 0
    if short <= 0 or separator == " ":
        return header, ""
    unused = [name for name in header if is_used is not None and not is_used(name)]
    found = f"all lines have {len(header) - short} fields under {len(header)} names"
    if len(unused) != short:
        raise BagError(
            f"{path}: line {first[0][0]}: {found}: expected as many; a description says which names have no field by "
            "table: {absent: [NAME]}"
        )
    named = ", ".join(unused)
    doubt = f"{found}; {named}, which nothing uses, is taken to have none (table: {{absent: [{named}]}} tells it)"
    return [name for name in header if name not in unused], doubt


def _numbered(text: str) -> Iterator[tuple[int, str]]:
    """Lines that are neither empty nor comments, with their numbers."""
    # every kind of line end, but none of the further ones that `splitlines` knows
    for number, line in enumerate(io.StringIO(text, newline=None), start=1):
        if line.strip() and not line.lstrip().startswith("#"):
            yield number, line.rstrip("\n")


def _decoded(path: Path, content: bytes, wanted: str) -> tuple[str, str]:
    """Text, and its encoding when that is not UTF-8."""
    encoding = wanted or _BYTE_ORDER_MARKS.get(content[:2], "")
    try:
        text = content.decode(encoding or "utf-8-sig")
    except UnicodeDecodeError as error:
        if wanted:
            raise BagError(f"{path}: cannot be read as {wanted}: {error.reason} at byte {error.start}") from error
        encoding = "Latin-1"
        text = content.decode("latin-1")
    found = _CONTROL.search(text)
    if found:
        line = text.count("\n", 0, found.start()) + 1
        raise BagError(
            f"{path}: cannot be read: line {line} holds the character {ord(found.group()):#04x}, it is no text"
        )
    return text, encoding


def _separator(first: list[tuple[int, str]], names: Collection[str]) -> str:
    """The separator that finds the most expected columns in the header, and the same number of fields below it."""
    header = first[0][1]
    below = [line for _, line in first[1:20]]

    def agreement(separator: str) -> tuple[int, int, int]:
        fields = _split(header, separator) or []
        known = sum(field in names or name_and_unit(field)[0] in names for field in fields)
        alike = len(fields) > 1 and any(len(_split(line, separator) or ()) == len(fields) for line in below)
        # a blank occurs within names, so that it must find more than the others
        return known, int(alike and separator != " "), 0 if separator == " " else len(fields)

    best = max(SEPARATORS, key=agreement)
    if agreement(best) <= (0, 0, 1) and len(header.split()) > 1:
        return " "  # nothing else separates anything
    return best


def _split(line: str, separator: str) -> list[str] | None:
    if separator == " ":
        line = " ".join(line.split())
    if '"' not in line:
        return [field.strip() for field in line.split(separator)]
    try:
        return [field.strip() for field in next(csv.reader([line], delimiter=separator, strict=True))]
    except csv.Error:
        return None


def _block(part: list[tuple[int, str]], separator: str, width: int) -> Block:
    numbers: list[int] = []
    rows: list[list[str]] = []
    broken: list[tuple[int, Broken]] = []
    for number, line in part:
        fields = _split(line, separator)
        if fields is None:
            broken.append((number, Broken("not readable", "a quotation mark is left open or stands inside a field")))
        elif len(fields) != width:
            detail = f"expected {width} fields, found {len(fields)}"
            broken.append((number, Broken("wrong number of fields", detail)))
        else:
            numbers.append(number)
            rows.append(fields)
    columns: list[Column] = [list(column) for column in zip(*rows, strict=True)] if rows else [[]] * width
    return Block(np.array(numbers, np.int64), columns, broken)


def _has_decimal_commas(fields: list[str]) -> bool:
    """True when numbers have commas in the place of points, and none has a point."""
    return any(map(_COMMA_NUMBER.fullmatch, fields)) and not any(map(_POINT_NUMBER.fullmatch, fields))


def _is_row_of_units(row: list[str], width: int) -> bool:
    """Whether the fields below the header are units: none is a number, and some are plainly units."""
    fields = [field.strip("[]() ") for field in row]
    known = sum(bool(field) and is_unit(field) for field in fields)
    return len(row) == width and known > 0 and not any(map(is_number, fields)) and 2 * known >= sum(map(bool, fields))
