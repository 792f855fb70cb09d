# SPDX-License-Identifier: Apache-2.0
"""A page as one HTML file: style, script and data are in it, so that it opens in a browser without a network."""

import base64
import html
import mimetypes
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache
from importlib.resources import files
from itertools import groupby
from pathlib import Path
from typing import Any

from css_report.blocks import MISSES, Beside, Block, Commands, Link, Listing, Page, Picture, Plot, Table
from css_report.embedded import embedded_json
from css_report.swatches import swatch_of, swatch_of_trace

_MANY = 3  # columns from which a table becomes blocks of lines on a phone
_LONG = 28  # letters from which a text in a table may be broken anywhere


def html_of(page: Page, folder: Path | None = None) -> str:
    """The page; the same page gives the same text.

    Args:
        page: what to show.
        folder: where the files of its pictures are, which are put into it; None: they stay beside it.
    """
    return "".join(_Writer(folder).parts(page))


def anchor(title: str) -> str:
    """Name of a section in the address of a page."""
    return re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-") or "section"


@cache
def _data(name: str) -> str:
    return (files("css_report") / "data" / name).read_text(encoding="utf-8")


@cache
def _plotly() -> str:
    # a script ends at the first end tag, wherever it stands
    text = (files("plotly") / "package_data" / "plotly.min.js").read_text(encoding="utf-8")
    return re.sub(r"</(script)", r"<\\/\1", text, flags=re.IGNORECASE)


class _Writer:
    """Writes one page; knows which names of plots are taken."""

    def __init__(self, folder: Path | None) -> None:
        self.folder = folder
        self.taken: set[str] = set()

    def parts(self, page: Page) -> Iterator[str]:
        e = html.escape
        body = [self.section(section.title, section.blocks) for section in page.sections]
        yield '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">\n'
        yield '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        yield '<link rel="icon" href="data:,">\n'
        yield f"<title>{e(page.title)}</title>\n<style>\n{_data('page.css')}</style></head>\n<body>\n<header>"
        yield f"<h1>{e(page.title)}</h1>\n<p>{e(page.lead)}</p>\n"
        yield '<p class="themes"><button type="button" data-do="theme">light or dark</button></p>\n<nav>'
        yield " ".join(f'<a href="#{anchor(s.title)}">{e(s.title)}</a>' for s in page.sections)
        yield "</nav></header>\n<main>\n"
        yield from body
        yield "</main>\n"
        if self.taken:
            yield f"<script>{_plotly()}</script>\n"
        yield f"<script>\n{_data('page.js')}</script>\n</body></html>\n"

    def section(self, title: str, blocks: Sequence[Block]) -> str:
        return f'<section id="{anchor(title)}"><h2>{html.escape(title)}</h2>\n{self.blocks(blocks)}</section>\n'

    def blocks(self, blocks: Iterable[Block]) -> str:
        parts = []
        for is_small, group in groupby(blocks, _is_small_plot):
            text = "".join(map(self.block, group))
            parts.append(f'<div class="plots">{text}</div>\n' if is_small else text)
        return "".join(parts)

    def block(self, block: Block) -> str:
        e = html.escape
        if isinstance(block, str):
            return f"<p>{e(block)}</p>\n"
        if isinstance(block, Listing):
            return "<ul>" + "".join(f"<li>{e(line)}</li>" for line in block.lines) + "</ul>\n"
        if isinstance(block, Commands):
            return "".join(map(_command, block.lines))
        if isinstance(block, Link):
            return f'<p><a href="{e(block.page)}.html">{e(block.text)}</a></p>\n'
        if isinstance(block, Picture):
            image = f'<img src="{e(self.source(block.file))}" alt="{e(block.caption)}">'
            return f"<figure>{image}<figcaption>{e(block.caption)}</figcaption></figure>\n"
        if isinstance(block, Plot):
            return self.plot(block)
        if isinstance(block, Beside):
            both = zip(block.names, block.columns, strict=True)
            columns = (f'<div><p class="of">{e(name)}</p>\n{self.blocks(column)}</div>' for name, column in both)
            return f'<div class="beside">{"".join(columns)}</div>\n'
        return _table(block)

    def source(self, file: str) -> str:
        """The bytes of a file as an address."""
        if self.folder is None:
            return file
        kind = mimetypes.guess_type(file)[0] or "application/octet-stream"
        return f"data:{kind};base64,{base64.b64encode((self.folder / file).read_bytes()).decode()}"

    def plot(self, plot: Plot) -> str:
        e = html.escape
        name = self.name_of(plot.key)
        spec: dict[str, Any] = {
            "traces": plot.traces,
            "x": plot.x,
            "y": plot.y,
            "shapes": plot.shapes,
            "height": plot.height,
        }
        label = f"{plot.title}: {plot.y_label} over {plot.x_label}. {plot.caption}"
        return (
            f'<figure class="plot" id="{name}" data-linked="{e(plot.linked)}">\n'
            f'<div class="head"><h3>{e(plot.title)}</h3><span class="tools">'
            f'<button type="button" data-do="whole" aria-label="{e(plot.title)}: show all">all</button>'
            f'<button type="button" data-do="png" aria-label="{e(plot.title)}: save as PNG">PNG</button></span></div>\n'
            f'<p class="axis">{e(plot.y_label)}</p>\n'
            f'<div class="chart" role="img" aria-label="{e(label)}" style="height:{plot.height}px"></div>\n'
            f'<p class="axis x">{e(plot.x_label)}</p>\n'
            f'<div class="legend">{_legend(plot)}</div>\n'
            + (f'<p class="note">{e(plot.caption)}</p>\n' if plot.caption else "")
            + f'<script type="application/json">{embedded_json(spec)}</script>\n</figure>\n'
        )

    def name_of(self, key: str) -> str:
        base = anchor(key)
        name = next(n for n in (base, *(f"{base}-{i}" for i in range(2, 10_000))) if n not in self.taken)
        self.taken.add(name)
        return name


