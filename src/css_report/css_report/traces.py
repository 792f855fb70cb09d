# SPDX-License-Identifier: Apache-2.0
"""Lines, bands, bars and maps as plotly takes them. Long series are thinned here, and nowhere else."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from css_analysis.palette import GREY, SHADE
from css_report.looks import LEVEL, Look
from css_report.thinning import BINS, kept_rows, merged_spans

Trace = dict[str, Any]
_SHOWN_MARKERS = 9  # of a line: enough to tell it from others, not so many that they hide it
_WIDTH = 1.5


def line(
    name: str, x: np.ndarray, y: np.ndarray, look: Look, *, steps: bool = False, width: float = _WIDTH, bins: int = BINS
) -> Trace:
    """A line; rows without a number are gaps."""
    rows = kept_rows(np.asarray(y, dtype=np.float64), bins)
    trace: Trace = {
        "type": "scatter",
        "name": name,
        "mode": "lines+markers" if look.marker else "lines",
        "x": np.asarray(x, dtype=np.float64)[rows],
        "y": np.asarray(y, dtype=np.float32)[rows],
        "line": {"color": look.colour, "dash": look.dash, "width": width},
    }
    if look.marker:
        trace["marker"] = {"symbol": look.marker, "size": 6, "color": look.colour, "maxdisplayed": _SHOWN_MARKERS}
    if steps:
        trace["line"]["shape"] = "hv"
    return trace


def dots(
    name: str, x: Sequence[float], y: Sequence[Any], look: Look, texts: Sequence[str] = (), size: int = 9
) -> Trace:
    """Points, each with a text of its own where there are some."""
    trace: Trace = {
        "type": "scatter",
        "name": name,
        "mode": "markers",
        "cliponaxis": False,
        "x": list(x),
        "y": list(y),
        "marker": {"symbol": look.marker or "circle", "size": size, "color": look.colour},
    }
    if texts:
        trace |= {"text": list(texts), "hovertemplate": "%{text}<extra></extra>"}
    return trace


def band(name: str, x: np.ndarray, low: np.ndarray, high: np.ndarray, look: Look, alpha: str = "38") -> list[Trace]:
    """The area between two lines, where both have a number; its borders are drawn: it is seen without colour."""
    known = np.isfinite(low) & np.isfinite(high)
    edges = np.flatnonzero(np.diff(known, prepend=False, append=False))
    traces: list[Trace] = []
    # an area for each stretch without a gap: one over a gap would show what nobody knows
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        traces += _area(name, x[begin:end], low[begin:end], high[begin:end], look, alpha)
    return traces


def _area(name: str, x: np.ndarray, low: np.ndarray, high: np.ndarray, look: Look, alpha: str) -> list[Trace]:
    rows = np.union1d(kept_rows(low), kept_rows(high))
    edge = {"color": look.colour, "dash": look.dash, "width": 0.7}
    common: Trace = {
        "type": "scatter",
        "mode": "lines",
        "line": edge,
        "x": np.asarray(x[rows], np.float64),
        "name": name,
    }
    return [
        common | {"y": np.asarray(low[rows], np.float32), "meta": {"part": True}, "hoverinfo": "skip"},
        common | {"y": np.asarray(high[rows], np.float32), "fill": "tonexty", "fillcolor": look.colour + alpha},
    ]


def level(value: float, name: str, x: tuple[float, float], dash: str = LEVEL.dash) -> Trace:
    """A horizontal line with a meaning."""
    return line(name, np.array(x), np.array([value, value]), LEVEL.dashed(dash), width=1.0) | {"hoverinfo": "skip"}


def spans_of(time: np.ndarray, on: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Begin and end (S,) of each stretch in which a flag (T,) is on, at times (T,)."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], np.asarray(on, np.int8), [0]))))
    first, after = edges[::2], edges[1::2]
    return time[first], time[np.minimum(after, len(time) - 1)]


def bars(
    name: str,
    rows: Mapping[float, tuple[np.ndarray, np.ndarray]],
    look: Look,
    width: float,
    least_gap: float,
) -> Trace:
    """Horizontal bars: spans (S,) and (S,) at each ordinate; gaps that nobody could see are closed."""
    x: list[float] = []
    y: list[float] = []
    for at, (begin, end) in rows.items():
        for b, e in zip(*merged_spans(begin, end, least_gap), strict=True):
            x += [float(b), float(e), float("nan")]
            y += [at, at, float("nan")]
    trace: Trace = {
        "type": "scatter",
        "name": name,
        "mode": "lines+markers" if look.marker else "lines",
        "x": np.array(x, np.float64),
        "y": np.array(y, np.float32),
        "line": {"color": look.colour, "dash": look.dash, "width": width},
    }
    if look.marker:
        trace["marker"] = {"symbol": look.marker, "size": 7, "color": look.colour}
    return trace


def shaded(time: np.ndarray, dark: np.ndarray) -> Iterator[Trace]:
    """Shapes behind everything over the stretches of `dark`, both (T,)."""
    for begin, end in zip(*spans_of(time, dark), strict=True):
        yield {
            "type": "rect", "xref": "x", "yref": "paper", "x0": float(begin), "x1": float(end), "y0": 0, "y1": 1,
            "fillcolor": SHADE, "line": {"width": 0}, "layer": "below",
        }  # fmt: skip


ECLIPSE_ENTRY = ("eclipse", {"swatch": "area", "colour": SHADE, "edge": GREY})
"""Entry of a legend for shaded stretches."""
