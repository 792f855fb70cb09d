# SPDX-License-Identifier: Apache-2.0
"""Proposes a description of a table, with the reason for each guess, for the user to correct and keep."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from css_recording.errors import BagError
from css_telemetry.description import TableForm
from css_telemetry.guesses import Guess, Guesses, guessed
from css_telemetry.header import plain_name
from css_telemetry.sentinels import fill_values
from css_telemetry.table_files import open_table
from css_telemetry.table_text import Table, listed
from css_telemetry.telemetry import LEAST_PLAUSIBLE, MOST_PLAUSIBLE
from css_telemetry.time_guess import TimeGuess, guessed_time
from css_telemetry.units import OUTPUTS, plain_unit
from css_telemetry.values import numbers_of

_LOOKED_AT = 5_000  # lines
_NAMES = frozenset(["cell", "sensor", "channel", "name", "variable", "parameter", "mnemonic"])
_VALUES = frozenset(["value", "reading", "raw", "eng", "val"])
_UNKNOWN = "?"


def proposed(path: Path) -> str:
    """A description of the table in a file, as YAML with comments; `?` marks what the user must fill in.

    Raises:
        BagError: the file cannot be read, or nothing in it looks like telemetry.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise BagError(f"{path}: cannot be read: {error.strerror}") from error
    table = open_table(path, content, {"time"})
    long = _long_form(table)
    if long is not None:
        name, value = long
        time = guessed_time(table, _texts(table), table.decimal_comma)
        if time is not None:
            form = TableForm(long_name=name, long_value=value)
            table = open_table(path, content, {name, value}, form, time.form.columns)
    texts = _texts(table)
    time = guessed_time(table, texts, table.decimal_comma)
    if time is None:
        raise BagError(
            f"{path}: line {table.header_line}: no column looks like a time; the header is {listed(table.header)}"
        )
    first = _numbers(table, texts)
    guesses = guessed(table, first, time.form.columns)
    if not guesses.cells:
        raise BagError(
            f"{path}: line {table.header_line}: no column looks like a cell; the header is {listed(table.header)}"
        )
    return "\n".join(_lines(path, table, long, time, guesses, first)) + "\n"


def _long_form(table: Table) -> tuple[str, str] | None:
    plain = {plain_name(name): name for name in table.header}
    name = next((plain[key] for key in plain if key in _NAMES), None)
    value = next((plain[key] for key in plain if key in _VALUES), None)
    return (name, value) if name and value else None


def _texts(table: Table) -> dict[str, list[str]]:
    """The first fields of each column."""
    columns: dict[str, list[str]] = {name: [] for name in table.header}
    for block in table.blocks():
        for name, column in zip(table.header, block.columns, strict=True):
            columns[name] += map(str, column[: _LOOKED_AT - len(columns[name])])
        if len(columns[table.header[0]]) >= _LOOKED_AT:
            break
    return columns


def _numbers(table: Table, texts: dict[str, list[str]]) -> dict[str, np.ndarray]:
    """Numbers of the columns that mostly hold some."""
    numbers = {}
    for name, column in texts.items():
        values, faults = numbers_of(column, name, table.decimal_comma)
        if len(values) and len(faults) <= 0.5 * len(values):
            numbers[name] = values
    return numbers


def _lines(
    path: Path,
    table: Table,
    long: tuple[str, str] | None,
    time: TimeGuess,
    guesses: Guesses,
    first: dict[str, np.ndarray],
) -> Iterator[str]:
    yield f"# Proposed for {path.name}: correct what is wrong, fill in what is marked with {_UNKNOWN}, and keep it."
    read_as = [note for note in table.read_as if not note.startswith("one value")]
    if read_as:
        yield f"# It is read with {', '.join(read_as)}."
    if long is not None:
        yield f"table: {{long: {{name: {_quoted(long[0])}, value: {_quoted(long[1])}}}}}  # one value a line"
    yield from _time_lines(time)
    fills = fill_values(np.concatenate([first[name] for name in guesses.cells if name in first] or [np.zeros(0)]))
    yield from _cell_lines(table, guesses, first, fills)
    if fills:
        yield f"missing: [{', '.join(f'{fill:g}' for fill in fills)}]  # far outside of everything else in the cells"
    yield from _aiding_lines(guesses)
    yield from _truth_lines(guesses)
    used = {*time.form.columns, *guesses.cells, *_used(guesses)}
    unused = [name for name in table.header if name and name not in used]
    if unused:
        yield f"# Not used: {listed(unused)}"


def _used(guesses: Guesses) -> Iterator[str]:
    for guess in (*guesses.vectors.values(), *guesses.temperatures):
        yield from guess.columns
    if guesses.attitude is not None:
        yield from guesses.attitude[0].columns
    if guesses.wheels is not None:
        yield from guesses.wheels.columns
    if guesses.light is not None:
        yield guesses.light[0]


def _time_lines(time: TimeGuess) -> Iterator[str]:
    form = time.form
    columns = f"column: {_quoted(form.columns[0])}" if len(form.columns) == 1 else f"columns: {_list(form.columns)}"
    yield f"time: {{{columns}, unit: {form.unit}, scale: {form.scale}}}  # {time.why}"
    if form.scale == "boot":
        yield "# with `epoch: 2024-03-20T12:00:00Z`, the instant of the boot, dates are those of the flight"


