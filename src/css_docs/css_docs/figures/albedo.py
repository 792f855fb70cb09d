# SPDX-License-Identifier: Apache-2.0
"""Light of the Earth along an orbit."""

import numpy as np
from matplotlib.figure import Figure

from css_analysis.figure_style import COLOURS, legend, new_figure
from css_common.mission import load_mission
from css_environment.albedo_vector import MODELS, earth_light_sources
from css_environment.earth_light import LIGHT, PATCHES, SIZE, X, Y, Z, new_earth_view, new_light
from css_environment.mission_environment import MissionEnvironment

CAPTION = """\
Light of the Earth along the orbit of `okeefe_2013`, as a cell that faces it would read: sum over the patches of
light, and the one vector of Benton; reflectivity 0.3 everywhere. Toward the terminator the vector is too bright."""


def figure() -> Figure:
    """Sums of both models."""
    environment = MissionEnvironment(load_mission("okeefe_2013").values, field=False)
    time = np.arange(0.0, 5560.0, 30.0)
    states = [environment.at(float(t)) for t in time]
    view, light, grey = new_earth_view(), new_light(), np.full((1, 1), 0.3)
    figure = new_figure(7.5, 3.0)
    axes = figure.subplots()
    for (name, model), colour in zip(sorted(MODELS.items(), key=lambda item: item[1]), COLOURS, strict=False):
        if name == "nadir":
            continue
        vectors = []
        for state in states:
            earth_light_sources(model, view, state.r_n, state.sun_n, state.solar_flux, state.dcm_en, grey, light)
            vectors.append(np.linalg.norm(_vector(light)))
        axes.plot(time / 60.0, vectors, color=colour, label=name)
    axes.set_xlabel("time [min]")
    axes.set_ylabel("light of the Earth [-]")
    legend(axes)
    return figure


def _vector(light: np.ndarray) -> np.ndarray:
    """Sum of the light of all patches as a vector in n."""
    direction_n = np.array([light[row : row + PATCHES] for row in (X, Y, Z)])
    return direction_n @ (4.0 * light[SIZE : SIZE + PATCHES] * light[LIGHT : LIGHT + PATCHES])
