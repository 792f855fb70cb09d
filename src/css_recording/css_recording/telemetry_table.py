# SPDX-License-Identifier: Apache-2.0
"""Reads a table of telemetry: time, cell outputs, body rate, Sun vector.

The first line names the columns. Delimiter: comma, semicolon or tabulator. Lines that begin with # and empty lines
are skipped. An empty field, `nan`, `na`, `null` or `-` is a missing value.

time                           seconds, or ISO 8601 instants (UTC without an offset)
<names of the cell layout>     cell outputs
omega_x_rad_s, omega_y_..      body rate about each axis; also gyro_x or rate_x, and deg_s for degrees
sun_x, sun_y, sun_z            direction from the spacecraft to the Sun in the body frame, of any length
"""

import csv
import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import NamedTuple

from css_common.epochs import parse_utc
from css_recording.cell_layout import CellLayout
from css_recording.errors import BagError

Vector = tuple[float, float, float]

AXES = ("x", "y", "z")
_TO_RAD = {"rad": 1.0, "deg": math.pi / 180.0}
_RATE_COLUMN = re.compile(r"(?:omega|gyro|rate)_([xyz])(?:_(?:b|body))?(?:_(rad|deg)_(?:per_)?s)?")
_MISSING = frozenset(["", "nan", "na", "n/a", "null", "none", "-"])
_UNIX_ERA = 1e8  # [s] smaller numbers count from another epoch
_LAST_NS = 2**31 * 10**9  # seconds of a stamp are 32 bits wide


class TelemetryRow(NamedTuple):
    """One line of the table; NaN and None stand for what is missing."""

    stamp_ns: int
    cells: tuple[float, ...]
    omega_bn_b: Vector | None  # [rad/s]
    sun_b: Vector | None  # unit vector


class Telemetry(NamedTuple):
    """A table that was read."""

    rows: list[TelemetryRow]
    has_rate: bool
    has_sun: bool
    skipped: Mapping[str, int]  # broken lines by what is wrong with them
    ignored_columns: tuple[str, ...]


class _Broken(Exception):
    """A broken line: kind of fault for counting, and the whole story."""

    def __init__(self, kind: str, detail: str) -> None:
        super().__init__(detail)
        self.kind = kind


class _Columns(NamedTuple):
    time: int
    cells: tuple[int, ...]
    rate: tuple[int, int, int] | None
    rate_factor: float
    sun: tuple[int, int, int] | None
    names: tuple[str, ...]


def read_telemetry(
    path: Path, layout: CellLayout, epoch_ns: int | None = None, full_scale: float = 1.0, skip_bad: bool = False
) -> Telemetry:
    """Reads a table.

    Args:
        path: CSV file.
        layout: names of the cell columns.
        epoch_ns: [ns since 1970] instant from which seconds count; None: seconds since 1970.
        full_scale: cell output at normal incidence at 1 AU, by which outputs are divided.
        skip_bad: count broken lines and leave them out.

    Raises:
        BagError: the file cannot be read, a column is missing, or (without `skip_bad`) a line is broken; names
            line, column and what was expected.
    """
    rows: list[TelemetryRow] = []
    skipped: Counter[str] = Counter()
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            lines = _fields(file)
            line, header = next(lines, (1, []))
            columns, ignored = _identify(path, line, header, layout)
            last_ns = -1
            for line, fields in lines:
                try:
                    row = _parse(fields, columns, epoch_ns, full_scale, last_ns)
                except _Broken as error:
                    if not skip_bad:
                        raise BagError(f"{path}: line {line}: {error}") from error
                    skipped[error.kind] += 1
                    continue
                last_ns = row.stamp_ns
                rows.append(row)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise BagError(f"{path}: cannot be read: {error}") from error
    if not rows:
        raise BagError(f"{path}: no line of telemetry found below the header")
    return Telemetry(rows, columns.rate is not None, columns.sun is not None, dict(skipped), ignored)


