# SPDX-License-Identifier: Apache-2.0
"""How lines look, so that they are told apart without colour too: each has a dash and a marker of its own."""

from typing import NamedTuple

from css_analysis.palette import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILION

_COLOURS = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY)
_DASHES = ("solid", "dash", "dot", "dashdot", "longdash")
_MARKERS = ("circle", "square", "diamond", "triangle-up", "cross", "x", "star")


class Look(NamedTuple):
    """Of one line."""

    colour: str
    dash: str = "solid"
    marker: str = ""  # empty: none

    def beside(self) -> "Look":
        """The look of a second line of the same thing: dotted, with the same marker hollow."""
        return Look(self.colour, "dot", f"{self.marker}-open" if self.marker else "")

    def dashed(self, dash: str) -> "Look":
        """The same colour, without markers and with another dash."""
        return Look(self.colour, dash)


OUTLINES = ("solid", "dash", "dot", "dashdot", "longdash", "longdashdot", "1px,5px", "9px,2px,2px,2px,2px,2px")
"""Dashes of outlines, which have no markers."""
TRUE = Look(BLACK)
"""Of what is true."""
LEVEL = Look(GREY, "dash")
"""Of a level that means something."""


def look(number: int) -> Look:
    """The look of the line of a number; 210 of them differ."""
    return Look(_COLOURS[number % len(_COLOURS)], _DASHES[number % len(_DASHES)], _MARKERS[number % len(_MARKERS)])
