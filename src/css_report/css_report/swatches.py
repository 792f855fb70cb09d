# SPDX-License-Identifier: Apache-2.0
"""Samples of lines, areas and markers for legends, with the dash and the marker that tell them apart."""

from collections.abc import Mapping
from typing import Any

_DASHES = {"dash": "7 4", "dot": "2 3", "dashdot": "7 3 2 3", "longdash": "11 4", "longdashdot": "11 3 2 3"}
_MARKERS = {
    "circle": '<circle cx="17" cy="7" r="3.5"/>',
    "square": '<path d="M13.5 3.5h7v7h-7z"/>',
    "diamond": '<path d="M17 2.5l4.5 4.5-4.5 4.5-4.5-4.5z"/>',
    "triangle-up": '<path d="M17 2.5l4.5 8h-9z"/>',
    "triangle-down": '<path d="M17 11.5l4.5-8h-9z"/>',
    "cross": '<path d="M15.5 2.5h3v3h3v3h-3v3h-3v-3h-3v-3h3z"/>',
    "x": '<path d="M13.5 3.5l7 7m0-7l-7 7" stroke-width="2.4"/>',
    "star": '<path d="M17 2l1.4 3.4 3.6.3-2.7 2.4.8 3.6-3.1-1.9-3.1 1.9.8-3.6-2.7-2.4 3.6-.3z"/>',
    "/": '<path d="M6 12l5-10m5 10l5-10m5 10l5-10"/>',
    "\\": '<path d="M6 2l5 10m5-10l5 10m5-10l5 10"/>',
    "|": '<path d="M9 2v10m8-10v10m8-10v10"/>',
    "-": '<path d="M2 5h30m-30 4h30"/>',
    "+": '<path d="M2 7h30m-23-5v10m8-10v10m8-10v10"/>',
    "crosses": '<path d="M5 3l8 8m0-8l-8 8m8-8l8 8m0-8l-8 8m8-8l8 8m0-8l-8 8"/>',
    "dots": '<path d="M6 7h0.1m7 0h0.1m7 0h0.1m7 0h0.1" stroke-width="3" stroke-linecap="round"/>',
}
_PATTERNS = {"/": "/", "\\": "\\", "|": "|", "-": "-", "+": "+", "x": "crosses", ".": "dots"}
"""Plotly's patterns of bars, and their sample."""


def swatch_of_trace(trace: Mapping[str, Any]) -> str:
    """The sample of a trace."""
    line, marker = trace.get("line", {}), trace.get("marker", {})
    mode = str(trace.get("mode", "lines"))
    symbol = marker.get("symbol", "circle") if "markers" in mode else ""
    colour = line.get("color") if "lines" in mode else marker.get("color")
    if trace.get("type") == "bar":
        colour = str(marker.get("color", "#8C8C8C"))
        return swatch_of("area", colour, colour, marker=_PATTERNS.get(marker.get("pattern", {}).get("shape", ""), ""))
    swatch = "area" if trace.get("fill") else "line" if "lines" in mode else "marker"
    return swatch_of(
        swatch,
        str(colour) if isinstance(colour, str) else "#8C8C8C",
        dash=str(line.get("dash", "solid")),
        marker=str(symbol) if isinstance(symbol, str) else "circle",
        width=float(line.get("width", 2.0)),
    )


def swatch_of(
    swatch: str, colour: str, edge: str = "", dash: str = "solid", marker: str = "", width: float = 2.0
) -> str:
    """A small drawing as SVG.

    Args:
        swatch: `line`, `area` or `marker`.
        colour: #rrggbb, perhaps with opacity behind it.
        edge: colour of the border of an area.
        dash: plotly's name of it.
        marker: plotly's name of it; empty: none.
        width: of the line [px].
    """
    pieces = []
    pattern = _DASHES.get(dash, dash.replace("px", "").replace(",", " ") if "px" in dash else "")
    dashes = f' stroke-dasharray="{pattern}"' if pattern else ""
    if swatch == "area":
        pieces.append(
            f'<rect x="1.5" y="1.5" width="31" height="11" style="fill:{_themed(colour)};fill-opacity:.35;'
            f'stroke:{_themed(edge or colour)}"{dashes}/>'
        )
    if swatch == "line":
        pieces.append(
            f'<path d="M1 7h32" style="stroke:{_themed(colour)};stroke-width:{min(max(width, 1.5), 8.0):g}"{dashes}/>'
        )
    if marker:
        drawn = _MARKERS.get(marker.removesuffix("-open"), _MARKERS["circle"])
        fill = "var(--card)" if marker.endswith("-open") else _themed(colour)
        pieces.append(f'<g style="fill:{fill};stroke:{_themed(colour)}">{drawn}</g>')
    return f'<svg width="34" height="14" fill="none" aria-hidden="true">{"".join(pieces)}</svg>'


def _themed(colour: str) -> str:
    """A colour that the theme may change, if it is of the palette."""
    plain = colour[:7]
    if len(plain) != 7 or plain[0] != "#" or not all(c in "0123456789abcdefABCDEF" for c in plain[1:]):
        return "currentColor"
    return f"var(--k-{plain[1:].lower()}, {plain})"
