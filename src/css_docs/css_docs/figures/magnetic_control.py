# SPDX-License-Identifier: Apache-2.0
"""From tip-off to the Sun with rods alone."""

from matplotlib.figure import Figure

from css_analysis.figure_style import BLUE, ORANGE, new_figure
from css_docs.figures._flights import DEG, finish, fly

CAPTION = """\
`cubesat_3u_safe`: a 3U cubesat from a tip-off at 10 deg/s with three torque rods, a magnetometer and six cells.
B-dot takes the rate away within an orbit (grey: shadow), the spin then turns the arrays to the Sun."""


def figure() -> Figure:
    """Rate and pointing over two orbits."""
    log = fly("cubesat_3u_safe", "mission.duration=11400")
    figure = new_figure(7.5, 4.2)
    above, below = figure.subplots(2, 1, sharex=True)
    time = log.time(log.having("truth"))
    above.plot(time, DEG * log.rate, color=BLUE)
    finish(above, log, "body rate [deg/s]")
    above.set_xlabel("")
    below.plot(time, DEG * log.pointing_error, color=ORANGE)
    finish(below, log, "array normal to Sun [deg]", logarithmically=False)
    return figure
