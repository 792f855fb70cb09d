# SPDX-License-Identifier: Apache-2.0
"""Tells by its header which column of a table is what, where no description does, and what others might have been."""

import re

from css_telemetry.description import Aiding, Description, TimeForm, Truth, VectorForm
from css_telemetry.table_text import Table, listed, name_and_unit
from css_telemetry.units import RATES, TIME_UNITS, plain_unit, unit_of_our_days
from css_telemetry.values import is_number

TIME_NAMES = ("time", "timestamp")
SUN_NAMES = ("sun_x", "sun_y", "sun_z")
_AXES = ("x", "y", "z")
_RATE = re.compile(r"(?:omega|gyro|rate)_([xyz])(?:_(?:b|body))?(?:_(?:(rad|deg)_(?:per_)?s|(dps)))?")
_LONG_FORM = {"cell", "sensor", "channel", "name", "variable", "value"}
# Columns that hold something which an import could read, had they other names or a description.
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
    (
        re.compile(r"(?:q|quat|quaternion|q_bn)_?(?:[wxyzs]|[0-4])|sigma_?[xyz123].*"),
        "like an attitude: a description makes it truth (--describe proposes one)",
    ),
    (
        re.compile(r"(?:mag|b|field|magnetometer)_?[xyz](?:_.*)?"),
        "like a magnetic field: a description gives it to estimators (--describe proposes one)",
    ),
)


def plain_name(name: str) -> str:
    """A column's name in small letters, digits and single underscores."""
    return re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")


def column_of(table: Table, name: str) -> int | None:
    """The column of exactly a name, else the one of that name with a unit in brackets; None: there is none.

    Raises:
        ValueError: several columns have the name.
    """
    if name in table.header:
        return table.header.index(name)
    found = [index for index, column in enumerate(table.header) if name_and_unit(column)[0] == name]
    if len(found) > 1:
        raise ValueError(f"the columns {table.header[found[0]]} and {table.header[found[1]]} both are {name}")
    return found[0] if found else None


def is_read_by_name(name: str) -> bool:
    """Whether a column of this name is read where no description says what it is."""
    plain = plain_name(name_and_unit(name)[0])
    return plain in (*TIME_NAMES, *SUN_NAMES) or bool(_RATE.fullmatch(plain) or _RATE.fullmatch(plain_name(name)))


def _check_header(table: Table) -> None:
    """Raises ValueError when the first line names no columns, or one twice."""
    header = table.header
    if header and all(map(is_number, header)):
        raise ValueError(f"no column time; the header is {listed(header)}; the first line must name the columns")
    places: dict[str, int] = {}
    for number, name in enumerate(header, start=1):
        if name and name in places:
            raise ValueError(
                f"two columns are called {name}, the {places[name]}. and the {number}., expected a name for each"
            )
        places[name] = number


def completed(
    table: Table, description: Description, time_unit: str | None, epoch_ns: int | None
) -> tuple[Description, list[str]]:
    """A description whose time, aiding and truth are those of the header where it does not say them.

    Args:
        table: whose header is read.
        description: what is known.
        time_unit: of counts; None: as the description or the header says, else seconds.
        epoch_ns: instant from which counts count, above that of the description.

    Returns:
        The description, and what was read by another name than its own.

    Raises:
        ValueError: the first line names no columns; one is missing, stands twice or has no unit.
    """
    _check_header(table)
    taken = {column_of(table, cell.column) for cell in description.cells}
    others = [index for index in range(len(table.header)) if index not in taken]
    notes: list[str] = []
    time = description.time
    if time is None:
        index = _time_column(table, others)
        name = table.header[index]
        if plain_name(name_and_unit(name)[0]) != TIME_NAMES[0]:
            notes.append(f"time from the column {name}")
        unit = time_unit or _unit_of_time(table, index)
        if unit is None:
            unit, guessed = _guessed_unit(table, index) if epoch_ns is None else ("s", "")
            notes += [guessed] if guessed else []
        time = TimeForm((name,), unit)
    elif time_unit is not None:
        time = time._replace(unit=time_unit)
    if epoch_ns is not None:
        time = time._replace(epoch_ns=epoch_ns)
    description = description._replace(time=time)
    if not description.names_roles:
        rate = _rates(table, others)
        sun = _vector("sun", table, {name[-1:]: _called(table, others, name) for name in SUN_NAMES})
        description = description._replace(
            aiding=Aiding(rate=rate), truth=Truth(sun=None if sun is None else VectorForm(sun), rate=rate)
        )
    return description, notes


