# SPDX-License-Identifier: Apache-2.0
"""How far a study is, for people who wait for it."""

from typing import Protocol, Self

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from css_common.progress_lines import ProgressLines


class CaseProgress(Protocol):
    """What shows progress: parts with names, each with cases of which some are done."""

    def __enter__(self) -> Self: ...

    def __exit__(self, *_: object) -> None: ...

    def add(self, name: str) -> int:
        """Begins a part; gives its number."""

    def tell(self, part: int, done: int, total: int) -> None:
        """How far a part is."""


def progress_bar(console: Console) -> CaseProgress:
    """Bar of cases with the time left; where the console is no terminal, a line of the log now and then."""
    return _Bar(console) if console.is_terminal else _Lines()


class _Bar:
    def __init__(self, console: Console) -> None:
        self._bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("cases"),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            console=console,
        )

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    def add(self, name: str) -> int:
        return self._bar.add_task(name, total=None)

    def tell(self, part: int, done: int, total: int) -> None:
        self._bar.update(TaskID(part), completed=done, total=total)


class _Lines:
    def __init__(self) -> None:
        self._parts: list[ProgressLines] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def add(self, name: str) -> int:
        self._parts.append(ProgressLines(name, "cases"))
        return len(self._parts) - 1

    def tell(self, part: int, done: int, total: int) -> None:
        self._parts[part].tell(done, total)
