# SPDX-License-Identifier: Apache-2.0
"""A wheel that dies in the slew."""

from matplotlib.figure import Figure

from css_analysis.figure_style import COLOURS, new_figure
from css_docs.figures._flights import DEG, finish, fly

CAPTION = """\
Wheel 1 is dead from the start: angle to the Sun with the health of the wheels, which leaves it out and shares its
part, without it, and of the same flight with all wheels; `okeefe_2013`, case 7."""


def figure() -> Figure:
    """Three flights."""
    dead = "dynamics.faults=['wheel.1 dead']"
    shown = {
        "all wheels": (),
        "one dead, health on": (dead,),
        "one dead, health off": (dead, "mrp_control.health.enabled=false"),
    }
    figure = new_figure(7.5, 3.0)
    axes = figure.subplots()
    for (label, changes), colour in zip(shown.items(), COLOURS, strict=False):
        log = fly("okeefe_2013", "mission.case=7", "mission.duration=300", *changes)
        axes.plot(log.time(log.having("truth")), DEG * log.pointing_error, color=colour, label=label)
    finish(axes, log, "pointing error [deg]", logarithmically=False)
    return figure
