# SPDX-License-Identifier: Apache-2.0
"""What was wrong with a table, counted by kind, each with the first line where it was seen."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np


class Broken(Exception):
    """A value or a line of a table that cannot be used: kind of fault for counting, and the whole story."""

    def __init__(self, kind: str, detail: str) -> None:
        super().__init__(detail)
        self.kind = kind


class Counted(NamedTuple):
    """Faults of one kind."""

    times: int
    first_line: int
    detail: str  # of the first one


@dataclass
class Account:
    """What became of the lines of a table.

    Attributes:
        lines: of telemetry in the table.
        refused: lines that are lost, by what is wrong with them.
        repaired: values that are lost in lines that are used, by what is wrong with them.
        missing: values that the table says it does not have, by what they are.
        fills: numbers that were taken for missing values.
    """

    lines: int = 0
    refused: dict[str, Counted] = field(default_factory=dict)
    repaired: dict[str, Counted] = field(default_factory=dict)
    missing: dict[str, Counted] = field(default_factory=dict)
    fills: dict[float, Counted] = field(default_factory=dict)

    def refuse(self, line: int, fault: Broken) -> None:
        """Counts a line that is lost."""
        add(self.refused, fault.kind, 1, line, str(fault))

    def repair(self, line: int, fault: Broken) -> None:
        """Counts a value that is lost."""
        add(self.repaired, fault.kind, 1, line, str(fault))

    @property
    def refused_lines(self) -> int:
        """Lines that are lost."""
        return sum(found.times for found in self.refused.values())

    @property
    def repaired_values(self) -> int:
        """Values that are lost in lines that are used."""
        return sum(found.times for found in self.repaired.values())

    def note_missing(self, what: str, lines: np.ndarray, missing: np.ndarray) -> None:
        """Counts missing values: the numbers (N,) of the lines, and how many are missing in each (N,)."""
        at = np.flatnonzero(missing)
        if len(at):
            add(self.missing, what, int(np.sum(missing)), int(np.min(lines[at])), "")


def add(counts: dict, key: object, count: int, line: int, detail: str) -> None:
    """Counts some more of a kind."""
    known = counts.get(key)
    if known is None:
        counts[key] = Counted(count, line, detail)
        return
    earlier = line < known.first_line
    counts[key] = Counted(known.times + count, min(line, known.first_line), detail if earlier else known.detail)


def counted_objects(counts: dict[str, Counted], name: str = "kind") -> list[dict[str, object]]:
    """Counts as `--json` prints them."""
    return [{name: key, "count": found.times, "first_line": found.first_line} for key, found in counts.items()]


def first_of(faults: Iterable[Counted]) -> Counted | None:
    """The fault that stands first in the table."""
    return min(faults, key=lambda found: found.first_line, default=None)
