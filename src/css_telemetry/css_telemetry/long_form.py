# SPDX-License-Identifier: Apache-2.0
"""Tables with one value a line: what stands in a line is named by a column, and lines of one time belong together."""

from collections.abc import Iterator, Sequence

import numpy as np

from css_recording.errors import BagError
from css_telemetry.description import TableForm
from css_telemetry.faults import Broken
from css_telemetry.table_text import Block, Table, listed
from css_telemetry.values import Column

_BLOCK = 20_000


def pivoted(table: Table, form: TableForm, times: tuple[str, ...]) -> Table:
    """The table with one column for each name that occurs, and one line for each time.

    A line that repeats the name of another of its time is broken; the number of a line is that of the first of its
    time.

    Args:
        table: as it stands.
        form: which columns hold names and values.
        times: columns of the time.

    Raises:
        BagError: a column is missing.
    """
    for name in (*times, form.long_name, form.long_value):
        if name not in table.header:
            raise BagError(
                f"{table.path}: line {table.header_line}: no column {name}; the header is {listed(table.header)}"
            )
    at = [table.header.index(name) for name in (*times, form.long_name, form.long_value)]
    names: dict[str, int] = {}
    for block in table.blocks():
        for name in _texts(block.columns[at[-2]]):
            names.setdefault(name, len(names))
    names.pop("", None)

    def blocks() -> Iterator[Block]:
        yield from _blocks(table, at, list(names))

    return Table(
        table.path,
        (*times, *names),
        table.header_line,
        tuple(table.units[index] for index in at[:-2]) + (table.units[at[-1]],) * len(names),
        table.decimal_comma,
        (*table.read_as, f"one value a line, named by {form.long_name}"),
        blocks,
    )


def _texts(column: Column) -> Sequence[str]:
    return column if not isinstance(column, np.ndarray) else [str(value) for value in column.tolist()]


def _blocks(table: Table, at: list[int], names: list[str]) -> Iterator[Block]:
    """Lines of one time put together; times that are apart in the table stay apart."""
    place = {name: index for index, name in enumerate(names)}
    lines: list[int] = []
    keys: list[tuple[str, ...]] = []
    rows: list[list[str]] = []
    broken: list[tuple[int, Broken]] = []
    for block in table.blocks():
        broken += block.broken
        *times, labels, values = (_texts(block.columns[index]) for index in at)
        for k, number in enumerate(block.lines.tolist()):
            key = tuple(column[k] for column in times)
            index = place.get(labels[k])
            if index is None:
                broken.append((number, Broken("no name", "a value without a name")))
                continue
            if not keys or keys[-1] != key:
                if len(rows) >= _BLOCK:
                    yield _block(lines, keys, rows, broken, len(names))
                    lines, keys, rows, broken = [], [], [], []
                lines.append(number)
                keys.append(key)
                rows.append([""] * len(names))
            if rows[-1][index]:
                broken.append((number, Broken("stands twice", f"{labels[k]} stands twice at {' '.join(key)}")))
            else:
                rows[-1][index] = values[k]
    if rows or broken:
        yield _block(lines, keys, rows, broken, len(names))


def _block(
    lines: list[int], keys: list[tuple[str, ...]], rows: list[list[str]], broken: list[tuple[int, Broken]], width: int
) -> Block:
    columns: list[Column] = [list(column) for column in zip(*keys, strict=True)]
    columns += [list(column) for column in zip(*rows, strict=True)] if rows else [[]] * width
    return Block(np.array(lines, np.int64), columns, broken)
