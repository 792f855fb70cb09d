# SPDX-License-Identifier: Apache-2.0
"""Figures 6, 7a, 7b and 8 of O'Keefe & Schaub 2013, as printed and improved below each other."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa
from matplotlib.axes import Axes
from matplotlib.ticker import NullLocator

from css_analysis.figure_style import (
    GREY,
    legend,
    level_line,
    logarithmic,
    new_figure,
    save,
    shade_dark,
    style,
)
from css_papers.okeefe.configurations import Entry
from css_papers.study_columns import column, curve

_MINUTE = 60.0


class Variant(NamedTuple):
    """One set of four configurations and its flights."""

    name: str
    is_printed: bool  # as the paper has it
    entries: Sequence[Entry]
    cases: pa.Table
    percentiles: pa.Table


class Shadow(NamedTuple):
    """Where the orbit is dark."""

    time_s: np.ndarray  # (T,) since the epoch
    dark: np.ndarray  # (T,) bool

    def at(self, time_s: np.ndarray) -> np.ndarray:
        """(K,) whether it is dark at times [s]."""
        return self.dark[np.searchsorted(self.time_s, time_s).clip(max=len(self.dark) - 1)]


class Quantity(NamedTuple):
    """A quantity against time."""

    name: str  # in the study's percentiles
    title: str
    label: str  # of the axis
    least: float  # smaller values are drawn as this, for the logarithmic axis
    levels: Sequence[tuple[float, str]] = ()


HEADING_ERROR = Quantity("heading_error_deg", "Angle of estimated to true Sun", "angle [deg]", 0.1)
POINTING_ERROR = Quantity(
    "pointing_error_deg",
    "Angle of array normal to true Sun",
    "angle [deg]",
    0.1,
    ((30.0, "30°"), (15.0, "15°")),
)
RATE = Quantity("rate_deg_s", "Body rate", "rate [deg/s]", 1e-3)
RATE_KNOWLEDGE = Quantity("rate_knowledge_deg_s", "Error of the estimated body rate", "rate [deg/s]", 1e-3)


def write_against_time(quantity: Quantity, variants: Sequence[Variant], shadow: Shadow, file: Path) -> Path:
    """Mean (solid) and 95th percentile (dotted) over the cases, one set of axes for each variant."""
    with style():
        figure = new_figure(8.6, 0.6 + 2.6 * len(variants))
        all_axes = figure.subplots(len(variants), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
        for axes, variant in zip(all_axes, variants, strict=True):
            shade_dark(axes, shadow.time_s / _MINUTE, shadow.dark)
            for label, colour, configuration in variant.entries:
                line = curve(variant.percentiles, configuration, quantity.name)
                minutes = line.time_s / _MINUTE
                axes.plot(minutes, np.maximum(line.mean, quantity.least), color=colour, label=label)
                axes.plot(
                    minutes, np.maximum(line.p95, quantity.least), color=colour, linestyle=(0, (1, 1.2)), alpha=0.8
                )
            for value, text in quantity.levels:
                level_line(axes, value, text)
            logarithmic(axes)
            axes.set_ylabel(quantity.label)
            axes.set_title(f"{quantity.title}, {variant.name}")
        legend(all_axes[0], title="solid: mean\ndotted: 95 %\nshaded: eclipse")
        all_axes[-1].set_xlim(0.0, float(shadow.time_s[-1]) / _MINUTE)
        all_axes[-1].set_xlabel("time [min]")
        return save(figure, file)


_PARTS = (
    ("converging_s", "all sunlight"),
    ("converging_first_s", "first pass"),
    ("converging_later_s", "after eclipse"),
)


def write_converging(variants: Sequence[Variant], limits_min: Sequence[float], file: Path) -> Path:
    """Fig. 8: share of the cases that spent longer than a time converging; one row of axes for each variant."""
    with style():
        figure = new_figure(9.6, 0.6 + 2.7 * len(variants))
        grid = figure.subplots(len(variants), len(_PARTS), sharex=True, sharey=True, squeeze=False)
        for row, variant in zip(grid, variants, strict=True):
            for axes, (name, title) in zip(row, _PARTS, strict=True):
                for limit in limits_min:
                    axes.axvline(limit, color=GREY, linewidth=0.8, linestyle=(0, (4, 3)))
                for label, colour, configuration in variant.entries:
                    _draw_exceedance(axes, column(variant.cases, configuration, name) / _MINUTE, colour, label)
                axes.set_xscale("symlog", linthresh=0.5, linscale=0.5)
                logarithmic(axes)
                axes.set_title(title.capitalize() if axes is not row[0] else f"{variant.name.capitalize()}, {title}")
            row[0].set_ylabel("share of cases [%]")
        ticks = [0.0, 0.5, 1.0, *limits_min]
        grid[-1, 0].set_xticks(ticks, [f"{tick:g}" for tick in ticks])
        grid[-1, 0].xaxis.set_minor_locator(NullLocator())
        grid[-1, 0].set_xlim(0.0, 60.0)
        for axes in grid[-1]:
            axes.set_xlabel("spent longer than [min]")
        legend(grid[0, -1], title="dashed: limits\nof the paper")
        return save(figure, file)


def _draw_exceedance(axes: Axes, minutes: np.ndarray, colour: str, label: str) -> None:
    """Percentage of the values above each value; one that is unknown is above all."""
    count = max(len(minutes), 1)
    times = np.sort(minutes[np.isfinite(minutes)])
    above = 100.0 * (len(minutes) - np.arange(len(times) + 1)) / count
    # the last step ends at the longest time: a logarithmic axis has no zero
    steps = np.concatenate(([0.0], times))
    axes.step(steps, np.where(above > 0.0, above, np.nan), where="post", color=colour, label=label)
    if len(times):
        axes.plot(times[-1], 100.0 / count, "o", color=colour, markersize=3.0)
