# SPDX-License-Identifier: Apache-2.0
"""What people write for a number, several, or none, with units in the question: read, and shown again."""

import math
from collections.abc import Callable
from typing import Any

from css_design.errors import DesignError
from css_design.new_mission.directions import Vector, direction

NONE = "none"
"""Word for what a spacecraft does not have."""

Parser = Callable[[str], Any]


def number(low: float, high: float) -> Parser:
    """Reads a number within limits."""

    def parse(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not low <= value <= high:
            raise DesignError(f"{text!r} given, expected a number from {low:g} to {high:g}")
        return value

    return parse


def optional(parse: Parser) -> Parser:
    """Reads the same, or `none`."""
    return lambda text: None if text.strip() == NONE else parse(text)


def numbers(counts: tuple[int, ...], low: float, high: float) -> Parser:
    """Reads several numbers with commas between them, as many as one of `counts`."""
    single = number(low, high)

    def parse(text: str) -> tuple[float, ...]:
        parts = [part.strip() for part in text.strip(" []").split(",")]
        if len(parts) not in counts:
            raise DesignError(f"{text!r} given, expected {' or '.join(map(str, counts))} numbers with commas between")
        return tuple(single(part) for part in parts)

    return parse


def directions(text: str) -> tuple[Vector, ...]:
    """Reads directions with commas between them; `all` is all six faces."""
    if text.strip() == "all":
        text = "+x,-x,+y,-y,+z,-z"
    words = text.split(",")
    from css_sensors.cells import MOST_CELLS  # it loads what compiles, which help does without

    if len(words) > MOST_CELLS:
        raise DesignError(f"{len(words)} directions given, expected 1 to {MOST_CELLS}")
    return tuple(direction(word) for word in words)


def word(*choices: str) -> Parser:
    """Reads one of some words."""

    def parse(text: str) -> str:
        if text.strip() not in choices:
            raise DesignError(f"{text!r} given, expected one of {', '.join(choices)}")
        return text.strip()

    return parse


def plain(text: str) -> str:
    """Any text."""
    return text.strip()
