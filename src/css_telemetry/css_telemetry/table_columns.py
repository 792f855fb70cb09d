# SPDX-License-Identifier: Apache-2.0
"""Tells by its header which column of a telemetry table is what, and what a column not used might have been."""

import math
import re
from pathlib import Path
from typing import NamedTuple

from css_recording.errors import BagError
from css_telemetry.layout_file import CellLayout
from css_telemetry.table_forms import TIME_UNITS
from css_telemetry.table_text import Line, TableText, name_and_unit
from css_telemetry.table_values import plain_number

Indices = tuple[int, int, int]

TIME_NAMES = ("time", "timestamp")
_AXES = ("x", "y", "z")
_TO_RAD = {"rad": 1.0, "deg": math.pi / 180.0}
_RATE = re.compile(r"(?:omega|gyro|rate)_([xyz])(?:_(?:b|body))?(?:_(?:(rad|deg)_(?:per_)?s|(dps)))?")
_LONG_FORM = {"cell", "sensor", "channel", "name", "variable", "value"}
_RATES_ARE = "rates are omega_x_rad_s or omega_x_deg_s and so on for y and z"
# Columns that hold something which an import could have read, had they other names.
_LIKENESSES = (
    (
        re.compile(
            r"(?:omega|omg|gyr|gyro|gyroscope|rate|w|ang_?vel|angular_velocity|body_rate)s?_?(?:[xyz]|[0-3])(?:_.*)?"
        ),
        "like body rates: omega_x_rad_s or omega_x_deg_s, and so on for y and z, are read",
    ),
    (
        re.compile(r"(?:sun(?:_[a-z]+)?|s|sv)_?[xyz](?:_.*)?"),
        "like a Sun vector: in the body frame, sun_x, sun_y and sun_z are read",
    ),
    (re.compile(r"(?:q|quat|quaternion|q_bn)_?(?:[wxyzs]|[0-4])|sigma_?[xyz123].*"), "like an attitude: none is read"),
    (re.compile(r"(?:mag|b|field|magnetometer)_?[xyz](?:_.*)?"), "like a magnetic field: none is read"),
)


class Columns(NamedTuple):
    """Places of what a table tells."""

    time: int
    time_unit: str
    cells: tuple[int, ...]
    rate: Indices | None
    rate_factor: float  # to rad/s
    sun: Indices | None
    names: tuple[str, ...]
    notes: tuple[str, ...]  # what was read by another name than its own

    @property
    def ignored(self) -> tuple[str, ...]:
        """Columns not used."""
        used = {self.time, *self.cells, *(self.rate or ()), *(self.sun or ())}
        return tuple(name for index, name in enumerate(self.names) if index not in used and name)


def identify_columns(path: Path, table: TableText, layout: CellLayout, time_unit: str | None = None) -> Columns:
    """Which column is what.

    Args:
        path: named in messages.
        table: its header is read.
        layout: names of the cells.
        time_unit: of counts in the column time; None: what its header says, else seconds.

    Raises:
        BagError: a column is missing, stands twice or has no unit.
    """
    header = table.header.fields or []
    try:
        return _identify(header, layout, time_unit)
    except ValueError as error:
        raise BagError(
            f"{path}: line {table.header.number}: {error}{_long_form(header, table.lines, layout)}"
        ) from error


def _identify(header: list[str], layout: CellLayout, time_unit: str | None) -> Columns:
    if header and all(math.isfinite(plain_number(name)) for name in header):
        raise ValueError(f"no column time; the header is {', '.join(header)}; the first line must name the columns")
    for name in header:
        if name and header.count(name) > 1:
            raise ValueError(f"two columns are called {name}")
    plain = [_plain(name) for name in header]
    cells = tuple(_cell_column(header, name) for name in layout.names)
    others = [index for index in range(len(header)) if index not in cells]
    time = _time_column(header, others)
    missing = [name for name, index in zip(layout.names, cells, strict=True) if index is None]
    if missing:
        raise ValueError(f"no column {missing[0]}, which the cell layout names; the header is {', '.join(header)}")
    found = tuple(index for index in cells if index is not None)
    rate, factor = _rate_columns(header, plain, others)
    sun = _vector_columns("sun", header, {name[-1:]: [i for i in others if plain[i] == name] for name in _SUN})
    _refuse_different_units(header, found)
    return Columns(
        time=time,
        time_unit=_unit_of_time(header[time], time_unit),
        cells=found,
        rate=rate,
        rate_factor=factor,
        sun=sun,
        names=tuple(header),
        notes=tuple(_notes(header, time, found)),
    )


