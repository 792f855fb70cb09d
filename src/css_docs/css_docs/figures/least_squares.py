# SPDX-License-Identifier: Apache-2.0
"""Errors of estimators without memory, over the sky."""

import numpy as np
from matplotlib.figure import Figure

from css_analysis.figure_style import COLOURS, legend, new_figure
from css_common.kernel import typed_call
from css_common.mission import load_mission
from css_common.schema import Values
from css_estimation.nodes.wavg import Wavg
from css_estimation.nodes.wls import Wls
from css_estimation.sun.cell_layout import cell_layout
from css_estimation.sun.sun_estimator import SunEstimator
from css_papers.best.headings import AT_REST, directions, outputs_of

CAPTION = """\
Share of the sky in which the heading errs by less, dual pyramid of O'Keefe & Schaub with ideal cells. Least squares
is exact where three cells see the Sun; where one or two do, dark cells tell what is left."""

_COUNT = 2000


def figure() -> Figure:
    """Weighted average, least squares, and least squares with the dark cells."""
    mission = load_mission("okeefe_2013")
    shown: dict[str, tuple[type[SunEstimator], tuple[str, ...]]] = {
        "weighted average": (Wavg, ()),
        "least squares": (Wls, ()),
        "with dark cells": (Wls, ("wls.use_dark_cells=true",)),
    }
    figure = new_figure(7.5, 3.2)
    axes = figure.subplots()
    share = (np.arange(_COUNT) + 0.5) / _COUNT
    for (label, (kind, changes)), colour in zip(shown.items(), COLOURS, strict=False):
        nodes = "graph.nodes=css_sim/dynamics,css_sim/css_array,css_estimation/wls"
        values = mission.with_overrides([nodes, "graph.estimator=wls", *changes]).node_of(kind, "wls").values
        errors = _errors_deg(kind, values)
        axes.plot(np.sort(errors), share, color=colour, label=f"{label}, mean {errors.mean():.1f} deg")
    axes.set_xlabel("heading error [deg]")
    axes.set_ylabel("share of the sky [-]")
    axes.set_xlim(0.0, 60.0)
    axes.set_ylim(0.0, 1.0)
    legend(axes)
    return figure


def _errors_deg(kind: type[SunEstimator], values: Values) -> np.ndarray:
    algorithm, layout = kind.algorithm, cell_layout(values)
    p, step = algorithm.parameters(values), typed_call(algorithm.step)
    errors = np.empty(_COUNT)
    for k, sun_b in enumerate(directions(_COUNT)):
        state, memory = algorithm.initial_state(p), algorithm.initial_memory(p)
        _, heading = step(p, state, memory, 0.1, outputs_of(layout, sun_b), AT_REST)
        estimate = np.array(heading.sun_b)
        errors[k] = np.degrees(np.arctan2(np.linalg.norm(np.cross(estimate, sun_b)), estimate @ sun_b))
    return errors