def _is_small_plot(block: Block) -> bool:
    return isinstance(block, Plot) and block.narrow


def _command(line: tuple[str, str]) -> str:
    e = html.escape
    what, command = line
    return (
        f'<div class="command"><div class="head"><span>{e(what)}</span><span class="tools">'
        f'<button type="button" data-do="copy" aria-label="copy: {e(what)}">copy</button></span></div>'
        f"<pre>{e(command)}</pre></div>\n"
    )


def _legend(plot: Plot) -> str:
    e = html.escape
    shown: dict[str, Mapping[str, Any]] = {}
    for trace in plot.traces:
        if trace.get("name") and not trace.get("meta", {}).get("part"):
            shown.setdefault(str(trace["name"]), trace)
    buttons = (
        f'<button type="button" aria-pressed="true" data-name="{e(name)}">{swatch_of_trace(trace)}'
        f"<span>{e(name)}</span></button>"
        for name, trace in shown.items()
    )
    entries = (f'<span class="entry">{swatch_of(**look)}<span>{e(name)}</span></span>' for name, look in plot.legend)
    return "".join((*buttons, *entries))


def _table(table: Table) -> str:
    e = html.escape
    many = ' class="many"' if len(table.heading) >= _MANY else ""
    head = "".join(f"<th>{e(text)}</th>" for text in table.heading)
    lines = ("".join(map(_cell, table.heading, line)) for line in table.lines)
    body = "\n".join(f"<tr>{line}</tr>" for line in lines)
    return f'<div class="wide"><table{many}><thead><tr>{head}</tr></thead><tbody>\n{body}\n</tbody></table></div>\n'


def _cell(heading: str, text: str) -> str:
    kind = ' class="misses"' if text.endswith(MISSES) else ' class="long"' if len(text) >= _LONG else ""
    return f'<td{kind} data-of="{html.escape(heading)}">{html.escape(text)}</td>'
