# SPDX-License-Identifier: Apache-2.0
"""What a page is made of."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

MISSES = "(misses)"
"""Ends a text in a table that is not what it must be."""


class Listing(NamedTuple):
    """Short texts, one below the other."""

    lines: Sequence[str]


class Commands(NamedTuple):
    """Commands to be copied into a terminal, each below what it does."""

    lines: Sequence[tuple[str, str]]  # what it does, and the command


class Table(NamedTuple):
    """Texts in columns; the first column stands left, the others right."""

    heading: Sequence[str]
    lines: Sequence[Sequence[str]]


class Picture(NamedTuple):
    """A file beside the page."""

    file: str
    caption: str


class Link(NamedTuple):
    """A way to another page of the same folder."""

    page: str  # its name
    text: str


@dataclass(frozen=True)
class Plot:
    """One set of axes that can be zoomed.

    Attributes:
        key: names it on its page.
        title: what is shown.
        traces: as plotly takes them; `name` and `meta` make the legend.
        x, y: plotly's axes, the labels apart.
        x_label, y_label: with units.
        linked: plots of the same word show the same stretch of the abscissa; empty: on its own.
        shapes: of plotly's layout, such as shaded stretches.
        legend: further entries: label and what the sample shows.
        caption: what is to be known to read it.
        height: [px].
        narrow: stands beside others where the page is wide enough.
    """

    key: str
    title: str
    traces: Sequence[Mapping[str, Any]]
    x_label: str = ""
    y_label: str = ""
    x: Mapping[str, Any] = field(default_factory=dict)
    y: Mapping[str, Any] = field(default_factory=dict)
    linked: str = ""
    shapes: Sequence[Mapping[str, Any]] = ()
    legend: Sequence[tuple[str, Mapping[str, Any]]] = ()
    caption: str = ""
    height: int = 260
    narrow: bool = False


class Beside(NamedTuple):
    """Blocks of two flights or studies, side by side where the page is wide enough."""

    names: tuple[str, str]
    columns: tuple[Sequence["Block"], Sequence["Block"]]


Block = str | Listing | Commands | Table | Picture | Link | Plot | Beside
"""What a section holds; a text is a paragraph."""


class Section(NamedTuple):
    """A part of a page."""

    title: str
    blocks: Sequence[Block]


class Page(NamedTuple):
    """One page."""

    title: str
    lead: str
    sections: Sequence[Section]
