# SPDX-License-Identifier: Apache-2.0
"""Sun angles of the spinning payload as the slits tell them."""

import numpy as np
from matplotlib.figure import Figure

from css_analysis.figure_style import BLUE, ORANGE, legend, new_figure
from css_common.attitude import mrp_to_dcm
from css_common.mission import load_mission
from css_monte_carlo.direct_flight import fly_and_keep

CAPTION = """\
Two seconds of `esprit_2006` after the booms: Sun angle of the true motion, and what three pulses a turn make of it.
Coning moves the axis while the Sun goes from slit to slit, so that they miss it by half a degree and more."""

_FROM_S, _TO_S = 78.0, 80.0


def figure() -> Figure:
    """True angle as a line, measured ones as points."""
    mission = load_mission("esprit_2006", [f"mission.duration={_TO_S}", "coning.legs=[69.18, 80.0]"])
    kept = fly_and_keep(mission, ("truth", "slit_sun_angle/sun_angle"))
    truth = [m for m in kept["truth"] if (m.stamp_ns - mission.epoch_ns) * 1e-9 >= _FROM_S]
    sun_b = np.array([np.array(mrp_to_dcm(tuple(m.sigma_bn))) @ m.sun_n for m in truth])
    time = np.array([m.stamp_ns - mission.epoch_ns for m in truth]) * 1e-9
    new = [m for m in kept["slit_sun_angle/sun_angle"] if m.validity == 2]
    at = np.array([(m.stamp_ns - mission.epoch_ns) * 1e-9 - m.age for m in new])
    chosen = at >= _FROM_S
    figure = new_figure(7.5, 3.0)
    axes = figure.subplots()
    axes.plot(time, np.degrees(np.arcsin(sun_b[:, 2])), color=BLUE, label="true motion")
    angles = np.degrees([m.sun_angle for m in new])
    axes.plot(at[chosen], angles[chosen], "o", markersize=3.5, color=ORANGE, label="by the slits")
    axes.set_xlabel("time [s]")
    axes.set_ylabel("Sun angle [deg]")
    legend(axes)
    return figure
