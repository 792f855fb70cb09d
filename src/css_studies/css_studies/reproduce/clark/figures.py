# SPDX-License-Identifier: Apache-2.0
"""Figures 1, 3, 5, 7 and 8 of Benton."""

from pathlib import Path

import numpy as np

from css_studies.figure_style import (
    BLUE,
    VERMILION,
    draw_series,
    legend,
    level_line,
    new_figure,
    save,
    shade_dark,
    style,
)
from css_studies.reproduce.clark.flights import Flight

_WIDTH = 8.6
_MINUTE = 60.0


def write_error(flight: Flight, file: Path) -> Path:
    """Figure 1: sensed to true Sun, zero in the shadow, with the mean over sunlight."""
    with style():
        figure = new_figure(_WIDTH, 3.0)
        axes = figure.subplots()
        minutes = flight.time_s / _MINUTE
        shade_dark(axes, minutes, ~flight.sunlit)
        draw_series(axes, minutes, np.where(flight.sunlit, flight.error, 0.0), BLUE)
        level_line(axes, flight.mean_error, f"{flight.mean_error:.2f}°")
        axes.set_xlabel("time [min]")
        axes.set_ylabel("sensed to true Sun [deg]")
        axes.set_ylim(bottom=0.0)
        axes.set_title("Error of the sensed Sun")
        return save(figure, file)


def write_panel(flight: Flight, title: str, file: Path) -> Path:
    """Figures 5, 7 and 8: panel normal to the true and to the sensed Sun, with the mean of the first over sunlight."""
    with style():
        figure = new_figure(_WIDTH, 3.4)
        axes = figure.subplots()
        minutes = flight.time_s / _MINUTE
        shade_dark(axes, minutes, ~flight.sunlit)
        draw_series(axes, minutes, flight.panel_sensed, VERMILION, "sensed Sun", width=0.7)
        draw_series(axes, minutes, flight.panel_true, BLUE, "true Sun")
        level_line(axes, flight.mean_panel, f"{flight.mean_panel:.2f}°")
        axes.set_xlabel("time [min]")
        axes.set_ylabel("panel normal to Sun [deg]")
        axes.set_ylim(bottom=0.0)
        axes.set_title(title)
        legend(axes, title="shaded: eclipse")
        return save(figure, file)
