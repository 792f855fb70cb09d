# SPDX-License-Identifier: Apache-2.0
"""The two attitude filters of DiGregorio & Crassidis in one flight."""

import numpy as np
from matplotlib.figure import Figure

from css_analysis.estimate_errors import attitude_errors, attitude_sigmas
from css_analysis.figure_style import COLOURS, new_figure
from css_analysis.flight_series import error_series
from css_docs.figures._flights import finish, fly

CAPTION = """\
Attitude of a tumbling cubesat with four photodiodes in a plane, by the Sun as a vector of lit cells and by the
voltages one by one; `cubesat_vmm`, case 2. Four cells in a plane make no vector: that filter lives on the field."""


def figure() -> Figure:
    """Both errors and bounds."""
    four = "cells.normals=1,0,0,-1,0,0,0,1,0,0,-1,0"
    log = fly("cubesat_vmm", four, "mission.case=2")
    figure = new_figure(7.5, 3.2)
    axes = figure.subplots()
    names = {"attitude_vector": "Sun vector", "attitude_voltage": "voltages"}
    for (name, label), colour in zip(names.items(), COLOURS, strict=False):
        steps, errors, _ = attitude_errors(log, name)
        axes.plot(*error_series(log, steps, errors), color=colour, label=label)
        at, sigmas = attitude_sigmas(log, name)
        bound = error_series(log, at, 3.0 * np.asarray(sigmas))
        axes.plot(*bound, color=colour, linestyle="--", linewidth=0.8, label=f"{label}, 3 sigma")
    finish(axes, log, "attitude error [deg]")
    return figure
