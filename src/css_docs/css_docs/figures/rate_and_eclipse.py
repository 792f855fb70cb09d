# SPDX-License-Identifier: Apache-2.0
"""The rate that successive Sun vectors tell."""

import numpy as np
from matplotlib.figure import Figure

from css_analysis.figure_style import BLUE, ORANGE, new_figure
from css_docs.figures._flights import DEG, finish, fly

CAPTION = """\
Body rate without gyro: what two successive Sun vectors tell, low-passed at 0.1 Hz, and the truth across the Sun
line, which is all that they can show; the Kalman filter of `okeefe_2013`, case 7."""


def figure() -> Figure:
    """Sizes of both rates."""
    log = fly("okeefe_2013", "ekf.use_gyro=false", "mission.case=7", "mission.duration=300")
    truth, estimate = log.having("truth"), log.estimates["ekf"]
    along = np.sum(truth.omega_bn_b * log.sun_b, axis=1, keepdims=True) * log.sun_b
    figure = new_figure(7.5, 3.0)
    axes = figure.subplots()
    across = np.linalg.norm(truth.omega_bn_b - along, axis=1)
    axes.plot(log.time(truth), DEG * across, color=BLUE, label="truth, across the Sun")
    axes.plot(log.time(estimate), DEG * np.linalg.norm(estimate.omega_bn_b, axis=1), color=ORANGE, label="estimate")
    finish(axes, log, "rate [deg/s]")
    return figure
