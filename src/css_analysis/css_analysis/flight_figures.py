# SPDX-License-Identifier: Apache-2.0
"""Figures of one flight or several, as PNG files."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from matplotlib.axes import Axes

from css_analysis.figure_style import colours, new_figure, save, style, subtitle
from css_analysis.flight_log import FlightLog
from css_analysis.flight_panels import (
    Panel,
    draw_heading_error,
    draw_pointing_error,
    draw_true_rate,
    finish_heading_error,
    finish_pointing_error,
    finish_rate,
    panels_of,
    shade_eclipse,
)
from css_analysis.flight_series import TimeAxis, time_axis

_WIDTH = 8.6  # [inches]
_PANEL_HEIGHT = 1.75


def write_figures(logs: FlightLog | Sequence[FlightLog], folder: str | Path) -> list[Path]:
    """Writes the figures of one flight, or of several and their comparison; returns the files.

    One flight gives `overview.png` and a file for each panel that has data. Several flights give each of these
    in a folder of the flight's name, and `comparison.png` beside the folders.
    """
    folder = Path(folder)
    if isinstance(logs, FlightLog):
        return _write_flight(logs, folder)
    labels = _labels(logs)
    files = _write_comparison(logs, labels, folder)
    for log, label in zip(logs, labels, strict=True):
        files += _write_flight(log, folder / label)
    return files


def _write_flight(log: FlightLog, folder: Path) -> list[Path]:
    panels = panels_of(log)
    if not panels:
        return []
    folder.mkdir(parents=True, exist_ok=True)
    files = [_draw(log, panels, folder / "overview.png")]
    return files + [_draw(log, [panel], folder / f"{panel.name}.png") for panel in panels]


def _draw(log: FlightLog, panels: Sequence[Panel], path: Path) -> Path:
    heights = [panel.height for panel in panels]
    unit = time_axis(log)
    with style():
        figure = new_figure(_WIDTH, 0.75 + _PANEL_HEIGHT * (sum(heights) if len(panels) > 1 else 1.5))
        all_axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False, height_ratios=heights)[:, 0]
        for axes, panel in zip(all_axes, panels, strict=True):
            shade_eclipse(axes, log, unit)
            panel.draw(axes, log, unit)
            axes.set_title(panel.title)
        _finish_time(all_axes, unit)
        subtitle(all_axes[0], _subject(log))
        figure.align_ylabels()
        return save(figure, path)


def _write_comparison(logs: Sequence[FlightLog], labels: Sequence[str], folder: Path) -> list[Path]:
    """One line a flight: heading error of the estimator that flew (else the first), pointing error, rate."""
    shown = [(log, label) for log, label in zip(logs, labels, strict=True) if log.truth is not None]
    if len(shown) < 2:
        return []
    folder.mkdir(parents=True, exist_ok=True)
    longest = max((log for log, _ in shown), key=lambda log: len(log.sunlit) * log.period)
    unit = time_axis(longest)
    with style():
        figure = new_figure(_WIDTH, 7.0)
        all_axes = figure.subplots(3, 1, sharex=True)
        heading, pointing, rate = all_axes
        for (log, label), colour in zip(shown, colours(len(shown)), strict=True):
            name = log.flown if log.flown in log.estimates else next(iter(log.estimates), None)
            if name is not None:
                draw_heading_error(heading, log, unit, name, colour, f"{label}: {name}")
            if not log.imported:
                draw_pointing_error(pointing, log, unit, colour)
            if log.knows("rate"):
                draw_true_rate(rate, log, unit, colour, label)
        for axes, title in zip(
            all_axes, ("Estimated to true Sun", "Array normal to true Sun", "True body rate"), strict=True
        ):
            shade_eclipse(axes, longest, unit)
            axes.set_title(title)
        finish_heading_error(heading)
        finish_pointing_error(pointing)
        finish_rate(rate)
        _finish_time(all_axes, unit)
        subtitle(heading, _subject(longest))
        figure.align_ylabels()
        return [save(figure, folder / "comparison.png")]


def _finish_time(all_axes: Iterable[Axes], unit: TimeAxis) -> None:
    *_, last = all_axes
    if unit.last > unit.first:
        last.set_xlim(unit.first, unit.last)
    last.set_xlabel(unit.label)


def _subject(log: FlightLog) -> str:
    name = log.name
    if log.mission is not None:
        mission = log.mission.values.mission
        name = f"{mission.name}, case {mission.case}, seed {mission.seed}"
    return f"{name}; shaded: eclipse"


def _labels(logs: Sequence[FlightLog]) -> list[str]:
    """Folder name of each flight, made different by a number where origins share theirs."""
    names = [Path(log.origin).stem or log.name for log in logs]
    return [f"{name}_{names[: i + 1].count(name)}" if names.count(name) > 1 else name for i, name in enumerate(names)]
