# SPDX-License-Identifier: Apache-2.0
"""Figures that matplotlib draws as plots of a page: each pair of axes becomes one, with the same numbers.

What a figure says in letters between its lines stands in legend and caption of the plot, where nothing can overlap.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_hex
from matplotlib.contour import ContourSet
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.text import Annotation

from css_analysis.palette import BLACK, SHADE
from css_report.blocks import Plot
from css_report.drawn_lines import axis_of, dash_of, has_line, heatmap, is_dashed, marker_of, with_opacity
from css_report.looks import Look
from css_report.traces import ECLIPSE_ENTRY, Trace, line

_COLORBAR = "<colorbar>"
_HEIGHT = 260
_MAP_HEIGHT = 360
_MOST_NAMED = 12  # places that a caption names


def plots_of(figure: Figure, key: str) -> list[Plot] | None:
    """The axes of a figure as plots, in their order.

    Args:
        figure: drawn and saved.
        key: names it on its page.

    Returns:
        None when it holds what has no counterpart here; its picture then says what it says.
    """
    shown = [axes for axes in figure.axes if axes.get_visible() and axes.get_label() != _COLORBAR]
    names = _legend_names(shown)
    plots = []
    for number, axes in enumerate(shown):
        converted = _Axes(axes, names)
        if converted.unknown:
            return None
        plots.append(converted.plot(f"{key}-{number + 1}", key, len(shown)))
    return plots


def _legend_names(shown: list[Axes]) -> dict[tuple[str, str], str]:
    """Labels of lines by colour and dash: axes of one figure share the legend of one of them."""
    names: dict[tuple[str, str], str] = {}
    for axes in shown:
        for drawn in axes.lines:
            label = str(drawn.get_label())
            if not label.startswith("_"):
                names.setdefault((to_hex(drawn.get_color()), dash_of(drawn)), label)
    return names


def _joined(pieces: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Lines (K, 2) as one, with gaps between them."""
    rows = [row for piece in pieces for row in (piece, np.full((1, 2), np.nan))]
    both = np.concatenate(rows) if rows else np.empty((0, 2))
    return both[:, 0], both[:, 1]


