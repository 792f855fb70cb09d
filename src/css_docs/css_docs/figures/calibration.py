# SPDX-License-Identifier: Apache-2.0
"""What a calibration of a tumble finds of the cells."""

import numpy as np
from matplotlib.figure import Figure

from css_analysis.figure_style import BLUE, GREY, VERMILION, legend, new_figure
from css_calibration.calibration import calibrate
from css_calibration.cell_fit_model import GAIN
from css_calibration.recorded import recorded_of
from css_common.codec import codec_of
from css_common.message_columns import columns_of
from css_common.mission import Mission, mission_from_text
from css_common.random_streams import random_key
from css_monte_carlo.direct_flight import fly_and_keep
from css_sim import cell_errors, cell_screen

CAPTION = """\
Scale of each cell by the calibration of a tumble of 40 minutes without control, three sigma, and the true one;
errors of 10 % from cell to cell, a loss of up to 5 % at every step (2.5 % on average), under clouds that the
calibration does not know."""

_MISSION = """
/**:
  ros__parameters:
    extends: okeefe_sun_filter
    mission: {name: uncalibrated, duration: 2400.0, period: 1.0}
    wheels: {fitted: false}
    graph: {nodes: [css_sim/dynamics, css_sim/css_array, css_sim/gyro, css_sim/magnetometer]}
    criteria: {heading_error_mean_deg: {max: 180.0}, power_positive_s: {max: 1.0e+9}}
css_array:
  ros__parameters: {misalignment_deg: 2.0, scale_cell_error: 0.1, bias: 0.01, output_low: -1.0}
"""
_TOPICS = ("truth", "css/voltages", "gyro/imu", "mag/field")
_MEAN_LOSS = 0.025


def figure() -> Figure:
    """Estimated and true scales."""
    mission = mission_from_text(_MISSION, "uncalibrated")
    kept = fly_and_keep(mission, _TOPICS)
    columns = {mission.topics[t]: columns_of(codec_of(mission.topics[t]), kept[t]) for t in _TOPICS}
    result = calibrate(recorded_of(mission.name, mission, columns, []))
    true = _true_scales(mission) * (1.0 - _MEAN_LOSS)
    at = np.arange(len(true))
    figure = new_figure(7.5, 3.0)
    axes = figure.subplots()
    axes.axhline(1.0, color=GREY, linewidth=0.8)
    axes.errorbar(
        at, result.parameters[:, GAIN], 3.0 * result.sigma[:, GAIN], fmt="o", color=BLUE, markersize=4, capsize=3,
        label="calibrated",
    )  # fmt: skip
    axes.plot(at, true, "x", color=VERMILION, markersize=7, label="true")
    axes.set_xlabel("cell")
    axes.set_ylabel("scale [-]")
    legend(axes)
    return figure


def _true_scales(mission: Mission) -> np.ndarray:
    """(N,) scales of the case, without losses."""
    values = mission.node("css_array").values
    nominal = cell_errors.nominal_cells(values.cells.normals, cell_screen.cell_sides(values))
    cells = nominal.copy()
    key = random_key(values.mission.seed, values.mission.case)
    cell_errors.draw_cells(cell_errors.error_model(values), key, nominal, cells)
    return cells["gain"]
