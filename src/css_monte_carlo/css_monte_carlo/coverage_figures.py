# SPDX-License-Identifier: Apache-2.0
"""Coverage maps as PNG files (O'Keefe & Schaub 2013, Figs. 1b and 2)."""

from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.image import AxesImage

from css_analysis.body_axes import map_coordinates
from css_analysis.figure_style import DARK_GREY, VERMILION, new_figure, save, style, subtitle
from css_monte_carlo.coverage import CellMap, Grid

_SIZE = (8.0, 4.4)  # [inches]
_HOLE = VERMILION


def write_coverage_figures(
    grid: Grid, ideal: CellMap, warped: CellMap, normals_b: np.ndarray, subject: str, folder: str | Path
) -> list[Path]:
    """Writes the maps of a layout; returns the files.

    Args:
        normals_b: (N, 3) outward cell normals, marked in the maps.
        subject: what was mapped, for the corner of each figure.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    at = map_coordinates(grid.axes, normals_b)
    title = "Error of the weighted average"
    return [
        _write_counts(grid, ideal, at, subject, folder / "cells_in_view.png"),
        _write_errors(ideal, at, f"{title}, ideal cosine", subject, folder / "wavg_error.png"),
        _write_errors(warped, at, f"{title}, warped response", subject, folder / "wavg_error_warped.png"),
    ]


def _write_counts(grid: Grid, result: CellMap, cells: np.ndarray, subject: str, path: Path) -> Path:
    counts = np.arange(int(result.seen_by.max()) + 1)
    shades = matplotlib.colormaps["cividis"](np.linspace(0.12, 1.0, max(len(counts) - 1, 1)))
    palette = ListedColormap([_HOLE, *shades[: len(counts) - 1]])
    bounds = BoundaryNorm(np.arange(len(counts) + 1) - 0.5, palette.N)
    share = grid.ring_weight / len(grid.azimuth)
    with style():
        figure = new_figure(*_SIZE)
        axes = figure.subplots()
        image = _draw_map(axes, result.seen_by, cmap=palette, norm=bounds)
        _mark_cells(axes, cells)
        bar = figure.colorbar(image, ax=axes, ticks=counts, pad=0.02)
        bar.ax.set_yticklabels(
            [f"{count}: {100.0 * (share @ (result.seen_by == count).sum(axis=1)):.2f} %" for count in counts]
        )
        bar.set_label("cells in view: share of the sphere")
        _name(axes, "Cells that see the Sun", subject)
        return save(figure, path)


def _write_errors(result: CellMap, cells: np.ndarray, title: str, subject: str, path: Path) -> Path:
    error = np.degrees(result.wavg_error)
    palette = matplotlib.colormaps["viridis"].with_extremes(bad=_HOLE)
    with style():
        figure = new_figure(*_SIZE)
        axes = figure.subplots()
        image = _draw_map(axes, np.ma.masked_invalid(error), cmap=palette, vmin=0.0)
        lines = axes.contour(
            np.nan_to_num(error),
            levels=[10.0, 30.0],
            colors=["white", "white"],
            linestyles=["dotted", "solid"],
            linewidths=0.9,
            extent=(0.0, 360.0, 0.0, 180.0),
        )
        # sharp edges of cells' views have no place for a label inside the line
        handles, _ = lines.legend_elements()
        legend = axes.legend(handles, ["10°", "30°"], loc="upper right", frameon=True, facecolor=DARK_GREY)
        for text in legend.get_texts():
            text.set_color("white")
        _mark_cells(axes, cells)
        bar = figure.colorbar(image, ax=axes, pad=0.02)
        bar.set_label("angle of estimated to true Sun [deg]")
        _name(axes, title, subject)
        return save(figure, path)


def _draw_map(axes: Axes, values: np.ndarray, **style_of_image: Any) -> AxesImage:
    image = axes.imshow(
        values, extent=(0.0, 360.0, 180.0, 0.0), aspect="auto", interpolation="nearest", **style_of_image
    )
    axes.set_xticks(np.arange(0, 361, 45))
    axes.set_yticks(np.arange(0, 181, 30))
    axes.set_xlabel("Sun azimuth about the array normal [deg]")
    axes.set_ylabel("Sun to array normal [deg]")
    axes.grid(False)
    for spine in axes.spines.values():
        spine.set_visible(True)
    return image


def _mark_cells(axes: Axes, cells: np.ndarray) -> None:
    for i, (azimuth, polar) in enumerate(cells):
        # a cell on the seam is marked on both sides
        for at in (azimuth, azimuth + 360.0) if azimuth < 1e-6 else (azimuth,):
            axes.plot(at, polar, "o", color="white", markeredgecolor="black", markersize=4.0, clip_on=False)
        side = -6 if azimuth > 340.0 else 6
        axes.annotate(
            f"{i}",
            (azimuth, polar),
            xytext=(side, 4),
            textcoords="offset points",
            fontsize=8.0,
            color="white",
            ha="right" if side < 0 else "left",
            bbox={"boxstyle": "round,pad=0.12", "facecolor": "black", "edgecolor": "none", "alpha": 0.45},
        )


def _name(axes: Axes, title: str, subject: str) -> None:
    axes.set_title(title)
    subtitle(axes, subject)
