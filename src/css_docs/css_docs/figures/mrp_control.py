# SPDX-License-Identifier: Apache-2.0
"""Closed loop from the tumble to the Sun."""

from matplotlib.figure import Figure

from css_analysis.figure_style import COLOURS, level_line, new_figure
from css_docs.figures._flights import DEG, finish, fly

CAPTION = """\
Angle from array normal to Sun of five cases of `okeefe_2013`, from tumbles of up to 2 deg/s about each axis: wheels
saturate in the slew, the deadband of 15 deg ends it."""


def figure() -> Figure:
    """Pointing of five cases."""
    figure = new_figure(7.5, 3.0)
    axes = figure.subplots()
    for case, colour in zip(range(5), COLOURS, strict=False):
        log = fly("okeefe_2013", f"mission.case={case}", "mission.duration=240")
        axes.plot(log.time(log.having("truth")), DEG * log.pointing_error, color=colour, label=f"case {case}")
    level_line(axes, 30.0, "power positive")
    level_line(axes, 15.0, "deadband")
    finish(axes, log, "pointing error [deg]", logarithmically=False)
    return figure
