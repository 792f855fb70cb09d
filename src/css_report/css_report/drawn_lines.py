# SPDX-License-Identifier: Apache-2.0
"""How lines, areas and maps of a matplotlib figure look, in plotly's words."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.collections import LineCollection
from matplotlib.colors import BoundaryNorm, to_hex, to_rgba
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator

_NAMED_DASHES = {"-": "solid", "--": "dash", ":": "dot", "-.": "dashdot"}
_MARKERS = {"o": "circle", ".": "circle", "s": "square", "D": "diamond", "^": "triangle-up", "v": "triangle-down"}
_MARKERS |= {"+": "cross", "x": "x", "*": "star", "d": "diamond"}
_MOST_FIELDS = 360 * 720  # of a map
_SHADES = 16  # of a colour map


def dash_of(line: Line2D) -> str:
    """Plotly's name of a line's dashes."""
    # the pattern itself, for which there is no public way: `(0, (1, 1.2))` is called dashed too
    _, pattern = vars(line).get("_unscaled_dash_pattern", (0, None))
    if not pattern:
        return _NAMED_DASHES.get(str(line.get_linestyle()), "solid")
    if len(pattern) > 2:
        return "dashdot"
    return "dot" if pattern[0] <= 2.0 else "dash"


def is_dashed(lines: LineCollection) -> bool:
    """Whether the lines of a collection have dashes."""
    return any(isinstance(style, tuple) and style[1] is not None for style in list(lines.get_linestyle()))


def has_line(line: Line2D) -> bool:
    """Whether it joins its points."""
    return str(line.get_linestyle()) not in ("None", "", " ")


def marker_of(line: Line2D) -> dict[str, Any] | None:
    """Plotly's marker of a line; None: it has none."""
    name = line.get_marker()
    if name in (None, "None", "", " "):
        return None
    hollow = to_rgba(line.get_markerfacecolor())[3] == 0.0 or to_hex(line.get_markerfacecolor()) == "#ffffff"
    size = 3.0 if name == "." else max(1.4 * float(line.get_markersize()), 4.0)
    colour = to_hex(line.get_markeredgecolor())
    symbol = _MARKERS.get(str(name), "circle") + ("-open" if hollow else "")
    return {"symbol": symbol, "size": size, "color": colour}


def with_opacity(colour: Any, alpha: float | None) -> str:
    """A colour as #rrggbbaa."""
    return to_hex(to_rgba(colour, alpha), keep_alpha=True)


def axis_of(axis: Axis, limits: tuple[float, float]) -> dict[str, Any]:
    """Scale, limits and named ticks of an axis; a scale that plotly has not is linear."""
    low, high = limits
    is_log = axis.get_scale() == "log" and low > 0.0 and high > 0.0
    found: dict[str, Any] = {"range": [np.log10(low), np.log10(high)] if is_log else [float(low), float(high)]}
    if is_log:
        found |= {"type": "log", "tickformat": "~g", "dtick": 1}
    elif isinstance(axis.get_major_locator(), FixedLocator):
        at = [float(value) for value in axis.get_majorticklocs()]
        texts = [label.get_text() for label in axis.get_ticklabels()]
        inside = [(a, t) for a, t in zip(at, texts, strict=False) if min(limits) <= a <= max(limits)]
        if any(text for _, text in inside):
            found |= {"tickvals": [a for a, _ in inside], "ticktext": [t for _, t in inside]}
    return found


def heatmap(image: AxesImage, axes: Axes) -> tuple[dict[str, Any], str]:
    """A map as plotly has it, and what its fields are if it was made coarser."""
    array = np.ma.filled(np.ma.asarray(image.get_array(), dtype=np.float64), np.nan)
    left, right, bottom, top = image.get_extent()
    rows, columns = array.shape[:2]
    if image.origin == "upper":
        array = array[::-1]
    factor = int(np.ceil(np.sqrt(rows * columns / _MOST_FIELDS))) if rows * columns > _MOST_FIELDS else 1
    counts = isinstance(image.norm, BoundaryNorm)
    coarse = _pooled(array, factor, smallest=counts) if factor > 1 else array
    low, high = image.get_clim()
    shades = [to_hex(image.cmap(k / (_SHADES - 1))) for k in range(_SHADES)]
    trace = {
        "type": "heatmap",
        "x": _middles(left, right, coarse.shape[1]),
        "y": _middles(min(bottom, top), max(bottom, top), coarse.shape[0]) if image.origin == "lower"
        else _middles(bottom, top, coarse.shape[0]),
        "z": np.asarray(coarse, np.float32),
        "zmin": float(np.nanmin(coarse)) if low is None or counts else float(low),
        "zmax": float(np.nanmax(coarse)) if high is None or counts else float(high),
        "colorscale": [[k / (_SHADES - 1), shade] for k, shade in enumerate(shades)],
        "colorbar": {"thickness": 12, "outlinewidth": 0},
    }  # fmt: skip
    what = "smallest" if counts else "largest"
    note = f"Each field of the map is the {what} of {factor} by {factor}." if factor > 1 else ""
    return trace, note


def _middles(low: float, high: float, count: int) -> np.ndarray:
    return low + (np.arange(count) + 0.5) * (high - low) / count


def _pooled(array: np.ndarray, factor: int, *, smallest: bool) -> np.ndarray:
    """Fields of `factor` by `factor` as one: their smallest or largest number; not a number where none is one."""
    rows, columns = (-(-n // factor) for n in array.shape)
    padded = np.full((rows * factor, columns * factor), np.nan)
    padded[: array.shape[0], : array.shape[1]] = array
    blocks = padded.reshape(rows, factor, columns, factor).transpose(0, 2, 1, 3).reshape(rows, columns, -1)
    missing = np.isnan(blocks)
    filled = np.where(missing, np.inf if smallest else -np.inf, blocks)
    pooled = filled.min(axis=2) if smallest else filled.max(axis=2)
    return np.where(missing.all(axis=2), np.nan, pooled)
