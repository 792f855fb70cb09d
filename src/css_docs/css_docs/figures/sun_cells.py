# SPDX-License-Identifier: Apache-2.0
"""Output of a cell against the angle of the Sun."""

import math

import numpy as np
from matplotlib.figure import Figure

from css_analysis.figure_style import BLUE, GREY, ORANGE, legend, new_figure
from css_sim.sun_cells import warped

CAPTION = """\
Output of a cell against the angle of the Sun from its normal: the cosine, the response of Eq. 16, and what a loss
of up to 5 % makes of it. The view ends at 60 deg in `okeefe_2013`."""

_HALF_VIEW_DEG = 60.0
_LARGEST_LOSS = 0.05


def figure() -> Figure:
    """Three responses."""
    angle = np.linspace(0.0, _HALF_VIEW_DEG, 241)
    ideal = np.cos(np.radians(angle))
    response = np.array([warped(float(v)) for v in ideal])
    figure = new_figure(7.5, 3.0)
    axes = figure.subplots()
    axes.plot(angle, ideal, "--", color=GREY, label="cosine")
    axes.plot(angle, response, color=BLUE, label="response")
    axes.fill_between(
        angle, (1.0 - _LARGEST_LOSS) * response, response, color=ORANGE, alpha=0.35, linewidth=0.0, label="with losses"
    )
    axes.plot([_HALF_VIEW_DEG] * 2, [0.0, warped(math.cos(math.radians(_HALF_VIEW_DEG)))], color=BLUE)
    axes.plot([_HALF_VIEW_DEG, 90.0], [0.0, 0.0], color=BLUE)
    axes.set_xlabel("angle from the normal [deg]")
    axes.set_ylabel("output [-]")
    axes.set_xlim(0.0, 90.0)
    legend(axes)
    return figure
