# SPDX-License-Identifier: Apache-2.0
"""Reads a table of telemetry: time, cell outputs, body rate, Sun vector (form: `table_forms`)."""

import hashlib
import math
from collections import Counter
from collections.abc import Container, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from css_recording.errors import BagError
from css_telemetry.layout_file import CellLayout
from css_telemetry.sentinels import fill_values
from css_telemetry.table_columns import TIME_NAMES, Columns, Indices, identify_columns
from css_telemetry.table_text import Line, TableText, read_table
from css_telemetry.table_times import consistent_lines
from css_telemetry.table_values import Broken, parse_number, parse_time

Vector = tuple[float, float, float]

_NAMES = frozenset([*TIME_NAMES, *(f"sun_{axis}" for axis in "xyz")])


class TelemetryRow(NamedTuple):
    """One line of the table; NaN and None stand for what is missing."""

    stamp_ns: int
    cells: tuple[float, ...]
    omega_bn_b: Vector | None  # [rad/s]
    sun_b: Vector | None  # unit vector


class Refused(NamedTuple):
    """Broken lines of one kind."""

    lines: int
    first_line: int


class Telemetry(NamedTuple):
    """A table that was read."""

    rows: list[TelemetryRow]
    has_rate: bool
    has_sun: bool
    lines: int  # of telemetry in the table: those used and those refused
    refused: Mapping[str, Refused]  # broken lines by what is wrong with them
    fills: Mapping[float, int]  # numbers taken as missing values, and how often
    ignored_columns: tuple[str, ...]
    read_as: tuple[str, ...]  # what is unusual about the form of the table
    scaled: bool  # the output of a cell that the Sun meets head-on was stated
    sha256: str  # of the file


class _Raw(NamedTuple):
    """Numbers of one line as they stand in it; NaN for missing ones."""

    line: int
    stamp_ns: int
    cells: tuple[float, ...]
    rate: tuple[float, ...]
    sun: tuple[float, ...]


class _Faults:
    """Broken lines, counted by kind."""

    def __init__(self) -> None:
        self.found: list[tuple[int, Broken]] = []

    def add(self, line: int, fault: Broken) -> None:
        self.found.append((line, fault))

    def counted(self) -> dict[str, Refused]:
        counts = Counter(fault.kind for _, fault in self.found)
        return {
            kind: Refused(count, min(line for line, fault in self.found if fault.kind == kind))
            for kind, count in counts.items()
        }

    def first(self) -> tuple[int, Broken]:
        return min(self.found, key=lambda found: found[0])


