# SPDX-License-Identifier: Apache-2.0
"""What the sensors of the spacecraft say in one control cycle: cells in the light of Sun and Earth, gyro, magnetometer.

A study calls `sense`, a node the part of it that is its own, so that both have the same readings.
"""

from typing import NamedTuple

import numpy as np

from css_common.attitude import mrp_to_dcm
from css_common.kernel import kernel
from css_common.random_streams import RandomKey
from css_common.vectors import Mat3, Vec3, multiply
from css_environment.albedo import albedo_output
from css_environment.ephemeris import EnvironmentState
from css_sim import gyro, latency, magnetometer, sun_cells
from css_sim.fault_effects import GYRO, MAGNETOMETER, is_silent
from css_sim.gyro import Gyro, GyroErrors
from css_sim.latency import Latency, Moment, remember, sensed
from css_sim.magnetometer import Magnetometer
from css_sim.rigid_body import RotationState
from css_sim.sun_cells import SunCells

_NOTHING: Vec3 = (0.0, 0.0, 0.0)


class Sensors(NamedTuple):
    """What is common to all cases, from one scripted event to the next."""

    cells: SunCells
    earthlit: bool  # the Earth lights the cells
    gyro: Gyro
    gyro_on: bool
    magnetometer: Magnetometer
    magnetometer_on: bool
    field_divider: int  # cycles from one measurement of the field to the next; 0: there is none, or nobody listens
    late: bool  # some sensor reads what was before its stamp
    cell_latency: Latency
    gyro_latency: Latency
    gyro_since: int  # cycle at which the gyro was switched on
    field_latency: Latency
    field_since: int


class CellsOfCase(NamedTuple):
    """The cells of one case, with room for the light of the Earth on them."""

    cells: np.ndarray  # (N,) of cell_errors.CELL
    faults: np.ndarray  # (F,) of fault_effects.FAULT, where all sensors are those of their sorts
    albedo: np.ndarray  # (N,) written
    work: np.ndarray  # (224,) of `css_environment.albedo.new_workspace`, written


class SensorsOfCase(NamedTuple):
    """The sensors of one case."""

    key: RandomKey
    cells: CellsOfCase
    gyro: GyroErrors
    field_bias_b: Vec3  # [T]
    lags: Vec3  # [cycles] of cells, gyro and magnetometer
    history: np.ndarray  # (L,) of latency.MOMENT, written
    healthy: np.ndarray  # (N,) outputs of the cells without their faults, written where some unit has faults


class Readings(NamedTuple):
    """What gyro and magnetometer say in one cycle, and what only the simulation knows of it."""

    gyro_b: Vec3  # [rad/s]
    gyro_valid: bool
    field_b: Vec3  # [T]
    field_valid: bool  # measured in this cycle
    gyro_bias_b: Vec3  # [rad/s] the true bias, of a gyro that is off too


@kernel
def sense_cells(
    p: SunCells,
    case: CellsOfCase,
    key: RandomKey,
    step: int,
    dcm_bn: Mat3,
    sun_b: Vec3,
    intensity: float,
    earthlit: bool,
    light,
    voltages_out,
) -> int:
    """Outputs of all cells; returns the mask of cells at their upper limit.

    Args:
        step: number of the control cycle, which with `key` fixes all draws.
        sun_b: unit vector to the Sun.
        intensity: solar flux relative to 1 AU times the visible fraction of the disc [-].
        light: (192,) light of the Earth, of `css_environment.albedo_vector.earth_light_sources`; read if `earthlit`.
        voltages_out: (N,) outputs [-], written.
    """
    if earthlit:
        albedo_output(light, case.cells, p.screen, p.cos_half_view, dcm_bn, case.work, case.albedo)
    return sun_cells.sample(p, case.cells, case.faults, key, step, sun_b, intensity, case.albedo, voltages_out)


@kernel
def sense_field(p: Magnetometer, bias_b: Vec3, faults, key: RandomKey, step: int, dcm_bn: Mat3, field_n: Vec3) -> Vec3:
    """Measured field in b [T] of a true field in n [T]."""
    return magnetometer.measure(p, bias_b, faults, key, step, multiply(dcm_bn, field_n))


@kernel
def draw_lags(p: Sensors, key: RandomKey) -> Vec3:
    """Latencies of one case [cycles]: cells, gyro, magnetometer."""
    return (
        latency.draw_lag(p.cell_latency, key, latency.CELLS),
        latency.draw_lag(p.gyro_latency, key, latency.GYRO),
        latency.draw_lag(p.field_latency, key, latency.MAGNETOMETER),
    )


@kernel
def sense(
    p: Sensors,
    case: SensorsOfCase,
    step: int,
    dcm_bn: Mat3,
    sun_b: Vec3,
    rotation: RotationState,
    environment: EnvironmentState,
    light,
    voltages_out,
) -> Readings:
    """Readings of all sensors; arguments as of `sense_cells`, and the true attitude and rate at the stamp."""
    intensity = environment.solar_flux * environment.illumination
    omega_bn_b, field_n, field_dcm_bn = rotation.omega_bn_b, environment.field_n, dcm_bn
    if p.late:
        now = Moment(rotation.sigma_bn, omega_bn_b, environment.sun_n, intensity, field_n)
        remember(case.history, step, now)
        if case.lags[0] > 0.0:
            of_cells = sensed(case.history, step, case.lags[0], now, 0)
            dcm_bn, intensity = mrp_to_dcm(of_cells.sigma_bn), of_cells.intensity
            sun_b = multiply(dcm_bn, of_cells.sun_n)
        omega_bn_b = sensed(case.history, step, case.lags[1], now, p.gyro_since).omega_bn_b
        if case.lags[2] > 0.0:
            of_field = sensed(case.history, step, case.lags[2], now, p.field_since)
            field_dcm_bn, field_n = mrp_to_dcm(of_field.sigma_bn), of_field.field_n
    sense_cells(p.cells, case.cells, case.key, step, dcm_bn, sun_b, intensity, p.earthlit, light, voltages_out)
    if case.cells.faults.shape[0] > 0:
        none, albedo = case.cells.faults[:0], case.cells.albedo
        sun_cells.sample(p.cells, case.cells.cells, none, case.key, step, sun_b, intensity, albedo, case.healthy)
    bias_b = gyro.bias_at(p.gyro, case.gyro, case.key, step)
    gyro_b, field_b = _NOTHING, _NOTHING
    gyro_speaks = p.gyro_on and not is_silent(case.cells.faults, GYRO, step)
    if gyro_speaks:
        gyro_b = gyro.read(p.gyro, case.gyro, bias_b, case.cells.faults, case.key, step, omega_bn_b)
    measured = p.field_divider > 0 and p.magnetometer_on and step % p.field_divider == 0
    measured = measured and not is_silent(case.cells.faults, MAGNETOMETER, step)
    if measured:
        field_b = sense_field(
            p.magnetometer, case.field_bias_b, case.cells.faults, case.key, step, field_dcm_bn, field_n
        )
    return Readings(gyro_b, gyro_speaks, field_b, measured, bias_b)
