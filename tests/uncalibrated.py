# SPDX-License-Identifier: Apache-2.0
"""Flights of a tumbling spacecraft with cells that nobody has calibrated, and what their cells truly are."""

from typing import NamedTuple

import numpy as np

from css_calibration.calibration import Calibration
from css_calibration.cell_fit_model import DARK, GAIN, TILT_1, TILT_2, nominal_parameters, normals_of
from css_calibration.recorded import Recorded, recorded_of
from css_common.codec import codec_of
from css_common.component import Cycles
from css_common.message_columns import Columns, columns_of
from css_common.mission import Mission, mission_from_text
from css_common.mission_file import dump_sections
from css_common.random_streams import random_key
from css_common.vectors import axes_across
from css_monte_carlo.direct_flight import fly_and_keep
from css_msgs.msg import SpacecraftState
from css_sim import cell_errors, cell_screen, gyro, magnetometer

MISSION = """
/**:
  ros__parameters:
    extends: okeefe_sun_filter
    mission: {name: uncalibrated, duration: 3000.0, period: 1.0}
    wheels: {fitted: false}
    graph:
      nodes: [css_sim/dynamics, css_sim/css_array, css_sim/gyro, css_sim/magnetometer,
              css_estimation/ekf, css_estimation/sun_filter]
    criteria: {heading_error_mean_deg: {max: 90.0}, power_positive_s: {max: 1.0e+9}}
css_array:
  ros__parameters: {misalignment_deg: 3.0, scale_cell_error: 0.1, bias: 0.01, output_low: -1.0}
gyro:
  ros__parameters: {bias_deg_h: 30.0}
magnetometer:
  ros__parameters: {bias_nt: 500.0}
sun_filter:
  ros__parameters: {health: {enabled: false}}
ekf:
  ros__parameters: {health: {enabled: false}}
"""
"""Eight cells in a tumble of up to 2 deg/s about each axis, no control, clouds unknown, half an orbit of Sun."""

TOPICS = ("truth", "css/voltages", "gyro/imu", "mag/field")


class Flown(NamedTuple):
    """A flight in this process."""

    mission: Mission
    columns: dict[str, Columns]  # by topic
    recorded: Recorded


def mission_of(*overrides: str) -> Mission:
    """The mission with changes."""
    return mission_from_text(MISSION, "uncalibrated", overrides)


def flown(mission: Mission) -> Flown:
    """One flight of it."""
    topics = [topic for topic in TOPICS if topic in mission.topics]
    kept = fly_and_keep(mission, topics)
    columns = {topic: columns_of(codec_of(mission.topics[topic]), kept[topic]) for topic in topics}
    by_type = {mission.topics[topic]: columns[topic] for topic in topics}
    return Flown(mission, columns, recorded_of(mission.name, mission, by_type, []))


def without_truth(flight: Flown) -> Recorded:
    """What the spacecraft itself knows: no truth, the place by its orbit model."""
    by_type = {flight.mission.topics[t]: c for t, c in flight.columns.items() if t != "truth"}
    return recorded_of(flight.mission.name, flight.mission, by_type, [])


def sun_alone(flight: Flown) -> Recorded:
    """What imported telemetry with the Sun in the body has: cells, rates, Sun, no place."""
    given = flight.mission.parameters["/**"]
    known = {key: value for key, value in given.items() if key.split(".")[0] in ("mission", "cells")}
    mission = mission_from_text(dump_sections({"/**": known}), "telemetry")
    kinds = flight.mission.topics
    by_type = {kinds[t]: c for t, c in flight.columns.items() if t not in ("truth", "mag/field")}
    return recorded_of("telemetry", mission, by_type | {SpacecraftState: sun_truth(flight)}, [])


def sun_truth(flight: Flown) -> Columns:
    """A truth that knows the Sun in the body alone, as that of imported telemetry does."""
    truth, sun_b = flight.columns["truth"], flight.recorded.sun_b
    assert sun_b is not None
    zeros = np.zeros((len(truth), 3))
    return Columns(**vars(truth) | {"sun_n": sun_b, "sigma_bn": zeros, "r_n": zeros})