def _fields(file: Iterator[str]) -> Iterator[tuple[int, list[str]]]:
    """Line numbers and fields of all lines that say something."""
    delimiter = None
    for number, line in enumerate(file, start=1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        if delimiter is None:
            delimiter = max(",;\t", key=line.count)
        yield number, [field.strip() for field in next(csv.reader([line], delimiter=delimiter))]


def _identify(path: Path, line: int, header: list[str], layout: CellLayout) -> tuple[_Columns, tuple[str, ...]]:
    """Which column is what, and those that are nothing."""
    where = f"{path}: line {line}"
    for name in header:
        if name and header.count(name) > 1:
            raise BagError(f"{where}: two columns are called {name}")
    normal_names = [re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_") for name in header]
    if "time" not in normal_names:
        raise BagError(f"{where}: no column time; the header is {', '.join(header) or 'empty'}")
    missing = [name for name in layout.names if name not in header]
    if missing:
        raise BagError(f"{where}: no column {missing[0]}, which the cell layout names")
    rate: dict[str, tuple[int, str]] = {}
    sun: dict[str, int] = {}
    for index, name in enumerate(normal_names):
        if header[index] in layout.names:
            continue
        matched = _RATE_COLUMN.fullmatch(name)
        if matched:
            axis, unit = matched.groups()
            if unit is None:
                raise BagError(f"{where}: column {header[index]}: expected its unit, omega_{axis}_rad_s or _deg_s")
            rate[axis] = (index, unit)
        elif name in ("sun_x", "sun_y", "sun_z"):
            sun[name[-1]] = index
    for kind, found in (("omega", rate), ("sun", sun)):
        absent = [axis for axis in AXES if axis not in found]
        if found and absent:
            raise BagError(f"{where}: no column {kind}_{absent[0]}; expected all three of x, y, z or none")
    if len({unit for _, unit in rate.values()}) > 1:
        raise BagError(f"{where}: the rates of the three axes have different units")
    columns = _Columns(
        normal_names.index("time"),
        tuple(header.index(name) for name in layout.names),
        (rate["x"][0], rate["y"][0], rate["z"][0]) if rate else None,
        _TO_RAD[rate["x"][1]] if rate else 1.0,
        (sun["x"], sun["y"], sun["z"]) if sun else None,
        tuple(header),
    )
    used = {columns.time, *columns.cells, *(columns.rate or ()), *(columns.sun or ())}
    return columns, tuple(name for index, name in enumerate(header) if index not in used)


def _parse(fields: list[str], columns: _Columns, epoch_ns: int | None, full_scale: float, last_ns: int) -> TelemetryRow:
    if len(fields) != len(columns.names):
        raise _Broken("wrong number of fields", f"expected {len(columns.names)} fields, found {len(fields)}")
    stamp_ns = _stamp(fields[columns.time], columns.names[columns.time], epoch_ns)
    if stamp_ns <= last_ns:
        raise _Broken("time does not go forward", f"column time: {fields[columns.time]} is not after the line before")
    cells = tuple(_number(fields, columns, index) / full_scale for index in columns.cells)
    omega_bn_b = sun_b = None
    if columns.rate is not None:
        omega_bn_b = _vector(fields, columns, columns.rate, columns.rate_factor)
    if columns.sun is not None:
        sun_b = _vector(fields, columns, columns.sun, 1.0)
        if sun_b is not None:
            length = math.hypot(*sun_b)
            if length == 0.0 or not math.isfinite(length):
                raise _Broken("no direction", "columns sun_x, sun_y, sun_z: expected a direction, found no length")
            sun_b = (sun_b[0] / length, sun_b[1] / length, sun_b[2] / length)
    return TelemetryRow(stamp_ns, cells, omega_bn_b, sun_b)


def _stamp(text: str, column: str, epoch_ns: int | None) -> int:
    expected = "expected seconds or an instant such as 2013-06-01T00:00:00Z"
    try:
        seconds = Decimal(text)
    except InvalidOperation:
        try:
            stamp_ns = parse_utc(text)
        except ValueError as error:
            raise _Broken("no time", f"column {column}: {text!r} found, {expected}") from error
    else:
        if not seconds.is_finite() or abs(seconds) > 1e12:
            raise _Broken("no time", f"column {column}: {text!r} found, {expected}")
        if epoch_ns is None and seconds < _UNIX_ERA:
            raise _Broken(
                "no epoch", f"column {column}: {text} s is not a time since 1970; --epoch names its beginning"
            )
        stamp_ns = (epoch_ns or 0) + round(seconds * 1_000_000_000)
    if not 0 < stamp_ns < _LAST_NS:
        raise _Broken("no time", f"column {column}: {text} is outside of 1970 to 2038")
    return stamp_ns


def _number(fields: list[str], columns: _Columns, index: int) -> float:
    """A number, NaN when it is missing."""
    text = fields[index]
    if text.lower() in _MISSING:
        return math.nan
    try:
        value = float(text)
    except ValueError:
        value = math.inf
    if not math.isfinite(value):
        raise _Broken("no number", f"column {columns.names[index]}: {text!r} found, expected a number")
    return value


def _vector(fields: list[str], columns: _Columns, indices: tuple[int, int, int], factor: float) -> Vector | None:
    """Three numbers, None when one is missing."""
    x, y, z = (_number(fields, columns, index) * factor for index in indices)
    return None if math.isnan(x + y + z) else (x, y, z)
