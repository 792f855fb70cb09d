# SPDX-License-Identifier: Apache-2.0
"""Light and field along an orbit."""

import numpy as np
from matplotlib.figure import Figure

from css_analysis.figure_style import BLUE, GREY, ORANGE, legend, new_figure
from css_common.mission import load_mission
from css_environment.mission_environment import MissionEnvironment

CAPTION = """\
`okeefe_2013`: strength of the magnetic field (IGRF-14) over one orbit, shadow in grey, and the visible fraction of
the Sun's disc as it sets, against the cylindrical shadow."""


def figure() -> Figure:
    """Field over the orbit, light over the dusk."""
    values = load_mission("okeefe_2013").values
    environment = MissionEnvironment(values, field=True)
    time = np.arange(0.0, 5560.0, 10.0)
    states = [environment.at(float(t)) for t in time]
    light = np.array([state.illumination for state in states])
    figure = new_figure(7.5, 3.0)
    left, right = figure.subplots(1, 2)
    left.plot(time / 60.0, [1e6 * np.linalg.norm(state.field_n) for state in states], color=BLUE)
    left.fill_between(
        time / 60.0, 0.0, 1.0, where=light < 0.5, color=GREY, alpha=0.3, transform=left.get_xaxis_transform()
    )
    left.set_xlabel("time [min]")
    left.set_ylabel("field [uT]")
    dusk = time[np.flatnonzero(np.diff(light) < 0.0)[0]]
    fine = np.arange(dusk - 5.0, dusk + 20.0, 0.05)
    cylinder = MissionEnvironment(values, field=False, conical_shadow=False)
    right.plot(fine - dusk, [environment.at(float(t)).illumination for t in fine], color=BLUE, label="cone")
    right.plot(fine - dusk, [cylinder.at(float(t)).illumination for t in fine], color=ORANGE, label="cylinder")
    right.set_xlabel("time [s]")
    right.set_ylabel("visible fraction of the Sun [-]")
    legend(right)
    return figure
