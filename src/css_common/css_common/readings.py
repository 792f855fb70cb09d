# SPDX-License-Identifier: Apache-2.0
"""Readings of several sensors in one message, of which some may be missing.

A missing reading is NaN from the edge of a node on: what a sender has left out, and what no sensor of the kind can
give, as sentinels such as -9999 or 65535. Algorithms take NaN for unknown: not lit, no measurement.
"""

import math
from collections import Counter
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from css_common.kernel import kernel, typed_call


class Readings(NamedTuple):
    """What the elements of an array field may be."""

    smallest: float
    largest: float


@kernel
def all_readable(values, smallest: float, largest: float) -> bool:
    """Whether each of (N,) values is a reading."""
    count = 0
    for value in values:
        # a NaN compares false
        count += smallest <= value <= largest
    return count == values.shape[0]


@kernel
def clear_unreadable(values, smallest: float, largest: float) -> tuple[int, int, int]:
    """Makes NaN of each of (N,) values that is no reading.

    Returns:
        how many were NaN, how many were not and are now, index of the first of these; -1: none.
    """
    missing, impossible, first = 0, 0, -1
    for i in range(values.shape[0]):
        if values[i] != values[i]:
            missing += 1
        elif not smallest <= values[i] <= largest:
            impossible += 1
            if first < 0:
                first = i
            values[i] = math.nan
    return missing, impossible, first


class ReadingCheck:
    """Looks after one array field of an input.

    Attributes:
        counts: elements taken for `missing` (NaN was given) and `impossible` (no sensor gives that).
    """

    def __init__(self, topic: str, name: str, readings: Readings, report: Callable[[str], None]) -> None:
        """Prepares the check.

        Args:
            topic: of the input, for reports.
            name: of the field.
            readings: what its elements may be.
            report: called with one line at the first element of each kind.
        """
        self.name = name
        self.counts: Counter[str] = Counter()
        self._topic = topic
        self._report = report
        self._all_readable = typed_call(all_readable)
        self._smallest, self._largest = readings

    def is_whole(self, values: np.ndarray) -> bool:
        """Every element is a reading."""
        return self._all_readable(values, self._smallest, self._largest)

    def are_whole(self, rows: np.ndarray) -> bool:
        """Every element of rows (M, N) is a reading."""
        return bool(np.all((rows >= self._smallest) & (rows <= self._largest)))

    def refusal(self, values: np.ndarray) -> str | None:
        """Why an array that is not whole cannot be used at all; None when the elements that are readings can."""
        smallest, largest = self._smallest, self._largest
        if np.any(np.isinf(values)):
            return f"{self.name} holds infinity"
        if not np.any((values >= smallest) & (values <= largest)):
            return f"{self.name} holds no reading, all are NaN or outside {smallest:g} to {largest:g}"
        return None

    def clear(self, values: np.ndarray) -> None:
        """Makes NaN of the elements that are no readings."""
        smallest, largest = self._smallest, self._largest
        given = values.tolist()
        missing, impossible, first = clear_unreadable(values, smallest, largest)
        if missing:
            at = next(i for i, value in enumerate(given) if value != value)
            self._count("missing", missing, f"{self.name}[{at}] is not given")
        if impossible:
            reason = f"{self.name}[{first}] is {given[first]:g}, expected {smallest:g} to {largest:g}"
            self._count("impossible", impossible, reason)

    def _count(self, kind: str, count: int, reason: str) -> None:
        if not self.counts[kind]:
            self._report(f"{self._topic}: {reason}: it counts as missing (further ones are counted, not reported)")
        self.counts[kind] += count