def _cell_lines(
    table: Table, guesses: Guesses, first: dict[str, np.ndarray], fills: tuple[float, ...]
) -> Iterator[str]:
    yield "cells:  # outward normals in the body frame"
    for name, normal in guesses.cells.items():
        if normal is None:
            yield f"  {_quoted(name)}: [{_UNKNOWN}, {_UNKNOWN}, {_UNKNOWN}]  # its name tells no face"
        else:
            yield f"  {_quoted(name)}: [{', '.join(f'{c:g}' for c in normal)}]  # the face in its name"
    yield "field_of_view_deg: 180  # full cone of view: a flat photodiode sees half of the sky"
    units = {plain_unit(table.units[table.header.index(name)]) for name in guesses.cells} & set(OUTPUTS)
    if len(units) == 1:
        yield f"unit: {units.pop()}  # the header says it"
    yield from _scale_lines([first[name] for name in guesses.cells if name in first], fills)


def _scale_lines(columns: list[np.ndarray], fills: tuple[float, ...]) -> Iterator[str]:
    """Full scale and dark level, where readings are not 1 for the Sun met head-on."""
    values = np.concatenate(columns or [np.zeros(0)])
    values = values[np.isfinite(values) & ~np.isin(values, fills)]
    if not len(values) or LEAST_PLAUSIBLE <= float(np.max(values)) <= MOST_PLAUSIBLE:
        return
    largest, dark = float(np.max(values)), float(np.min(values))
    dark = dark if dark > 0.005 * largest else 0.0
    if dark:
        yield f"dark_level: {dark:.6g}  # the smallest reading of the table; measure it if you can"
    yield (
        f"full_scale: {largest - dark:.6g}  # the largest reading above it: too small unless a cell once faced the "
        "Sun; the data sheet knows better"
    )


def _vector(name: str, guess: Guess, with_unit: bool = True) -> str:
    unit = f", unit: {guess.unit}" if with_unit else ""
    return f"  {name}: {{columns: {_list(guess.columns)}{unit}}}  # {guess.why}"


def _aiding_lines(guesses: Guesses) -> Iterator[str]:
    vectors = guesses.vectors
    lines = [_vector(name, vectors[name]) for name in ("rate", "field") if name in vectors]
    if "position" in vectors:
        place, velocity = vectors["position"], vectors.get("velocity")
        frame = "ecef" if any("ecef" in name.lower() or "itrf" in name.lower() for name in place.columns) else "eci"
        if any("teme" in name.lower() for name in place.columns):
            frame = "teme"
        more = "" if velocity is None else f", velocity: {_list(velocity.columns)}, velocity_unit: {velocity.unit}"
        lines.append(
            f"  position: {{frame: {frame}, columns: {_list(place.columns)}, unit: {place.unit}{more}}}  "
            f"# {place.why}; frame by the names"
        )
    if "geodetic" in vectors:
        place = vectors["geodetic"]
        lines.append(
            f"  position: {{frame: geodetic, columns: {_list(place.columns)}, unit: {place.unit}}}  # {place.why}"
        )
    if guesses.wheels is not None:
        lines.append(
            f"  # wheels: {{columns: {_list(guesses.wheels.columns)}, unit: {guesses.wheels.unit}, axes: [{_UNKNOWN}], "
            f"inertia: {_UNKNOWN}}}  # fill in the spin axes in the body frame and take the # away"
        )
    if guesses.temperatures:
        forms = ", ".join(f"{{column: {_quoted(g.columns[0])}, unit: {g.unit}}}" for g in guesses.temperatures)
        lines.append(f"  temperatures: [{forms}]  # {guesses.temperatures[0].why}")
    yield from _section("aiding:  # what the spacecraft knew: estimators hear it", "aiding: {}", lines)


def _truth_lines(guesses: Guesses) -> Iterator[str]:
    vectors = guesses.vectors
    lines = [_vector("sun", vectors["sun"], with_unit=False)] if "sun" in vectors else []
    if guesses.attitude is not None:
        guess, order = guesses.attitude
        lines.append(
            f"  attitude: {{columns: {_list(guess.columns)}, order: {order}, direction: inertial_to_body}}  "
            f"# {guess.why}; the import compares the Sun with the cells: if they contradict, it is body_to_inertial"
        )
    if "rate" in vectors and lines:
        lines.append(_vector("rate", vectors["rate"]) + "; the gyro, as nothing better is there")
    if guesses.light is not None:
        column, kind = guesses.light
        lines.append(f"  {kind}: {{column: {_quoted(column)}}}  # by its name")
    yield from _section("truth:  # what estimates are held against", "truth: {}", lines)


def _section(title: str, empty: str, lines: list[str]) -> Iterator[str]:
    if any(not line.lstrip().startswith("#") for line in lines):
        yield title
        yield from lines
    else:
        yield empty
        yield from lines


def _list(names: tuple[str, ...]) -> str:
    return f"[{', '.join(map(_quoted, names))}]"


def _quoted(name: str) -> str:
    """A name as YAML has it, in quotation marks where it could be something else."""
    return name if name.isidentifier() and name.isascii() else "'" + name.replace("'", "''") + "'"