def read_telemetry(
    path: Path,
    layout: CellLayout,
    epoch_ns: int | None = None,
    full_scale: float | None = None,
    skip_bad: bool = False,
    time_unit: str | None = None,
) -> Telemetry:
    """Reads a table.

    Args:
        path: CSV file.
        layout: names of the cell columns; their dark levels and full scales, if it tells them.
        epoch_ns: [ns since 1970] instant from which counts of time count; None: 1970.
        full_scale: what a cell gives above its dark level at normal incidence at 1 AU, by which outputs are divided;
            None: what the layout says, else 1.
        skip_bad: count broken lines and leave them out.
        time_unit: s, ms, us or ns; None: what the header says, else s.

    Raises:
        BagError: the file cannot be read, a column is missing, or (without `skip_bad`) a line is broken; names
            line, column and what was expected.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise BagError(f"{path}: cannot be read: {error.strerror}") from error
    table = read_table(path, content, _NAMES | set(layout.names))
    columns = identify_columns(path, table, layout, time_unit)
    faults = _Faults()
    raws = list(_numbers(table, columns, epoch_ns, faults))
    raws, fills = _without_fills(raws)
    rows = [(raw.line, row) for raw, row in _rows(raws, columns, layout, full_scale, faults)]
    rows = _in_order(rows, faults)
    if faults.found and not (skip_bad and rows):
        raise BagError(_refusal(path, faults, len(table.lines)))
    if not rows:
        raise BagError(f"{path}: no line of telemetry found below the header")
    return Telemetry(
        rows=[row for _, row in rows],
        has_rate=columns.rate is not None,
        has_sun=columns.sun is not None,
        lines=len(table.lines),
        refused=faults.counted(),
        fills=fills,
        ignored_columns=columns.ignored,
        read_as=(*table.read_as, *columns.notes),
        scaled=full_scale is not None or layout.full_scale is not None,
        sha256=hashlib.sha256(content).hexdigest(),
    )


def _refusal(path: Path, faults: _Faults, lines: int) -> str:
    line, fault = faults.first()
    broken = len(faults.found)
    more = f" ({broken} of {lines} lines are broken; --skip-bad leaves them out)" if broken < lines else ""
    return f"{path}: line {line}: {fault}{more}"


def _numbers(table: TableText, columns: Columns, epoch_ns: int | None, faults: _Faults) -> Iterator[_Raw]:
    for line in table.lines:
        try:
            yield _parse(line, columns, epoch_ns, table.decimal_comma)
        except Broken as fault:
            faults.add(line.number, fault)


def _parse(line: Line, columns: Columns, epoch_ns: int | None, decimal_comma: bool) -> _Raw:
    if line.fields is None:
        raise Broken("not readable", "a quotation mark is left open or stands inside a field")
    fields, names = line.fields, columns.names
    if len(fields) != len(names):
        raise Broken("wrong number of fields", f"expected {len(names)} fields, found {len(fields)}")

    def numbers(indices: Indices | tuple[int, ...] | None) -> tuple[float, ...]:
        return tuple(parse_number(fields[i], names[i], decimal_comma) for i in indices or ())

    stamp_ns = parse_time(fields[columns.time], names[columns.time], epoch_ns, columns.time_unit, decimal_comma)
    return _Raw(line.number, stamp_ns, numbers(columns.cells), numbers(columns.rate), numbers(columns.sun))


def _without_fills(raws: list[_Raw]) -> tuple[list[_Raw], Counter[float]]:
    """The lines with NaN in the place of fill values, and those that were found."""
    fills = [
        fill_values(value for raw in raws for value in values(raw))
        for values in (lambda raw: raw.cells, lambda raw: raw.rate, lambda raw: raw.sun)
    ]
    counts = sum(fills, Counter[float]())
    if counts:
        cells, rate, sun = fills
        raws = [
            raw._replace(cells=_masked(raw.cells, cells), rate=_masked(raw.rate, rate), sun=_masked(raw.sun, sun))
            for raw in raws
        ]
    return raws, counts


def _masked(values: tuple[float, ...], fills: Container[float]) -> tuple[float, ...]:
    return tuple(math.nan if value in fills else value for value in values)


def _rows(
    raws: list[_Raw], columns: Columns, layout: CellLayout, full_scale: float | None, faults: _Faults
) -> Iterator[tuple[_Raw, TelemetryRow]]:
    cells = len(layout.names)
    scales = (full_scale,) * cells if full_scale is not None else layout.full_scale or (1.0,) * cells
    darks = layout.dark_level or (0.0,) * cells
    for raw in raws:
        outputs = tuple((value - dark) / scale for value, dark, scale in zip(raw.cells, darks, scales, strict=True))
        try:
            if any(map(math.isinf, outputs)):
                raise Broken("no number", "a cell output over its full scale is beyond all numbers")
            yield raw, TelemetryRow(raw.stamp_ns, outputs, _vector(raw.rate, columns.rate_factor), _direction(raw.sun))
        except Broken as fault:
            faults.add(raw.line, fault)


def _vector(numbers: tuple[float, ...], factor: float = 1.0) -> Vector | None:
    """Three numbers, None when one is missing or there are none."""
    if not numbers or math.isnan(sum(numbers)):
        return None
    x, y, z = (number * factor for number in numbers)
    return x, y, z


def _direction(numbers: tuple[float, ...]) -> Vector | None:
    vector = _vector(numbers)
    if vector is None:
        return None
    length = math.hypot(*vector)
    if length == 0.0 or not math.isfinite(length):
        raise Broken("no direction", "columns sun_x, sun_y, sun_z: expected a direction, found no length")
    return _vector(vector, 1.0 / length)


def _in_order(rows: list[tuple[int, TelemetryRow]], faults: _Faults) -> list[tuple[int, TelemetryRow]]:
    """The largest set of lines that go forward in time."""
    kept = set(consistent_lines([row.stamp_ns for _, row in rows]))
    for index, (line, _) in enumerate(rows):
        if index not in kept:
            others = f"the {len(kept)} lines that do" if len(kept) > 1 else "the other"
            faults.add(line, Broken("time does not go forward", f"column time: it does not go forward with {others}"))
    return [row for index, row in enumerate(rows) if index in kept]
