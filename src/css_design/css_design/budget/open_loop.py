# SPDX-License-Identifier: Apache-2.0
"""A mission's sensors and estimator along a flight that is given: same truth, other readings."""

from typing import Any, NamedTuple

import numpy as np

from css_common.attitude import mrp_to_dcm
from css_common.kernel import study_kernel
from css_common.random_streams import random_key
from css_common.vectors import multiply, row
from css_environment.albedo import new_workspace
from css_estimation.health import watched
from css_estimation.sun.heading_loop import loop_of, new_headings
from css_estimation.sun.sun_heading import VALIDITY_NONE, Measured
from css_monte_carlo.chunk import fly_cases
from css_monte_carlo.loop import TRUTH_COLUMNS, Cases, Vehicle, own_light
from css_monte_carlo.mission_flight import MissionFlight
from css_monte_carlo.surroundings import BLOCK_STEPS, state_at
from css_sim import gyro, magnetometer
from css_sim.rigid_body import RotationState
from css_sim.sensing import CellsOfCase, SensorsOfCase, draw_lags, sense


class Path(NamedTuple):
    """A flight that was flown."""

    case: int
    truth: np.ndarray  # (M, 6) sigma_bn and omega_bn_b
    speeds: np.ndarray  # (M, W) [rad/s] of the wheels
    sun_b: np.ndarray  # (M, 3) true direction to the Sun
    counted: np.ndarray  # (M,) sunlit and after the acquisition


class Estimates(NamedTuple):
    """What an estimator made of readings along a path."""

    sun_b: np.ndarray  # (M, 3)
    known: np.ndarray  # (M,) bool: there is an estimate


def flown_path(flight: MissionFlight, case: int) -> tuple[Path, Estimates]:
    """Flies a case; its path, and what its estimator said in the loop."""
    flown = fly_cases(flight, np.array([case]), max(1, flight.steps), traced=True)
    trace = flown.trace[0]
    wheels = flight.mission.values.wheels
    count = len(wheels.axes) if wheels.fitted else 0
    speeds = trace[:, trace.shape[1] - count :].copy()
    acquired = int(flown.tallies.totals[0]["acquired_step"])
    said = trace[:, TRUTH_COLUMNS : TRUTH_COLUMNS + 3].copy()
    path = path_of(flight, case, trace[:, :TRUTH_COLUMNS].copy(), speeds, acquired)
    return path, Estimates(said, np.any(said != 0.0, axis=1))


def path_of(flight: MissionFlight, case: int, truth: np.ndarray, speeds: np.ndarray, acquired: int) -> Path:
    """A path of true attitudes and rates (M, 6) from a flight's epoch on; `acquired`: its step, negative for never."""
    steps = np.arange(len(truth))
    states = flight.surroundings.states(0, len(truth))
    sun_b = np.empty((len(truth), 3))
    _suns_in_body(truth, states["sun_n"].copy(), sun_b)
    lit = states["illumination"] > 0.5
    counted = lit & (steps >= acquired) if acquired >= 0 else np.zeros(len(truth), bool)
    return Path(case, truth, speeds, sun_b, counted)


@study_kernel
def _suns_in_body(truth, sun_n, out) -> None:
    for k in range(truth.shape[0]):
        v = multiply(mrp_to_dcm(row(truth[:, :3], k)), row(sun_n, k))
        out[k, 0], out[k, 1], out[k, 2] = v


def readings(flight: MissionFlight, path: Path, cells: np.ndarray | None = None) -> Measured:
    """What the sensors of a mission read along a path, with the draws of its case.

    Args:
        cells: (N,) of `cell_errors.CELL` in the place of those of the case.
    """
    vehicle, tables = _first_stretch(flight, path.case)
    count, of_cells = len(path.truth), tables.voltages.shape[1]
    measured = Measured(
        np.zeros((count, of_cells)),
        np.zeros((count, 3)),
        np.zeros(count, np.bool_),
        np.zeros((count, 3)),
        np.zeros(count, np.bool_),
        path.speeds,
        bool(vehicle.heading_hears_wheels),
    )
    key = random_key(flight.mission.values.mission.seed, path.case)
    room = CellsOfCase(
        tables.cells[0] if cells is None else cells, tables.faults[0], np.zeros(of_cells), new_workspace()
    )
    case = SensorsOfCase(
        key,
        room,
        gyro.draw_errors(vehicle.sensors.gyro, key),
        magnetometer.draw_bias(vehicle.sensors.magnetometer, key),
        draw_lags(vehicle.sensors, key),
        tables.history[0],
        tables.healthy[0],
    )
    field_b = np.zeros(3)
    for begin, end in _blocks(count):
        around = flight.surroundings.block(begin, end - begin)
        part = _rows(measured, begin, end)
        _sense_along(vehicle, tables, case, begin, around, path.truth[begin:end], field_b, part)
    return measured


