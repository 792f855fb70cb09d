# SPDX-License-Identifier: Apache-2.0
"""A page of text, tables and figures, written twice: as HTML for a browser, as Markdown for a terminal or a forge.

In HTML the figures that were drawn inside `keep_figures` can be zoomed; others are the pictures beside the page.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from css_analysis.figure_style import kept_figure
from css_common.whole_files import write_whole
from css_papers.rows import Row
from css_report.blocks import Block, Commands, Link, Listing, Page, Picture, Section, Table
from css_report.drawn_figures import plots_of
from css_report.html_page import anchor, html_of

__all__ = ["Block", "Link", "Listing", "Page", "Part", "Picture", "Section", "Table", "markdown_of", "write_page"]


class Part(NamedTuple):
    """Sections of a page, and the rows of its table that come from them."""

    sections: Sequence[Section]
    rows: Sequence[Row]


FRONT = "index"
"""Name of the page that a folder opens with."""


def write_page(page: Page, folder: Path, name: str = FRONT) -> list[Path]:
    """Writes both forms into a folder; returns the files.

    Raises:
        OSError: a file cannot be written.
    """
    files = [folder / f"{name}.html", folder / _markdown_name(name)]
    sections = [Section(s.title, [b for block in s.blocks for b in _drawn(block, folder)]) for s in page.sections]
    for path, text in zip(files, (html_of(page._replace(sections=sections)), markdown_of(page)), strict=True):
        write_whole(path, text)
    return files


def _drawn(block: Block, folder: Path) -> Iterator[Block]:
    """A picture as plots, if its figure was kept and all of it has a counterpart there."""
    figure = kept_figure(folder / block.file) if isinstance(block, Picture) else None
    plots = None if figure is None else plots_of(figure, anchor(Path(block.file).stem))  # type: ignore[union-attr]
    if plots is None or not isinstance(block, Picture):
        yield block
        return
    yield block.caption
    yield from plots


def _markdown_name(name: str) -> str:
    # what forges show below the files of a folder
    return "README.md" if name == FRONT else f"{name}.md"


def markdown_of(page: Page) -> str:
    """The page as Markdown with tables as forges know them."""
    parts = [f"# {page.title}", page.lead]
    for section in page.sections:
        parts.append(f"## {section.title}")
        parts += [_markdown_block(block) for block in section.blocks]
    return "\n\n".join(parts) + "\n"


def _markdown_block(block: Block) -> str:
    if isinstance(block, str):
        return block
    if isinstance(block, Listing):
        return "\n".join(f"- {line}" for line in block.lines)
    if isinstance(block, Link):
        return f"[{block.text}]({_markdown_name(block.page)})"
    if isinstance(block, Picture):
        return f"![{block.caption}]({block.file})\n\n*{block.caption}*"
    if isinstance(block, Commands):
        return "\n\n".join(f"{what}\n\n    {command}" for what, command in block.lines)
    if not isinstance(block, Table):
        raise TypeError(f"{type(block).__name__} has no form in Markdown")
    texts = [[text.replace("|", "\\|") for text in line] for line in (block.heading, *block.lines)]
    widths = [max(map(len, column)) for column in zip(*texts, strict=True)]
    rule = [("-" * max(width, 2)) + (":" if i else "-") for i, width in enumerate(widths)]

    def drawn(line: Sequence[str]) -> str:
        padded = [text.rjust(width + 1) for text, width in zip(line, widths, strict=True)]
        return "| " + " | ".join([line[0].ljust(widths[0] + 1), *padded[1:]]) + " |"

    return "\n".join([drawn(texts[0]), "| " + " | ".join(rule) + " |", *map(drawn, texts[1:])])
