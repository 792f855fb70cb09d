# SPDX-License-Identifier: Apache-2.0
"""Reads the text of a table as spreadsheets, loggers and other programs write it: encoding, separator, decimal mark.

Nothing is guessed that changes a value without saying so: `TableText.read_as` names what is out of the ordinary.
"""

import csv
import io
import re
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import NamedTuple

from css_recording.errors import BagError

_SEPARATORS = {",": "comma", ";": "semicolon", "\t": "tabulator", "|": "bar", " ": "space"}
_BYTE_ORDER_MARKS = {b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16"}
# what no text holds; Latin-1 gives every byte a meaning, and would take any rubbish for one
_CONTROL = re.compile(r"[\x00-\x08\x0e-\x1b\x7f\ufffe\uffff]")
_COMMA_NUMBER = re.compile(r"[-+]?\d*,\d+(?:[eE][-+]?\d+)?", re.ASCII)
_POINT_NUMBER = re.compile(r"[-+]?(?:\d+\.\d*|\.\d+)(?:[eE][-+]?\d+)?", re.ASCII)
_UNIT = re.compile(r"\s*[\[(]([^\])]*)[\])]\s*$")


class Line(NamedTuple):
    """A line of the table; `fields` is None when it cannot be taken apart."""

    number: int
    fields: list[str] | None


class TableText(NamedTuple):
    """A table that was taken apart into fields."""

    header: Line
    lines: list[Line]
    decimal_comma: bool
    read_as: tuple[str, ...]  # what is not a UTF-8 text with commas and decimal points


def name_and_unit(column: str) -> tuple[str, str]:
    """Name of a column and the unit that stands behind it in brackets, if one does."""
    found = _UNIT.search(column)
    return (column[: found.start()].strip(), found.group(1).strip()) if found else (column, "")


def read_table(path: Path, content: bytes, names: Collection[str]) -> TableText:
    """Fields of a table.

    Args:
        path: named in messages.
        content: of the file.
        names: columns that are expected, by which the separator is found.

    Raises:
        BagError: the content is no text, or has no header.
    """
    text, encoding = _decoded(path, content)
    # every kind of line end, but none of the further ones that `splitlines` knows
    numbered = [
        (number, line.rstrip("\n"))
        for number, line in enumerate(io.StringIO(text, newline=None), start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if not numbered:
        raise BagError(f"{path}: line 1: no column time; the header is empty")
    separator = max(_SEPARATORS, key=lambda candidate: _agreement(numbered[0][1], candidate, names))
    header, *lines = (Line(number, _split(line, separator)) for number, line in numbered)
    if header.fields is None:
        raise BagError(f"{path}: line {header.number}: the header cannot be taken apart: a quotation mark is left open")
    decimal_comma = separator != "," and _has_decimal_commas(lines)
    read_as = [f"encoding {encoding}"] if encoding else []
    read_as += [f"separator {_SEPARATORS[separator]}"] if separator != "," else []
    read_as += ["decimal comma"] if decimal_comma else []
    return TableText(header, lines, decimal_comma, tuple(read_as))


def _decoded(path: Path, content: bytes) -> tuple[str, str]:
    """Text, and its encoding when that is not UTF-8."""
    encoding = _BYTE_ORDER_MARKS.get(content[:2], "")
    try:
        text = content.decode(encoding or "utf-8-sig")
    except UnicodeDecodeError:
        encoding = "Latin-1"
        text = content.decode("latin-1")
    found = _CONTROL.search(text)
    if found:
        line = text.count("\n", 0, found.start()) + 1
        raise BagError(
            f"{path}: cannot be read: line {line} holds the character {ord(found.group()):#04x}, it is no text"
        )
    return text, encoding


def _agreement(line: str, separator: str, names: Collection[str]) -> tuple[int, int]:
    """How many expected columns a separator finds in a header; the number of fields decides between equals."""
    fields = _split(line, separator) or []
    known = sum(field in names or name_and_unit(field)[0] in names for field in fields)
    # a blank occurs within names, so that it must find more than the others
    return known, 0 if separator == " " else len(fields)


def _split(line: str, separator: str) -> list[str] | None:
    if separator == " ":
        line = " ".join(line.split())
    try:
        return [field.strip() for field in next(csv.reader([line], delimiter=separator, strict=True))]
    except csv.Error:
        return None


def _has_decimal_commas(lines: list[Line]) -> bool:
    """True when numbers have commas in the place of points, and none has a point."""
    fields = list(_fields(lines))
    return any(map(_COMMA_NUMBER.fullmatch, fields)) and not any(map(_POINT_NUMBER.fullmatch, fields))


def _fields(lines: list[Line]) -> Iterator[str]:
    for line in lines:
        yield from line.fields or ()
