# SPDX-License-Identifier: Apache-2.0
"""Pages as a browser would find them: elements, texts, and the data of their plots."""

import json
from html.parser import HTMLParser
from typing import Any

from css_report.embedded import decoded


class Reader(HTMLParser):
    """What a browser would find: elements that are never closed, data of plots, scripts, texts."""

    EMPTY = ("meta", "link", "img", "br", "circle", "path", "rect")

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: list[str] = []
        self.plots: dict[str, Any] = {}
        self.scripts = 0
        self.texts: list[str] = []
        self.legend: dict[str, list[str]] = {}
        self.outside: list[str] = []
        self.cells: list[str] = []
        self._figure = ""
        self._data = ""

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        if "id" in given:
            self.ids.append(given["id"] or "")
        links = [given[key] or "" for key in ("src", "href") if key in given]
        self.outside += [link for link in links if not link.startswith(("data:", "#"))]
        if tag in ("td", "th"):
            self.cells.append("")
        if tag == "figure":
            self._figure = given.get("id") or ""
        if tag == "button" and "data-name" in given:
            self.legend.setdefault(self._figure, []).append(given["data-name"] or "")
        if tag not in self.EMPTY:
            self.open.append(tag)
        if tag == "script":
            self._data = given.get("type") or ""
            self.scripts += not self._data

    def handle_endtag(self, tag):
        if tag in self.EMPTY:
            return
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] == "script":
            if self._data == "application/json":
                self.plots[self._figure] = json.loads(data)
        elif self.open and self.open[-1] != "style":
            self.texts.append(data)
            if self.open[-1] in ("td", "th"):
                self.cells[-1] += data

    def trace(self, plot: str, name: str) -> dict[str, Any]:
        """The one trace of a name, with its arrays as numbers."""
        (found,) = self.traces(plot, name)
        return found

    def traces(self, plot: str, name: str) -> list[dict[str, Any]]:
        """The traces of a name."""
        return [_with_numbers(trace) for trace in self.plots[plot]["traces"] if trace["name"] == name]


def _with_numbers(value: Any) -> Any:
    if isinstance(value, dict):
        return decoded(value) if "bdata" in value else {key: _with_numbers(inner) for key, inner in value.items()}
    return value


def read(text: str) -> Reader:
    """A page, all of whose elements are closed."""
    reader = Reader()
    reader.feed(text)
    reader.close()
    assert reader.open == []
    return reader
