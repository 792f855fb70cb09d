# SPDX-License-Identifier: Apache-2.0
"""How Sunpoint's figures look: one style, colours that colour-blind readers can tell apart, thin long series."""

from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from css_analysis import palette

BLUE, ORANGE, GREEN, VERMILION = palette.BLUE, palette.ORANGE, palette.GREEN, palette.VERMILION
PURPLE, SKY, BLACK, GREY = palette.PURPLE, palette.SKY, palette.BLACK, palette.GREY
COLOURS, SHADE, DARK_GREY = palette.COLOURS, palette.SHADE, palette.DARK_GREY

_DPI = 150
_STYLE: dict[Any, Any] = {
    "font.size": 9.0,
    "axes.titlesize": 10.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.7,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#C8CCD0",
    "grid.linewidth": 0.5,
    "lines.linewidth": 1.0,
    "legend.fontsize": 8.0,
    "legend.frameon": False,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "agg.path.chunksize": 10000,
}
_BINS = 600  # what a printed line can show
_LONG = 4  # rows a bin from which a series is binned

Colour = str | tuple[float, ...]

_kept: ContextVar[dict[Path, Figure] | None] = ContextVar("_kept", default=None)


def style() -> AbstractContextManager[None]:
    """Context in which figures must be made and saved."""
    return matplotlib.rc_context(_STYLE)


def new_figure(width: float, height: float) -> Figure:
    """A figure of `width` by `height` [inches] that draws without a display."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def save(figure: Figure, path: Path) -> Path:
    """Write a PNG; the same figure gives the same bytes."""
    figure.savefig(path, dpi=_DPI, metadata={"Software": None})
    kept = _kept.get()
    if kept is not None:
        kept[path.absolute()] = figure
    return path


@contextmanager
def keep_figures() -> Iterator[dict[Path, Figure]]:
    """Figures that are saved inside the context, by their absolute paths: for pages that show more than pixels."""
    kept: dict[Path, Figure] = {}
    token = _kept.set(kept)
    try:
        yield kept
    finally:
        _kept.reset(token)


def kept_figure(path: Path) -> Figure | None:
    """The figure that was saved under a path inside `keep_figures`; None: there is none, or nobody keeps them."""
    return (_kept.get() or {}).get(path.absolute())


def colours(count: int) -> Sequence[Colour]:
    """Distinct line colours; beyond the eight of the palette, shades from dark to light."""
    if count <= len(COLOURS):
        return COLOURS[:count]
    return [tuple(c) for c in matplotlib.colormaps["viridis"](np.linspace(0.0, 0.92, count))]


def draw_series(axes: Axes, x: np.ndarray, y: np.ndarray, colour: Colour, label: str = "", width: float = 1.0) -> None:
    """A line; of a long series the median of each of 600 bins, in a pale band from smallest to largest value.

    Rows without a number are gaps.
    """
    size = len(x) // _BINS
    if size > _LONG:
        x, low, middle, high = binned(x, y, size)
        axes.fill_between(x, low, high, color=colour, alpha=0.25, linewidth=0.0)
        y = middle
    axes.plot(x, y, color=colour, label=label, linewidth=width)


def binned(x: np.ndarray, y: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """First x of each bin of `size` rows, and smallest, median and largest y in it (NaN: none)."""
    count = -(-len(x) // size)
    rows = np.full(count * size, np.nan)
    rows[: len(y)] = y
    # sorted, what is not a number stands last
    rows = np.sort(rows.reshape(count, size), axis=1)
    last = np.count_nonzero(~np.isnan(rows), axis=1) - 1
    bins = np.arange(count)
    return x[::size], rows[:, 0], rows[bins, last // 2], rows[bins, last]


def level_line(axes: Axes, value: float, label: str) -> None:
    """A dashed horizontal line with its meaning right of the axes."""
    axes.axhline(value, color=GREY, linewidth=0.8, linestyle=(0, (4, 3)), zorder=1.5)
    axes.annotate(
        label,
        (1.0, value),
        xycoords=("axes fraction", "data"),
        xytext=(6, 0),
        textcoords="offset points",
        ha="left",
        va="center",
        fontsize=8.0,
        color=DARK_GREY,
    )


def shade_dark(axes: Axes, time: np.ndarray, dark: np.ndarray) -> None:
    """Grey background over the stretches of `dark`, both (T,)."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], dark.astype(np.int8), [0]))))
    for first, end in edges.reshape(-1, 2):
        axes.axvspan(time[first], time[end - 1], color=SHADE, linewidth=0.0, zorder=0)


def subtitle(axes: Axes, text: str) -> None:
    """A remark in small grey letters at the right end of the title."""
    axes.set_title(text, loc="right", fontsize=8.0, fontweight="normal", color=DARK_GREY)


def logarithmic(axes: Axes) -> None:
    """Logarithmic ordinate with plain numbers."""
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def legend(axes: Axes, title: str | None = None) -> None:
    """Labels of the lines, right of the axes."""
    handles, labels = axes.get_legend_handles_labels()
    if not handles:
        return
    result = axes.legend(
        handles,
        labels,
        title=title,
        loc="upper left",
        bbox_to_anchor=(1.01, 1.02),
        borderaxespad=0.0,
        handlelength=1.4,
        alignment="left",
        ncols=1 + (len(handles) - 1) // 10,
    )
    for line in result.get_lines():
        line.set_linewidth(1.8)