def true_parameters(mission: Mission) -> np.ndarray:
    """(N, 5) of the cells that flew, the loss that is drawn at each step by its mean."""
    values = mission.node("css_array").values
    nominal = cell_errors.nominal_cells(values.cells.normals, cell_screen.cell_sides(values))
    cells = nominal.copy()
    key = random_key(values.mission.seed, values.mission.case)
    cell_errors.draw_cells(cell_errors.error_model(values), key, nominal, cells)
    parameters = nominal_parameters(len(cells))
    parameters[:, GAIN] = cells["gain"] * (1.0 - 0.5 * values.degradation)
    parameters[:, DARK] = cells["bias"]
    for i, cell in enumerate(cells):
        n0, n = values.cells.normals[i], np.array([cell["nx"], cell["ny"], cell["nz"]])
        for k, axis in zip((TILT_1, TILT_2), axes_across.py_func(tuple(n0.tolist())), strict=True):
            parameters[i, k] = (n @ np.array(axis)) / (n @ n0)
    return parameters


def true_common(mission: Mission) -> np.ndarray:
    """(12,) gyro bias [rad/s], bias of the field [T], scale and soft iron of the sensors that flew."""
    key = random_key(mission.values.mission.seed, mission.values.mission.case)
    common = np.zeros(12)
    common[:3] = gyro.draw_errors(gyro.parameters(mission.node("gyro").values), key).bias_b
    common[3:6] = magnetometer.draw_bias(magnetometer.parameters(mission.node("magnetometer").values), key)
    return common


def measured(flight: Flown, parameters: np.ndarray, normals_b: np.ndarray) -> list[str]:
    """Overrides by which flight software knows cells of such parameters (N, 5) and normals (N, 3)."""
    lists = {"normals": normals_b.ravel(), "scales": parameters[:, GAIN], "darks": parameters[:, DARK]}
    return [f"cells.measured.{key}={','.join(f'{v:.9g}' for v in values)}" for key, values in lists.items()]


def heading_errors(flight: Flown, estimator: str, overrides: list[str], after_s: float) -> np.ndarray:
    """Angles [rad] of an estimator's heading to the true Sun, in full sunlight, from a time of the flight on."""
    mission = flight.mission.with_overrides(overrides)
    node = mission.node(estimator)
    component = node.component(estimator, node.values)
    cells, truth = flight.columns["css/voltages"], flight.columns["truth"]
    columns = {"cells": cells, "gyro": flight.columns["gyro/imu"]}
    rows = np.arange(len(cells))
    out = component.cycle_through(Cycles(cells.stamp_ns, columns, {"cells": rows, "gyro": rows}))
    assert out is not None
    estimates, sun_b = out["estimate"], flight.recorded.sun_b
    assert sun_b is not None
    counts = (truth.illumination > 0.999) & (flight.recorded.time >= after_s) & (estimates.validity != 0)
    a, b = estimates.sun_b[counts], sun_b[counts]
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.sum(a * b, axis=1))


def error_ratios(flight: Flown, c: Calibration) -> np.ndarray:
    """(N, 5) errors of parameters over their standard deviations, NaN where they were not told."""
    off = c.fit.parameters - true_parameters(flight.mission)
    told = c.observed & (c.sigma > 0.0)
    return np.where(told, off / np.where(told, c.sigma, 1.0), np.nan)


def aid_error_ratios(flight: Flown, c: Calibration) -> np.ndarray:
    """The same of gyro and magnetometer, as many as were told."""
    true = true_common(flight.mission)
    common = c.common()
    if common is not None:
        return np.asarray((common[0] - true) / common[1])
    aids = [(b.x - t) / b.sigma for b, t in ((c.bias, true[:3]), (c.of_field, true[3:])) if b is not None]
    return np.concatenate(aids) if aids else np.zeros(0)


def mean_headings(flight: Flown, c: Calibration, estimator: str, after_s: float) -> tuple[float, float, float]:
    """Mean heading errors [rad] of an estimator from a time on: nominal cells, calibrated ones, known ones; or NaN."""
    true, nominal = true_parameters(flight.mission), c.data.normals_b
    # the mean loss is part of the scales
    unit = ["sun_filter.response.scale=1.0"] if estimator == "sun_filter" else []
    runs = ([], *([*measured(flight, p, normals_of(nominal, p)), *unit] for p in (c.parameters, true)))
    errors = [heading_errors(flight, estimator, overrides, after_s) for overrides in runs]
    before, after, known = (float(e.mean()) if len(e) else float("nan") for e in errors)
    return before, after, known
