# SPDX-License-Identifier: Apache-2.0
"""A gyro that fails, with the layer that finds it and without."""

import numpy as np
from matplotlib.figure import Figure

from css_analysis.figure_style import COLOURS, new_figure
from css_docs.figures._flights import DEG, finish, fly

CAPTION = """\
The x axis of the gyro gets a bias of 1 deg/s at 120 s: error of the rate that the Sun estimator gives the control,
with the health of the gyro and without; `okeefe_2013`, case 7."""


def figure() -> Figure:
    """Two flights."""
    common = ("mission.case=7", "mission.duration=400", "gyro.faults=['gyro.x bias 1.0 from 120']")
    figure = new_figure(7.5, 3.0)
    axes = figure.subplots()
    shown = {"health on": (), "health off": ("ekf.health.enabled=false",)}
    for (label, changes), colour in zip(shown.items(), COLOURS, strict=False):
        log = fly("okeefe_2013", *common, *changes)
        estimate, truth = log.estimates["ekf"], log.having("truth")
        mine, theirs = log.truth_rows(estimate)
        off = np.linalg.norm(estimate.omega_bn_b[mine] - truth.omega_bn_b[theirs], axis=1)
        axes.plot(log.time(estimate)[mine], DEG * off, color=colour, label=label)
    finish(axes, log, "rate error [deg/s]")
    return figure
