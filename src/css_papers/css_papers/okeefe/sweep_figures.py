# SPDX-License-Identifier: Apache-2.0
"""Heading error and time to power positive against errors of the cells."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from css_analysis.figure_style import legend, new_figure, save, style
from css_monte_carlo.study import Configuration
from css_papers.okeefe.configurations import Entry
from css_papers.okeefe.flights import Merit
from css_papers.okeefe.sweeps import Sweep, changed


class _Panel(NamedTuple):
    title: str
    label: str
    value: Callable[[Merit], float | None]


_PANELS = (
    _Panel("Heading error at the end, mean", "angle [deg]", lambda m: m.heading_error_late_deg),
    _Panel("Time to power positive, mean", "time [min]", lambda m: m.acquired_mean_min),
    _Panel("Time spent converging, mean", "time [min]", lambda m: m.converging_mean_min),
    _Panel("Cases that converge", "share [%]", lambda m: m.converged_percent),
)


def write_sweep(sweep: Sweep, entries: Sequence[Entry], merits: Mapping[Configuration, Merit], file: Path) -> Path:
    """One sweep: solid with gyro, dashed without."""
    at = [place for place, _, _ in sweep.points]
    with style():
        figure = new_figure(8.6, 5.6)
        all_axes = figure.subplots(2, 2, sharex=True).ravel()
        for axes, panel in zip(all_axes, _PANELS, strict=True):
            for label, colour, configuration in entries:
                values = [panel.value(merits[changed(configuration, change)]) for _, _, change in sweep.points]
                axes.plot(
                    at,
                    [np.nan if value is None else value for value in values],
                    color=colour,
                    linestyle="solid" if configuration.gyro else (0, (4, 2)),
                    marker="o",
                    markersize=3.5,
                    markerfacecolor=colour if configuration.gyro else "white",
                    label=label,
                )
            axes.set_ylim(bottom=0.0)
            axes.set_ylabel(panel.label)
            axes.set_title(panel.title)
        for axes in all_axes[2:]:
            axes.set_xlabel(sweep.axis)
        all_axes[-1].set_xticks(at, [label for _, label, _ in sweep.points])
        legend(all_axes[1])
        return save(figure, file)