class _Axes:
    """One pair of axes, artist by artist."""

    def __init__(self, axes: Axes, names: dict[tuple[str, str], str]) -> None:
        self.axes, self.names = axes, names
        self.traces: list[Trace] = []
        self.shapes: list[Trace] = []
        self.legend: list[tuple[str, dict[str, Any]]] = []
        self.notes: list[str] = []
        self.unknown = False
        self.has_map = False
        self.inside: list[str] = []
        self.level_names, self.upright_names, self.marked = self._texts()
        take: dict[type, Callable[[Any], None]] = {
            AxesImage: self._image,
            ContourSet: self._contours,
            LineCollection: self._segments,
            PolyCollection: self._areas,
            Rectangle: self._span,
            Line2D: self._line,
        }
        for artist in (*axes.images, *axes.collections, *axes.patches, *axes.lines):
            for kind, method in take.items():
                if isinstance(artist, kind):
                    method(artist)
                    break
            else:
                self.unknown = True
        self._places()

    def plot(self, key: str, linked: str, count: int) -> Plot:
        """What was found."""
        axes = self.axes
        siblings = axes.get_shared_x_axes().get_siblings(axes)
        title = axes.get_title("left") or axes.get_title("center")
        remark = axes.get_title("right")
        box = axes.get_legend()
        heading = box.get_title().get_text() if box is not None else ""
        caption = ". ".join(text.replace("\n", "; ") for text in (heading, remark, *self.notes) if text)
        return Plot(
            key,
            ", ".join(filter(None, (title, *self.inside))) or "Figure",
            self.traces,
            axes.get_xlabel() or next((other.get_xlabel() for other in siblings if other.get_xlabel()), ""),
            axes.get_ylabel().replace("\n", " "),
            x=axis_of(axes.xaxis, axes.get_xlim()),
            y=axis_of(axes.yaxis, axes.get_ylim()),
            linked=linked if len(siblings) > 1 else "",
            shapes=self.shapes,
            legend=self.legend,
            caption=caption,
            height=_MAP_HEIGHT if self.has_map else _HEIGHT,
            narrow=count > 1,
        )

    def _texts(self) -> tuple[dict[float, str], dict[float, str], list[tuple[float, float, str]]]:
        """Names of levels, of upright lines, and of places in the axes."""
        levels: dict[float, str] = {}
        upright: dict[float, str] = {}
        marked = []
        for text in self.axes.texts:
            if not isinstance(text, Annotation):
                continue
            x, y = text.xy
            if text.xycoords == ("axes fraction", "data"):
                levels[float(y)] = text.get_text()
            elif text.xycoords == ("data", "axes fraction"):
                upright[float(x)] = text.get_text()
            elif text.xycoords == "axes fraction":
                self.inside.append(text.get_text())
            else:
                marked.append((float(x), float(y), text.get_text()))
        return levels, upright, marked

    def _line(self, drawn: Line2D) -> None:
        colour, dash = to_hex(drawn.get_color()), dash_of(drawn)
        transform = drawn.get_transform()
        if transform == self.axes.get_xaxis_transform(which="grid"):
            self._upright(float(np.asarray(drawn.get_xdata())[0]), colour, dash)
            return
        if transform == self.axes.get_yaxis_transform(which="grid"):
            value = float(np.asarray(drawn.get_ydata())[0])
            self._level(value, colour, dash)
            return
        label = str(drawn.get_label())
        name = self.names.get((colour, dash), "") if label.startswith("_") else label
        x, y = (np.asarray(values, np.float64) for values in drawn.get_data(orig=False))
        look = Look(colour, dash)
        trace = line(name, x, y, look, width=float(drawn.get_linewidth()) + 0.4)
        marker = marker_of(drawn)
        trace["mode"] = "+".join((["lines"] if has_line(drawn) else []) + (["markers"] if marker else [])) or "none"
        if marker:
            trace["marker"] = marker
        if drawn.get_drawstyle() == "steps-post":
            trace["line"]["shape"] = "hv"
        self.traces.append(trace)

    def _upright(self, at: float, colour: str, dash: str) -> None:
        stroke = {"color": colour, "dash": dash, "width": 1}
        self.shapes.append({"type": "line", "x0": at, "x1": at, "yref": "paper", "y0": 0, "y1": 1, "line": stroke})
        if at in self.upright_names:
            self.legend.append(
                (f"{self.upright_names[at]} ({at:g})", {"swatch": "line", "colour": colour, "dash": dash})
            )

    def _level(self, value: float, colour: str, dash: str) -> None:
        name = self.level_names.get(value, f"{value:g}")
        ends = np.array(self.axes.get_xlim())
        self.traces.append(line(name, ends, np.array([value, value]), Look(colour, dash), width=1.0))

    def _areas(self, drawn: PolyCollection) -> None:
        faces = np.atleast_2d(np.asarray(drawn.get_facecolor(), np.float64))
        label = str(drawn.get_label())
        for number, path in enumerate(drawn.get_paths()):
            colour = to_hex(tuple(faces[min(number, len(faces) - 1)].tolist()), keep_alpha=True)
            corners = np.asarray(path.vertices, np.float64)
            self.traces.append(
                {
                    "type": "scatter",
                    "mode": "lines",
                    "fill": "toself",
                    "name": "" if label.startswith("_") else label,
                    "x": corners[:, 0],
                    "y": corners[:, 1].astype(np.float32),
                    "line": {"width": 0.5, "color": colour[:7]},
                    "fillcolor": colour,
                    "hoverinfo": "skip",
                }
            )

    def _segments(self, drawn: LineCollection) -> None:
        colours = np.atleast_2d(np.asarray(drawn.get_color(), np.float64))
        label = str(drawn.get_label())
        x, y = _joined([np.asarray(piece, np.float64) for piece in drawn.get_segments()])
        look = Look(to_hex(tuple(colours[0].tolist())), "dash" if is_dashed(drawn) else "solid")
        self.traces.append(line("" if label.startswith("_") else label, x, y, look, width=2.0, bins=len(x)))

    def _span(self, drawn: Rectangle) -> None:
        colour = to_hex(drawn.get_facecolor())
        (x0, y0), width, height = drawn.get_xy(), drawn.get_width(), drawn.get_height()
        whole = drawn.get_transform() != self.axes.transData and (y0, height) == (0, 1)
        self.shapes.append(
            {
                "type": "rect",
                "x0": float(x0),
                "x1": float(x0 + width),
                "y0": float(y0),
                "y1": float(y0 + height),
                "yref": "paper" if whole else "y",
                "fillcolor": with_opacity(drawn.get_facecolor(), drawn.get_alpha()),
                "line": {"width": 0},
                "layer": "below",
            }
        )
        if colour.upper() == SHADE.upper() and ECLIPSE_ENTRY not in self.legend:
            self.legend.append(ECLIPSE_ENTRY)

    def _image(self, drawn: AxesImage) -> None:
        trace, note = heatmap(drawn, self.axes)
        self.has_map = True
        bar = drawn.colorbar
        label = bar.ax.get_ylabel() if bar is not None else ""
        self.notes += [text for text in (f"Shades: {label}" if label else "", note) if text]
        self.traces.append(trace | {"name": ""})

    def _contours(self, drawn: ContourSet) -> None:
        for level, path in zip(drawn.levels, drawn.get_paths(), strict=True):
            x, y = _joined([np.asarray(piece, np.float64) for piece in path.to_polygons(closed_only=False)])
            if len(x):
                look = Look(BLACK, "solid")
                self.traces.append(line(f"{level:g}", x, y, look, width=0.8, bins=len(x)))

    def _places(self) -> None:
        """Named places become points whose names the caption holds."""
        if not self.marked:
            return
        names = [f"{name} at {x:.4g}" for x, _, name in self.marked]
        self.traces.append(
            {
                "type": "scatter",
                "mode": "markers",
                "name": "named places",
                "cliponaxis": False,
                "x": [x for x, _, _ in self.marked],
                "y": [y for _, y, _ in self.marked],
                "text": [name for _, _, name in self.marked],
                "hovertemplate": "%{text}<extra></extra>",
                "marker": {"symbol": "diamond", "size": 8, "color": "#D55E00"},
            }
        )
        more = f" and {len(names) - _MOST_NAMED} more" if len(names) > _MOST_NAMED else ""
        self.notes.append(f"Named places: {', '.join(names[:_MOST_NAMED])}{more}")
