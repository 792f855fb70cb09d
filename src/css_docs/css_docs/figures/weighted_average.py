# SPDX-License-Identifier: Apache-2.0
"""Error of the weighted average over the sphere."""

import numpy as np
from matplotlib.figure import Figure

from css_analysis.figure_style import BLUE, GREY, ORANGE, legend, new_figure
from css_common.mission import load_mission
from css_monte_carlo.coverage import grid_of, layout_of_mission, map_cells

CAPTION = """\
Error of the weighted average against the Sun's angle from the pole of the dual pyramid of O'Keefe & Schaub, ideal
cells without light of the Earth. The bias, arctan(tan(angle) / 2) off the truth, is there with perfect cells; the
jump at 19.5 deg is that of two cells that leave their view at once."""


def figure() -> Figure:
    """Mean and largest error over all azimuths, and the bias of four lit cells."""
    mission = load_mission("okeefe_2013")
    grid = grid_of(mission)
    error = np.degrees(map_cells(layout_of_mission(mission), grid).wavg_error)
    polar = np.degrees(grid.polar)
    figure = new_figure(7.5, 3.2)
    axes = figure.subplots()
    axes.plot(polar, error.max(axis=1), color=ORANGE, label="largest")
    axes.plot(polar, error.mean(axis=1), color=BLUE, label="mean")
    biased = np.radians(polar[polar < 19.4])
    axes.plot(np.degrees(biased), np.degrees(biased - np.arctan(0.5 * np.tan(biased))), "--", color=GREY, label="bias")
    axes.set_xlabel("angle of the Sun from the array normal [deg]")
    axes.set_ylabel("heading error [deg]")
    axes.set_xlim(0.0, 180.0)
    legend(axes)
    return figure
