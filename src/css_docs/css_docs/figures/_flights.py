# SPDX-License-Identifier: Apache-2.0
"""Flights that figures show, flown in this process, and what is drawn of them."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from css_analysis.estimate_errors import heading_errors, heading_sigmas
from css_analysis.figure_style import COLOURS, legend, logarithmic, new_figure, shade_dark
from css_analysis.flight_log import FlightLog
from css_analysis.flight_series import dark_times, error_series
from css_common.mission import load_mission
from css_monte_carlo.direct_flight import fly_checked

DEG = 180.0 / np.pi


def fly(mission: str, *overrides: str) -> FlightLog:
    """A mission of the project with values changed."""
    return fly_checked(load_mission(mission, overrides))


def with_nodes(*nodes: str, of: str = "okeefe_2013") -> str:
    """The override that adds estimators to the graph of a mission."""
    entries = [*load_mission(of).shared["graph.nodes"], *(f"css_estimation/{node}" for node in nodes)]
    return f"graph.nodes={','.join(entries)}"


def headings(shown: Mapping[str, tuple[FlightLog, str]], bounds: Sequence[str] = ()) -> Figure:
    """Heading errors against time.

    Args:
        shown: flight and estimator by label.
        bounds: labels of those whose own bound of three sigma is drawn too.
    """
    figure = new_figure(7.5, 3.2)
    axes = figure.subplots()
    for (label, (log, name)), colour in zip(shown.items(), COLOURS, strict=False):
        axes.plot(*error_series(log, *heading_errors(log, name)), color=colour, label=label)
        if label in bounds:
            steps, sigmas = heading_sigmas(log, name)
            time, bound = error_series(log, steps, 3.0 * sigmas)
            axes.plot(time, bound, color=colour, linestyle="--", linewidth=0.8, label=f"{label}, 3 sigma")
    finish(axes, next(iter(shown.values()))[0], "heading error [deg]")
    return figure


def finish(axes: Axes, log: FlightLog, ordinate: str, logarithmically: bool = True) -> None:
    """Shadow, axes and legend of a panel against time [s]."""
    dark = dark_times(log)
    if dark is not None:
        shade_dark(axes, *dark)
    if logarithmically:
        logarithmic(axes)
    axes.set_xlabel("time [s]")
    axes.set_ylabel(ordinate)
    legend(axes)