_SUN = ("sun_x", "sun_y", "sun_z")


def _plain(name: str) -> str:
    """A column's name in small letters, digits and single underscores."""
    return re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")


def _time_column(header: list[str], others: list[int]) -> int:
    for name in TIME_NAMES:
        found = [i for i in others if _plain(name_and_unit(header[i])[0]) == name]
        if len(found) > 1:
            raise ValueError(f"the columns {header[found[0]]} and {header[found[1]]} both are a time")
        if found:
            return found[0]
    raise ValueError(f"no column time; the header is {', '.join(header) or 'empty'}")


def _cell_column(header: list[str], name: str) -> int | None:
    """The column of a cell: the one of exactly its name, else the one of its name with a unit in brackets."""
    if name in header:
        return header.index(name)
    found = [index for index, column in enumerate(header) if name_and_unit(column)[0] == name]
    if len(found) > 1:
        raise ValueError(f"the columns {header[found[0]]} and {header[found[1]]} both are the cell {name}")
    return found[0] if found else None


def _unit_of_time(column: str, wanted: str | None) -> str:
    unit = name_and_unit(column)[1].lower()
    unit = {"sec": "s", "seconds": "s", "msec": "ms", "µs": "us"}.get(unit, unit)
    if wanted is not None:
        return wanted
    if unit in ("", "utc", "iso", "iso 8601"):
        return "s"
    if unit not in TIME_UNITS:
        raise ValueError(f"column {column}: expected its unit as one of {', '.join(TIME_UNITS)}, or --time-unit")
    return unit


def _rate_columns(header: list[str], plain: list[str], others: list[int]) -> tuple[Indices | None, float]:
    by_axis: dict[str, list[int]] = {axis: [] for axis in _AXES}
    units = set()
    for index in others:
        matched = _RATE.fullmatch(plain[index])
        if matched:
            axis, unit, dps = matched.groups()
            if unit is None and dps is None:
                raise ValueError(f"column {header[index]}: expected its unit, omega_{axis}_rad_s or _deg_s")
            by_axis[axis].append(index)
            units.add(unit or "deg")
    indices = _vector_columns("omega", header, by_axis)
    if len(units) > 1:
        raise ValueError("the rates of the three axes have different units")
    return indices, _TO_RAD[units.pop()] if units else 1.0


def _vector_columns(kind: str, header: list[str], by_axis: dict[str, list[int]]) -> Indices | None:
    """One column for each axis, or None when there is none at all."""
    if not any(by_axis.values()):
        return None
    for axis, found in by_axis.items():
        if not found:
            raise ValueError(f"no column {kind}_{axis}; expected all three of x, y, z or none")
        if len(found) > 1:
            raise ValueError(f"the columns {header[found[0]]} and {header[found[1]]} both are {kind}_{axis}")
    x, y, z = (by_axis[axis][0] for axis in _AXES)
    return x, y, z


def _refuse_different_units(header: list[str], cells: tuple[int, ...]) -> None:
    units = {name_and_unit(header[index])[1]: header[index] for index in cells}
    if len(units) > 1:
        first, second = list(units.values())[:2]
        raise ValueError(f"the cells {first} and {second} have different units, expected one for all")


def _notes(header: list[str], time: int, cells: tuple[int, ...]) -> list[str]:
    notes = []
    if _plain(name_and_unit(header[time])[0]) != TIME_NAMES[0]:
        notes.append(f"time from the column {header[time]}")
    units = {name_and_unit(header[index])[1] for index in cells} - {""}
    notes += [f"cell outputs in {unit}" for unit in units]
    return notes


def likenesses(ignored: tuple[str, ...]) -> list[str]:
    """What columns not used look like, one line for each kind."""
    lines = []
    for pattern, likeness in _LIKENESSES:
        names = [name for name in ignored if pattern.fullmatch(_plain(name_and_unit(name)[0]))]
        if names:
            lines.append(f"{', '.join(names)} look{'s' if len(names) == 1 else ''} {likeness}")
    return lines


def _long_form(header: list[str], lines: list[Line], layout: CellLayout) -> str:
    """What helps with a table of one line for each cell and time."""
    named = any(set(line.fields or ()) & set(layout.names) for line in lines[:100])
    if len(_LONG_FORM & {_plain(name) for name in header}) >= 2 and named:
        return "; it has a line for each cell and time, expected a column for each cell: pivot it first"
    return ""
