# SPDX-License-Identifier: Apache-2.0
"""Figures 3, 4, 5a and 5b of O'Keefe & Schaub 2013."""

from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes

from css_analysis.figure_style import (
    BLUE,
    GREY,
    ORANGE,
    VERMILION,
    legend,
    new_figure,
    save,
    shade_dark,
    style,
    subtitle,
)
from css_common.mission import Mission
from css_common.random_streams import random_key
from css_papers.cell_outputs import ARRAY, OrbitOutputs, Response
from css_sim.earth_reflectivity import case_reflectivity, source

_MINUTE = 60.0


def write_response(curve: Response, field_of_view_deg: float, file: Path) -> Path:
    """Fig. 3: output of a cell against the angle to the Sun."""
    with style():
        figure = new_figure(7.2, 3.4)
        axes = figure.subplots()
        axes.fill_between(
            curve.angle_deg, curve.degraded, curve.warped, color=ORANGE, alpha=0.45, linewidth=0.0,
            label="degradation, drawn every step",
        )  # fmt: skip
        axes.plot(curve.angle_deg, curve.ideal, color=GREY, linestyle=(0, (4, 2)), label="cosine, Eq. 1")
        axes.plot(curve.angle_deg, curve.warped, color=BLUE, label="warped, Eq. 16")
        for edge in (-0.5 * field_of_view_deg, 0.5 * field_of_view_deg):
            axes.axvline(edge, color=VERMILION, linewidth=0.8, linestyle="dotted")
        axes.set_xticks(np.arange(-90, 91, 30))
        axes.set_xlim(-90.0, 90.0)
        axes.set_xlabel("angle from cell normal to Sun [deg]")
        axes.set_ylabel("output [-]")
        axes.set_title("Response of a cell")
        subtitle(axes, "dotted: edge of the field of view")
        legend(axes)
        return save(figure, file)


def write_reflectivity(mission: Mission, file: Path) -> Path:
    """Fig. 4: mean and standard deviation of the reflectivity of the Earth that the flights use."""
    values = mission.node(ARRAY).values
    grid = source(values, mission.epoch_ns)
    mean = case_reflectivity(values, grid, random_key(values.mission.seed, values.mission.case))
    std = values.albedo.factor * grid.std
    used = "not used: every case flies with the mean" if values.albedo.draw == "mean" else "drawn for each case"
    with style():
        figure = new_figure(7.6, 6.6)
        above, below = figure.subplots(2, 1, sharex=True)
        _map(above, mean, 1.0, "Mean reflectivity", f"factor {values.albedo.factor:g} included")
        _map(below, std, 0.4, "Standard deviation of the reflectivity", used)
        below.set_xlabel("longitude [deg]")
        return save(figure, file)


def _map(axes: Axes, values: np.ndarray, largest: float, title: str, remark: str) -> None:
    image = axes.imshow(
        values,
        extent=(-180.0, 180.0, -90.0, 90.0),
        origin="lower",
        aspect="auto",
        interpolation="nearest",
        cmap=matplotlib.colormaps["viridis"],
        vmin=0.0,
        vmax=max(largest, float(values.max())),
    )
    axes.set_xticks(np.arange(-180, 181, 60))
    axes.set_yticks(np.arange(-90, 91, 30))
    axes.set_ylabel("latitude [deg]")
    axes.grid(False)
    axes.figure.colorbar(image, ax=axes, pad=0.02).set_label("reflectivity [-]")
    axes.set_title(title)
    subtitle(axes, remark)


def write_orbit_outputs(outputs: OrbitOutputs, title: str, file: Path) -> Path:
    """Figs. 5a and 5b: outputs of the cells over one orbit, what the Earth adds on top of the Sun's part."""
    minutes = outputs.time_s / _MINUTE
    count = outputs.total.shape[1]
    rows = -(-count // 2)
    with style():
        figure = new_figure(8.6, 0.9 + 1.15 * rows)
        all_axes = figure.subplots(rows, 2, sharex=True, sharey=True, squeeze=False).T.ravel()
        for i, axes in enumerate(all_axes[:count]):
            shade_dark(axes, minutes, outputs.illumination <= 0.5)
            axes.fill_between(minutes, 0.0, outputs.direct[:, i], color=BLUE, alpha=0.75, linewidth=0.0, label="Sun")
            axes.fill_between(
                minutes, outputs.direct[:, i], outputs.total[:, i], color=ORANGE, linewidth=0.0, label="Earth"
            )
            axes.annotate(f"cell {i}", (0.01, 0.97), xycoords="axes fraction", va="top", fontsize=8.0)
        for axes in all_axes[count:]:
            axes.set_visible(False)
        top = all_axes[0]
        top.set_xlim(0.0, float(minutes[-1]))
        top.set_ylim(0.0, 1.05 * max(1.0, float(outputs.total.max())))
        for axes in all_axes[rows - 1 :: rows]:
            axes.set_xlabel("time [min]")
        for axes in all_axes[:rows]:
            axes.set_ylabel("output [-]")
        top.set_title(title)
        subtitle(all_axes[rows], "shaded: eclipse")
        legend(all_axes[rows])
        return save(figure, file)
