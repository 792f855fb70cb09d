# SPDX-License-Identifier: Apache-2.0
"""Finds the lines of a table whose times belong together, when clocks were set or damaged.

A step of the clock is judged by what follows it, as a node's edge does with stamps: what goes on from a new time is
the clock that was set, what stands alone is a damaged time.
"""

from bisect import bisect_left
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

LONGEST_NS = 320_000_000 * 10**9
"""Longest time that a recording may cover: a mission's longest duration, ten years [ns]."""

CONFIRMED_BY = 3
"""Lines that must go on from a time far ahead for it to be believed."""

FAR_NS = 86_400 * 10**9
"""A step of the clock [ns] that must be confirmed, when it is also a thousand times the usual one."""

_TIMES_THE_USUAL = 1000.0
_BACKWARD = 9  # of ten steps: of lines in no order half go backward


def consistent_lines(stamps_ns: Sequence[int] | np.ndarray) -> np.ndarray:
    """Indices of the largest set of times that grow from line to line, without those that stand alone far off.

    A clock that was set back costs the shorter of the two stretches, a damaged time itself alone. Of a time that
    stands twice the first is kept.
    """
    stamps = np.asarray(stamps_ns, np.int64)
    if len(stamps) == 0:
        return np.zeros(0, np.int64)
    order = stamps if np.all(np.diff(stamps) > 0) else np.sort(stamps)
    first, last = _fullest_window(order)
    inside = np.flatnonzero((stamps >= first) & (stamps <= last))
    if np.any(np.diff(stamps[inside]) <= 0):
        inside = _longest_growth(stamps.tolist(), inside.tolist())
    return _without_strays(stamps, inside)


def newest_first(stamps_ns: Sequence[int] | np.ndarray) -> bool:
    """Whether the times of a table go backward from line to line, but for a few that a clock was set by."""
    steps = np.diff(np.asarray(stamps_ns, np.int64))
    backward, forward = int(np.count_nonzero(steps < 0)), int(np.count_nonzero(steps > 0))
    return backward > _BACKWARD * forward and backward >= CONFIRMED_BY


def _fullest_window(stamps: np.ndarray) -> tuple[int, int]:
    """The earliest span of at most `LONGEST_NS` that holds the most of the sorted times."""
    held = np.searchsorted(stamps, stamps + LONGEST_NS, side="right") - np.arange(len(stamps))
    best = int(np.argmax(held))
    return int(stamps[best]), int(stamps[best + int(held[best]) - 1])


def _longest_growth(stamps: Sequence[int], indices: Sequence[int]) -> np.ndarray:
    """Longest strictly growing subsequence by patience sorting, from the end: among equals the first line wins."""
    tops: list[int] = []  # negated last times of the longest chains of each length
    heads: list[int] = []  # where those begin
    following: dict[int, int] = {}
    for index in reversed(indices):
        key = -stamps[index]
        length = bisect_left(tops, key)
        if length:
            following[index] = heads[length - 1]
        tops[length : length + 1] = [key]
        heads[length : length + 1] = [index]
    chain = [heads[-1]] if heads else []
    while chain and chain[-1] in following:
        chain.append(following[chain[-1]])
    return np.array(chain, np.int64)


def _without_strays(stamps: np.ndarray, kept: np.ndarray) -> np.ndarray:
    """Leaves out stretches of fewer than `CONFIRMED_BY` lines that are far from what is before and after them."""
    if len(kept) < 2 * CONFIRMED_BY:
        return kept
    steps = np.diff(stamps[kept])
    far = max(float(FAR_NS), _TIMES_THE_USUAL * float(np.median(steps)))
    ends = np.concatenate(([0], np.flatnonzero(steps > far) + 1, [len(kept)]))
    parts = list(pairwise(ends.tolist()))
    believed = [kept[first:end] for first, end in parts if end - first >= CONFIRMED_BY]
    return np.concatenate(believed) if believed else kept
