# SPDX-License-Identifier: Apache-2.0
"""Finds the lines of a table whose times belong together, when clocks were set or damaged."""

from bisect import bisect_left
from collections.abc import Sequence

LONGEST_NS = 32_000_000 * 10**9
"""Longest time that a recording may cover: a mission's longest duration, a little above a year [ns]."""


def consistent_lines(stamps_ns: Sequence[int]) -> list[int]:
    """Indices of the largest set of times that grow from line to line, within `LONGEST_NS`.

    A clock that was set back costs the shorter of the two stretches, a damaged time itself alone. Of a time that
    stands twice the first is kept.
    """
    first, last = _fullest_window(sorted(stamps_ns))
    inside = [index for index, stamp in enumerate(stamps_ns) if first <= stamp <= last]
    return _longest_growth(stamps_ns, inside)


def _fullest_window(stamps: list[int]) -> tuple[int, int]:
    """The earliest span of at most `LONGEST_NS` that holds the most of the sorted times."""
    best = most = start = 0
    for end, stamp in enumerate(stamps):
        while stamp - stamps[start] > LONGEST_NS:
            start += 1
        if end - start + 1 > most:
            best, most = start, end - start + 1
    return (stamps[best], stamps[best + most - 1]) if stamps else (0, 0)


def _longest_growth(stamps: Sequence[int], indices: list[int]) -> list[int]:
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
    return chain