def _called(table: Table, others: list[int], name: str) -> list[int]:
    return [index for index in others if plain_name(table.header[index]) == name]


def _time_column(table: Table, others: list[int]) -> int:
    for name in TIME_NAMES:
        found = [i for i in others if plain_name(name_and_unit(table.header[i])[0]) == name]
        if len(found) > 1:
            raise ValueError(f"the columns {table.header[found[0]]} and {table.header[found[1]]} both are a time")
        if found:
            return found[0]
    raise ValueError(
        f"no column time; the header is {listed(table.header)}; a description names any other (--describe proposes one)"
    )


def _guessed_unit(table: Table, index: int) -> tuple[str, str]:
    """Unit of times of which nothing is told, by the first of them, and what to say of it."""
    first = next((text for block in table.blocks() for text in block.columns[index] if str(text)), "")
    text = str(first).replace(",", ".") if table.decimal_comma else str(first)
    unit = unit_of_our_days(float(text)) if is_number(text) else None
    if unit in (None, "s"):
        return "s", ""
    return unit, f"times in {unit}, a guess: {text} {unit} since 1970 is a time of our days (--time-unit tells it)"


def _unit_of_time(table: Table, index: int) -> str | None:
    """Unit that a header tells; None: it tells none."""
    unit = plain_unit(table.units[index])
    if not unit:
        return None
    if unit.lower() in ("utc", "iso", "iso 8601", "iso8601"):
        return "s"
    if unit not in TIME_UNITS:
        raise ValueError(
            f"column {table.header[index]}: expected its unit as one of {', '.join(TIME_UNITS)}, or --time-unit"
        )
    return unit


def _rates(table: Table, others: list[int]) -> VectorForm | None:
    by_axis: dict[str, list[int]] = {axis: [] for axis in _AXES}
    units = set()
    for index in others:
        name, unit_behind = name_and_unit(table.header[index])
        matched = _RATE.fullmatch(plain_name(table.header[index])) or _RATE.fullmatch(plain_name(name))
        if matched:
            axis, unit, dps = matched.groups()
            told = plain_unit(unit_behind or table.units[index])
            factor = RATES[f"{unit}/s"] if unit else RATES["deg/s"] if dps else RATES.get(told)
            if factor is None:
                raise ValueError(f"column {table.header[index]}: expected its unit, omega_{axis}_rad_s or _deg_s")
            by_axis[axis].append(index)
            units.add(factor)
    columns = _vector("omega", table, by_axis)
    if len(units) > 1:
        raise ValueError("the rates of the three axes have different units")
    return None if columns is None else VectorForm(columns, units.pop())


def _vector(kind: str, table: Table, by_axis: dict[str, list[int]]) -> tuple[str, str, str] | None:
    """One column for each axis, or None when there is none at all."""
    if not any(by_axis.values()):
        return None
    for axis, found in by_axis.items():
        if not found:
            raise ValueError(f"no column {kind}_{axis}; expected all three of x, y, z or none")
        if len(found) > 1:
            raise ValueError(
                f"the columns {table.header[found[0]]} and {table.header[found[1]]} both are {kind}_{axis}"
            )
    x, y, z = (table.header[by_axis[axis][0]] for axis in _AXES)
    return x, y, z


def likenesses(ignored: tuple[str, ...]) -> list[str]:
    """What columns not used look like, one line for each kind."""
    lines = []
    for pattern, likeness in _LIKENESSES:
        names = [name for name in ignored if pattern.fullmatch(plain_name(name_and_unit(name)[0]))]
        if names:
            lines.append(f"{listed(names)} look{'s' if len(names) == 1 else ''} {likeness}")
    return lines


def long_form(table: Table, names: set[str]) -> str:
    """What helps with a table of one line for each cell and time."""
    if len(_LONG_FORM & {plain_name(name) for name in table.header}) < 2:
        return ""
    for block in table.blocks():
        if any(not names.isdisjoint(set(map(str, column[:100]))) for column in block.columns):
            return (
                "; it has a line for each cell and time, expected a column for each cell, or table: {long: {name: "
                "COLUMN, value: COLUMN}} in the description"
            )
        break
    return ""
