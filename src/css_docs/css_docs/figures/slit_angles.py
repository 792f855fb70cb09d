# SPDX-License-Identifier: Apache-2.0
"""What whole counts make of the Sun angle."""

import math

import numpy as np
from matplotlib.figure import Figure

from css_analysis.figure_style import COLOURS, legend, logarithmic, new_figure
from css_estimation.spin.slit_angles import quantum

CAPTION = """\
Sun angle that one count of COUNT stands for, at 6 Hz of spin and three frequencies of the timer. The slits are
finest toward 60 deg, where they end."""

_INCLINATION = math.radians(30.0)
_SPIN_HZ = 6.0


def figure() -> Figure:
    """One line a frequency."""
    figure = new_figure(7.5, 3.0)
    axes = figure.subplots()
    for frequency, colour in zip((1e4, 1e5, 1e6), COLOURS, strict=False):
        turn = round(frequency / _SPIN_HZ)
        counts = np.unique(np.linspace(0, 0.49 * turn, 200).astype(int))
        arcs = np.pi * counts / turn
        angles = np.degrees(np.arctan(np.sin(arcs) / math.tan(_INCLINATION)))
        steps = [math.degrees(quantum(int(count), turn, _INCLINATION)) for count in counts]
        axes.plot(angles, steps, color=colour, label=f"{frequency / 1e3:g} kHz")
    logarithmic(axes)
    axes.set_xlabel("Sun angle [deg]")
    axes.set_ylabel("one count [deg]")
    legend(axes)
    return figure