@study_kernel
def _sense_along(v: Vehicle, cases: Cases, case: SensorsOfCase, first: int, around, truth, last_field_b, out) -> None:
    """Readings of a block of steps; as the loop of a study has them.

    Args:
        last_field_b: (3,) last measurement of the field, carried from block to block.
        out: `Measured` of the block, written.
    """
    for k in range(truth.shape[0]):
        environment = state_at(around.states, k)
        rotation = RotationState((truth[k, 0], truth[k, 1], truth[k, 2]), (truth[k, 3], truth[k, 4], truth[k, 5]))
        dcm_bn = mrp_to_dcm(rotation.sigma_bn)
        light = around.light[min(k, around.light.shape[0] - 1)]
        if v.own_earth:
            light = cases.light[0]
            own_light(v.albedo_model, around, k, environment, cases.reflectivity[0], light)
        sun_b = multiply(dcm_bn, environment.sun_n)
        read = sense(v.sensors, case, first + k, dcm_bn, sun_b, rotation, environment, light, out.voltages[k])
        for i in range(3):
            out.gyro_b[k, i] = read.gyro_b[i]
            if read.field_valid:
                last_field_b[i] = read.field_b[i]
            out.field_b[k, i] = last_field_b[i]
        out.gyro_valid[k] = read.gyro_valid
        out.field_valid[k] = v.heading_hears_field and read.field_valid


def estimates(flight: MissionFlight, path: Path, measured: Measured) -> Estimates:
    """What the estimator of a mission makes of readings along a path."""
    vehicle, _ = _first_stretch(flight, path.case)
    component: Any = flight.mission.node(flight.mission.values.graph.estimator).component
    algorithm = component.algorithm
    p = vehicle.heading
    state, memory = watched.initial_state(algorithm, p), watched.initial_memory(algorithm, p)
    advance = loop_of(algorithm.step.__module__)
    since_s = np.full(BLOCK_STEPS, flight.mission.period_ns / 1e9)
    sun_b, known = np.zeros((len(path.truth), 3)), np.zeros(len(path.truth), bool)
    for begin, end in _blocks(len(path.truth)):
        around = flight.surroundings.block(begin, end - begin)
        part = _rows(measured, begin, end)
        out = new_headings(end - begin)
        state = advance(p, state, memory, since_s[: end - begin], part, around.sky, around.sky_light, out)
        sun_b[begin:end], known[begin:end] = out.sun_b, out.validity != VALIDITY_NONE
    return Estimates(sun_b, known)


def _rows(measured: Measured, begin: int, end: int) -> Measured:
    """Some of the cycles."""
    voltages, gyro_b, gyro_valid, field_b, field_valid, wheel_speeds, wheels_valid = measured
    rows = slice(begin, end)
    return Measured(
        voltages[rows],
        gyro_b[rows],
        gyro_valid[rows],
        field_b[rows],
        field_valid[rows],
        wheel_speeds[rows],
        wheels_valid,
    )


def cells_of_case(flight: MissionFlight, case: int) -> np.ndarray:
    """(N,) of `cell_errors.CELL`: the cells of a case with their errors."""
    _, tables = _first_stretch(flight, case)
    return np.array(tables.cells[0])


def _first_stretch(flight: MissionFlight, case: int) -> tuple[Vehicle, Cases]:
    cases, _ = flight.cases(np.array([case]))
    stretch = next(flight.stretches(cases))
    return stretch.vehicle, stretch.cases


def _blocks(count: int) -> list[tuple[int, int]]:
    return [(begin, min(begin + BLOCK_STEPS, count)) for begin in range(0, count, BLOCK_STEPS)]
