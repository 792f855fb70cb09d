# SPDX-License-Identifier: Apache-2.0
"""A page of text, tables and figures, written twice: as HTML for a browser, as Markdown for a terminal or a forge."""

import html
import os
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from css_papers.rows import MISSES, Row


class Listing(NamedTuple):
    """Short texts, one below the other."""

    lines: Sequence[str]


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


Block = str | Listing | Table | Picture | Link
"""What a section holds; a text is a paragraph."""


class Section(NamedTuple):
    """A part of a page."""

    title: str
    blocks: Sequence[Block]


class Part(NamedTuple):
    """Sections of a page, and the rows of its table that come from them."""

    sections: Sequence[Section]
    rows: Sequence[Row]


class Page(NamedTuple):
    """One page."""

    title: str
    lead: str
    sections: Sequence[Section]


_STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #1c2024; background: #fff; max-width: 62rem; margin: 2rem auto;
       padding: 0 1rem; }
h1 { font-size: 1.5rem; line-height: 1.25; } h2 { font-size: 1.15rem; margin-top: 2.2rem; }
figure { margin: 1.2rem 0; } img { max-width: 100%; height: auto; } figcaption { color: #5a5a5a; }
.wide { overflow-x: auto; } table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: .25rem .7rem; text-align: right; border-bottom: 1px solid #e3e6ea; vertical-align: top; }
th:first-child, td:first-child { text-align: left; } th { border-bottom: 2px solid #8c8c8c; }
td.misses { color: #b04a00; font-weight: 600; }
"""
FRONT = "index"
"""Name of the page that a folder opens with."""


def write_page(page: Page, folder: Path, name: str = FRONT) -> list[Path]:
    """Writes both forms into a folder; returns the files.

    Raises:
        OSError: a file cannot be written.
    """
    files = [folder / _html_name(name), folder / _markdown_name(name)]
    for path, text in zip(files, (html_of(page), markdown_of(page)), strict=True):
        # a page that is cut short must not look like one
        temporary = path.with_name(f".{path.name}.new")
        temporary.write_text(text, encoding="utf-8")
        os.replace(temporary, path)
    return files


def _html_name(name: str) -> str:
    return f"{name}.html"


def _markdown_name(name: str) -> str:
    # what forges show below the files of a folder
    return "README.md" if name == FRONT else f"{name}.md"


def html_of(page: Page) -> str:
    """The page as one HTML document without scripts; only its pictures are other files."""
    e = html.escape
    parts = [
        "<!DOCTYPE html>",
        '<html lang="en"><head><meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{e(page.title)}</title><style>{_STYLE}</style></head><body>",
        f"<h1>{e(page.title)}</h1>",
        f"<p>{e(page.lead)}</p>",
    ]
    for section in page.sections:
        parts.append(f"<h2>{e(section.title)}</h2>")
        parts += [_html_block(block) for block in section.blocks]
    return "\n".join([*parts, "</body></html>", ""])


def _html_block(block: Block) -> str:
    e = html.escape
    if isinstance(block, str):
        return f"<p>{e(block)}</p>"
    if isinstance(block, Listing):
        return "<ul>" + "".join(f"<li>{e(line)}</li>" for line in block.lines) + "</ul>"
    if isinstance(block, Link):
        return f'<p><a href="{e(_html_name(block.page))}">{e(block.text)}</a></p>'
    if isinstance(block, Picture):
        image = f'<img src="{e(block.file)}" alt="{e(block.caption)}">'
        return f"<figure>{image}<figcaption>{e(block.caption)}</figcaption></figure>"
    head = "".join(f"<th>{e(text)}</th>" for text in block.heading)
    body = "\n".join("<tr>" + "".join(map(_html_cell, line)) + "</tr>" for line in block.lines)
    return f'<div class="wide"><table><thead><tr>{head}</tr></thead><tbody>\n{body}\n</tbody></table></div>'


def _html_cell(text: str) -> str:
    kind = ' class="misses"' if text.endswith(MISSES) else ""
    return f"<td{kind}>{html.escape(text)}</td>"


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
    texts = [[text.replace("|", "\\|") for text in line] for line in (block.heading, *block.lines)]
    widths = [max(map(len, column)) for column in zip(*texts, strict=True)]
    rule = [("-" * max(width, 2)) + (":" if i else "-") for i, width in enumerate(widths)]

    def drawn(line: Sequence[str]) -> str:
        padded = [text.rjust(width + 1) for text, width in zip(line, widths, strict=True)]
        return "| " + " | ".join([line[0].ljust(widths[0] + 1), *padded[1:]]) + " |"

    return "\n".join([drawn(texts[0]), "| " + " | ".join(rule) + " |", *map(drawn, texts[1:])])
