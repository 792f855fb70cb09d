# SPDX-License-Identifier: Apache-2.0
"""Tables for a console of any width, in which no number is ever cut."""

import re
from collections.abc import Sequence
from typing import Any

from rich import box
from rich.console import Console, ConsoleOptions, RenderResult
from rich.table import Table
from rich.text import Text

_LEAST_NAME = 12
_UNBOUNDED = 10_000


class ReadableTable(Table):
    """A table with names on the left and numbers on the right.

    Where the console is narrow the names are folded; where it is too narrow for the numbers, each row becomes a block
    of lines, one for each number.
    """

    def __init__(self, title: str | None = None) -> None:
        """An empty table.

        Args:
            title: printed above it.
        """
        super().__init__(title=title, title_justify="left", box=box.SIMPLE_HEAD, padding=0)

    def add_name(self, heading: str = "") -> None:
        """Adds a column of words, which may be folded."""
        self.add_column(Text(heading), vertical="bottom", overflow="fold")

    def add_number(self, heading: str) -> None:
        """Adds a column of numbers, or of words that are as short."""
        # as Text, because markup would take a unit for a style
        self.add_column(Text(heading), justify="right", vertical="bottom", no_wrap=True)

    def add_texts(self, texts: Sequence[str | Text]) -> None:
        """Adds a row, without markup."""
        self.add_row(*(Text(text) if isinstance(text, str) else text for text in texts))

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Renders the table, or its rows one by one."""
        if self._least_width(console, options) <= options.max_width:
            yield from super().__rich_console__(console, options)
        else:
            yield from self._blocks()

    def _least_width(self, console: Console, options: ConsoleOptions) -> int:
        least = super().__rich_measure__(console, options.update(max_width=_UNBOUNDED)).minimum
        for column in self.columns:
            if not column.no_wrap:
                longest = max(console.measure(cell).minimum for cell in (column.header, *column.cells))
                least -= max(0, longest - _LEAST_NAME)
        return least

    def _blocks(self) -> list[Any]:
        headings = [_on_one_line(column.header) for column in self.columns]
        lines: list[Any] = [Text(str(self.title))] if self.title else []
        for cells in zip(*(column.cells for column in self.columns), strict=True):
            lines.append(Text(""))
            for heading, cell in zip(headings, cells, strict=True):
                value = cell if isinstance(cell, Text) else Text(str(cell))
                if value.plain:
                    line = Text(f"{heading}: " if heading else "", overflow="fold")
                    lines.append(line.append_text(value))
        lines.append(Text(""))
        return lines


def _on_one_line(heading: Any) -> str:
    """A heading that was broken to be narrow."""
    return " ".join(re.sub(r"(-|(?<=[._]))\n", "", str(heading)).split())
