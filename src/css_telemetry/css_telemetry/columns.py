# SPDX-License-Identifier: Apache-2.0
"""Reads the columns that a description names, as numbers and stamps, and counts what is wrong with them."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from css_recording.errors import BagError
from css_telemetry.clock import consistent_lines, newest_first
from css_telemetry.description import Description, PositionForm
from css_telemetry.faults import Account, Broken, add
from css_telemetry.header import column_of, long_form
from css_telemetry.instants import stamps_of
from css_telemetry.sentinels import fill_values
from css_telemetry.table_text import Block, Table, listed
from css_telemetry.values import numbers_of


@dataclass
class Readings:
    """Numbers as they stand in a table, NaN where they are missing.

    Attributes:
        stamps_ns: (N,) growing.
        lines: (N,) numbers of the lines.
        values: (N,) of each column that was asked for.
        ignored: columns that nobody asked for.
        account: what became of the lines.
        newest_first: they stood in the table the other way round.
    """

    stamps_ns: np.ndarray
    lines: np.ndarray
    values: dict[str, np.ndarray]
    ignored: tuple[str, ...]
    account: Account
    newest_first: bool = False

    def matrix(self, columns: Iterable[str]) -> np.ndarray:
        """(N, M) values of some columns."""
        return np.stack([self.values[name] for name in columns], axis=1)


class Group(NamedTuple):
    """Columns of one kind, whose missing values are the same numbers."""

    what: str
    columns: tuple[str, ...]


def groups_of(description: Description) -> list[Group]:
    """All columns with numbers that a description names, kind by kind."""
    groups = [Group("cell outputs", tuple(cell.column for cell in description.cells))]
    aiding, truth = description.aiding, description.truth
    temperatures = [cell.thermal.column for cell in description.cells if cell.thermal is not None]
    if aiding is not None:
        groups += [
            Group(what, form.columns)
            for what, form in (("rates", aiding.rate), ("field", aiding.field), ("wheel speeds", aiding.wheels))
            if form is not None
        ]
        groups += _position_groups("position", aiding.position)
        temperatures += [form.column for form in aiding.temperatures]
        if aiding.illumination is not None:
            groups.append(Group("flag of sunlight", (aiding.illumination.column,)))
    if truth is not None:
        groups += [
            Group(what, form.columns)
            for what, form in (("true Sun", truth.sun), ("true rates", truth.rate), ("attitude", truth.attitude))
            if form is not None
        ]
        groups += _position_groups("true position", truth.position)
        if truth.illumination is not None:
            groups.append(Group("eclipse" if truth.eclipse else "illumination", (truth.illumination.column,)))
    groups += [Group("temperature", (column,)) for column in dict.fromkeys(temperatures)]
    return groups


def _position_groups(what: str, form: PositionForm | None) -> list[Group]:
    if form is None or not form.columns:
        return []
    return [Group(what, form.columns)] + ([Group("velocity", form.velocity)] if form.velocity else [])


def read_columns(table: Table, description: Description) -> Readings:
    """Reads a table.

    Args:
        table: the table.
        description: whose time is known.

    Raises:
        BagError: a column is missing, or no line of the table can be used.
    """
    assert description.time is not None
    groups = groups_of(description)
    names = tuple(dict.fromkeys(name for group in groups for name in group.columns))
    try:
        at = {name: _found(table, name) for name in (*description.time.columns, *names)}
    except ValueError as error:
        known = {cell.column for cell in description.cells}
        raise BagError(f"{table.path}: line {table.header_line}: {error}{long_form(table, known)}") from error
    account = Account()
    parts = [_read(block, at, description, names, table, account) for block in table.blocks()]
    stamps = np.concatenate([np.zeros(0, np.int64), *(part.stamps_ns for part in parts)])
    lines = np.concatenate([np.zeros(0, np.int64), *(part.lines for part in parts)])
    values = {name: np.concatenate([np.zeros(0), *(part.values[name] for part in parts)]) for name in names}
    backward = newest_first(stamps)
    if backward:
        stamps, lines = stamps[::-1], lines[::-1]
        values = {name: column[::-1] for name, column in values.items()}
    kept = _in_order(stamps, lines, account)
    if not len(kept):
        raise _nothing(table, account)
    used = set(at.values())
    ignored = tuple(name for index, name in enumerate(table.header) if index not in used and name)
    values = {name: column[kept] for name, column in values.items()}
    readings = Readings(stamps[kept], lines[kept], values, ignored, account, backward)
    for group in groups:
        _mask_fills(readings, group, description.missing)
    return readings


def _found(table: Table, name: str) -> int:
    index = column_of(table, name)
    if index is None:
        raise ValueError(f"no column {name}, which the description names; the header is {listed(table.header)}")
    return index


class _Part(NamedTuple):
    stamps_ns: np.ndarray
    lines: np.ndarray
    values: dict[str, np.ndarray]


def _read(
    block: Block, at: dict[str, int], description: Description, names: tuple[str, ...], table: Table, account: Account
) -> _Part:
    time = description.time
    assert time is not None
    account.lines += block.size
    for number, fault in block.broken:
        account.refuse(number, fault)
    stamps, faults = stamps_of([block.columns[at[name]] for name in time.columns], time, table.decimal_comma)
    timeless = {index for index, _ in faults}
    for index, fault in faults:
        account.refuse(int(block.lines[index]), fault)
    good = np.flatnonzero(stamps > 0)
    values = {}
    for name in names:
        column, wrong = numbers_of(block.columns[at[name]], name, table.decimal_comma)
        for index, fault in wrong:
            if index not in timeless:
                account.repair(int(block.lines[index]), fault)
        values[name] = column[good]
    return _Part(stamps[good], block.lines[good], values)


def _in_order(stamps: np.ndarray, lines: np.ndarray, account: Account) -> np.ndarray:
    """Lines whose times go forward together; the others are refused."""
    kept = consistent_lines(stamps)
    lost = np.setdiff1d(np.arange(len(stamps)), kept, assume_unique=True)
    others = f"the {len(kept)} lines that do" if len(kept) > 1 else "the only line that is kept"
    for index in lost.tolist():
        fault = Broken("time does not go forward", f"column time: it does not go forward with {others}")
        account.refuse(int(lines[index]), fault)
    return kept


def _nothing(table: Table, account: Account) -> BagError:
    first = min(account.refused.values(), key=lambda found: found.first_line, default=None)
    if first is None:
        return BagError(f"{table.path}: no line of telemetry found below the header")
    broken = account.refused_lines
    return BagError(
        f"{table.path}: line {first.first_line}: {first.detail} (none of {broken} lines can be used)"
        if broken > 1
        else f"{table.path}: line {first.first_line}: {first.detail}"
    )


def _mask_fills(readings: Readings, group: Group, stated: tuple[float, ...] | None) -> None:
    """Puts NaN in the place of numbers that stand for missing values, and counts what is missing."""
    values = readings.matrix(group.columns)
    fills = fill_values(values) if stated is None else stated
    for fill in fills:
        found = values == fill
        if np.any(found):
            count, first = int(np.sum(found)), int(readings.lines[np.flatnonzero(np.any(found, axis=1))[0]])
            add(readings.account.fills, fill, count, first, group.what)
            values[found] = np.nan
    for index, name in enumerate(group.columns):
        readings.values[name] = values[:, index]
