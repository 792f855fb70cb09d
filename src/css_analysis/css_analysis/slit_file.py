# SPDX-License-Identifier: Apache-2.0
"""Pulses of a slit sensor in a CSV file: a heading with the columns slit and count, and head where there are several.

A slit is `upper`, `vertical` or `lower`, or its first letter. A count is that of a 32-bit timer. Lines that are empty
or begin with # are skipped; columns with other names are ignored.
"""

import csv
from collections.abc import Iterator
from pathlib import Path

from css_common.file_text import decoded
from css_sensors.slits import LOWER, TIMER_SPAN, UPPER, VERTICAL

Pulse = tuple[int, int, int]
"""Slit, count and head."""

_SLITS = {"upper": UPPER, "vertical": VERTICAL, "lower": LOWER, "u": UPPER, "v": VERTICAL, "l": LOWER}


class SlitFileError(Exception):
    """The file cannot be read; the message is one line with the file and, where there is one, the line."""


def read_slit_file(path: Path, heads: int = 1) -> list[Pulse]:
    """Pulses in the order of the file.

    Args:
        path: CSV file, UTF-8.
        heads: number of heads that there are.

    Raises:
        SlitFileError: the file is missing, lacks a column, holds no pulse or a line that is none.
    """
    try:
        text = decoded(path.read_bytes())
    except OSError as error:
        raise SlitFileError(f"{path}: cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise SlitFileError(f"{path}: cannot be read: {error}") from error
    lines = ((number, line) for number, line in enumerate(text.splitlines(), 1) if line.strip()[:1] not in ("", "#"))
    pulses = list(_pulses(path, lines, heads))
    if not pulses:
        raise SlitFileError(f"{path}: no pulses, expected a line of slit and count for each")
    return pulses


def _pulses(path: Path, lines: Iterator[tuple[int, str]], heads: int) -> Iterator[Pulse]:
    first = next(lines, None)
    if first is None:
        return
    number, heading = first
    names = [name.strip().lower() for name in _cells(path, number, heading)]
    for name in ("slit", "count"):
        if name not in names:
            raise SlitFileError(
                f"{path}: line {number}: no column {name!r}, expected a heading such as slit,count; it has {heading!r}"
            )
    for number, line in lines:
        cells = _cells(path, number, line)
        if len(cells) != len(names):
            raise SlitFileError(f"{path}: line {number}: {len(cells)} values given, expected {len(names)}: {line!r}")
        values = dict(zip(names, cells, strict=True))
        slit = _SLITS.get(values["slit"].strip().lower())
        if slit is None:
            raise SlitFileError(
                f"{path}: line {number}: slit {values['slit'].strip()!r} given, expected upper, vertical or lower"
            )
        count = _whole(path, number, "count", values["count"], TIMER_SPAN - 1)
        yield slit, count, _whole(path, number, "head", values.get("head", "0"), heads - 1)


def _cells(path: Path, number: int, line: str) -> list[str]:
    try:
        return next(csv.reader([line], strict=True))
    except csv.Error as error:
        raise SlitFileError(f"{path}: line {number}: {error}") from error


def _whole(path: Path, number: int, name: str, text: str, largest: int) -> int:
    try:
        value = int(text)
    except ValueError:
        value = -1
    if not 0 <= value <= largest:
        raise SlitFileError(
            f"{path}: line {number}: {name} {text.strip()!r} given, expected a whole number from 0 to {largest}"
        )
    return value
