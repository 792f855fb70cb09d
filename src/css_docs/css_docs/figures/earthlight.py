# SPDX-License-Identifier: Apache-2.0
"""Attitude by the light of the Earth."""

import numpy as np
from matplotlib.figure import Figure

from css_analysis.estimate_errors import attitude_errors, attitude_sigmas
from css_analysis.figure_style import BLUE, ORANGE, new_figure
from css_analysis.flight_series import error_series
from css_docs.figures._flights import finish, fly

CAPTION = """\
Error of the attitude about all three axes without a magnetometer, and its own bound; `okeefe_earthlight`, case 1.
It begins when one turn about the Sun line is left."""


def figure() -> Figure:
    """Error and bound over half an hour."""
    log = fly("okeefe_earthlight", "mission.case=1", "mission.duration=1800")
    figure = new_figure(7.5, 3.0)
    axes = figure.subplots()
    steps, errors, _ = attitude_errors(log, "earthlight")
    axes.plot(*error_series(log, steps, errors), color=BLUE, label="error")
    at, sigmas = attitude_sigmas(log, "earthlight")
    axes.plot(*error_series(log, at, 3.0 * np.asarray(sigmas)), color=ORANGE, linestyle="--", label="3 sigma")
    axes.set_ylim(bottom=0.0)
    finish(axes, log, "attitude error [deg]", logarithmically=False)
    return figure
