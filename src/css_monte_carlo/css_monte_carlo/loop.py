# SPDX-License-Identifier: Apache-2.0
"""The compiled loop over cases and steps: sample sensors, estimate, control, propagate.

Each of the four is the function that the node calls, with the values that the node would have from its topics, so
that a case flies as on the graph, bit for bit.
"""

from typing import Any, NamedTuple

import numpy as np

from css_common.attitude import mrp_to_dcm
from css_common.kernel import kernel, outer_kernel
from css_common.random_streams import RandomKey
from css_common.vectors import Mat3, Vec3, mat3, multiply
from css_environment.albedo import albedo_output
from css_environment.albedo_vector import PATCHES, point_source
from css_environment.earth_light import gather_light
from css_environment.ephemeris import EnvironmentState
from css_estimation.sun.sun_heading import Aiding
from css_monte_carlo.case_tallies import Tallies, tally_step
from css_monte_carlo.estimator_dispatch import estimate
from css_monte_carlo.surroundings import Surroundings, state_at, view_at
from css_sim import gyro, magnetometer, sun_cells
from css_sim.disturbances import Disturbances
from css_sim.gyro import Gyro
from css_sim.magnetometer import Magnetometer
from css_sim.rigid_body import RigidBody, RotationState, sum_along_axes, wheel_speeds
from css_sim.spacecraft import Spacecraft, advance
from css_sim.sun_cells import SunCells
from sunpoint_control import sun_pointing_control
from sunpoint_control.sun_pointing_control import ControlParameters, ControlState


class Vehicle(NamedTuple):
    """What is common to all cases, from one scripted event to the next."""

    period_ns: int
    cells: SunCells
    albedo: bool
    own_earth: bool  # each case has its own reflectivities
    albedo_model: int  # of `albedo_vector`
    gyro: Gyro
    gyro_on: bool
    magnetometer: Magnetometer
    magnetometer_on: bool
    field_divider: int  # steps from one measurement of the field to the next; 0: nobody listens
    estimator_hears_field: bool
    control_hears_field: bool
    estimator: Any
    control: ControlParameters
    disturbances: Disturbances
    disturbed: bool
    rod_axes_b: np.ndarray  # (M, 3)
    rod_max_dipole: float  # [A m^2]
    substeps: int
    array_normal_b: Vec3


class Cases(NamedTuple):
    """What differs from case to case, one row each."""

    seed_low: np.uint32
    seed_high: np.uint32
    numbers: np.ndarray  # (C,) uint32
    inertia: np.ndarray  # (C, 3, 3) [kg m^2]
    inertia_inverse: np.ndarray  # (C, 3, 3)
    wheels: np.ndarray  # (C, N) of rigid_body.WHEEL
    wheel_momentum: np.ndarray  # (C, N) [N m s] advanced in place
    cells: np.ndarray  # (C, n) of cell_errors.CELL
    faults: np.ndarray  # (C, F) of cell_faults.FAULT
    reflectivity: np.ndarray  # (C, rows, columns); (0, 0, 0) when the Earth is common
    light: np.ndarray  # (C, 192) room for the light of an own Earth
    work: np.ndarray  # (C, 224) room for the albedo


class CaseState(NamedTuple):
    """What a flight carries from step to step, beside the wheel momenta."""

    rotation: RotationState
    estimator: Any
    control: ControlState
    field_b: Vec3  # [T] last measurement of the field
    field_step: int  # when it was taken; -1: never


TRACE = ("sigma_bn", "omega_bn_b", "sun_b", "omega_estimated_b")
"""Triples of a trace; wheel torques and speeds follow."""


def trace_columns(wheels: int) -> int:
    """Columns of a trace for so many wheels."""
    return 3 * len(TRACE) + 2 * wheels


@kernel
def case_key(cases: Cases, c: int) -> RandomKey:
    """Key of the draws of a case."""
    return RandomKey(cases.seed_low, cases.seed_high, cases.numbers[c])


@outer_kernel
def _case_spacecraft(v: Vehicle, cases: Cases, c: int) -> Spacecraft:
    body = RigidBody(mat3(cases.inertia[c]), mat3(cases.inertia_inverse[c]), cases.wheels[c], v.substeps)
    return Spacecraft(body, v.disturbances, v.rod_axes_b, v.rod_max_dipole, v.disturbed)


@kernel
def _measured_field(
    v: Vehicle, bias_b: Vec3, key: RandomKey, step: int, dcm_bn: Mat3, environment: EnvironmentState, state: CaseState
) -> tuple[Vec3, int]:
    """Last measurement and its step; -1: none yet."""
    if v.field_divider == 0 or not v.magnetometer_on or step % v.field_divider != 0:
        return state.field_b, state.field_step
    return magnetometer.measure(v.magnetometer, bias_b, key, step, multiply(dcm_bn, environment.field_n)), step


@outer_kernel
def fly_block(
    v: Vehicle, cases: Cases, states, around: Surroundings, marks, first_step: int, tallies: Tallies, trace
) -> None:
    """Flies all cases through one block of steps.

    Args:
        states: list of the `CaseState` of each case, advanced.
        marks: (K,) of `case_figures.step_marks` for the steps of the block.
        first_step: number of the first step of the block.
        trace: (C, K, `trace_columns`) or (0, 0, 0): every step's values for comparisons.
    """
    for c in range(cases.numbers.shape[0]):
        states[c] = _fly_case(v, cases, c, states[c], around, marks, first_step, tallies, trace)


@outer_kernel
def _fly_case(v, cases, c, state, around, marks, first_step, tallies, trace):
    key = case_key(cases, c)
    craft = _case_spacecraft(v, cases, c)
    gyro_errors = gyro.draw_errors(v.gyro, key)
    field_bias_b = magnetometer.draw_bias(v.magnetometer, key)
    cells, faults, momentum, work = cases.cells[c], cases.faults[c], cases.wheel_momentum[c], cases.work[c]
    n, wheels = cells.shape[0], momentum.shape[0]
    voltages, albedo = np.zeros(n), np.zeros(n)
    torque, applied, speeds = np.zeros(wheels), np.zeros(wheels), np.zeros(wheels)
    dipole = np.zeros(v.rod_axes_b.shape[0])
    since_s = v.period_ns / 1e9
    cycle_s = v.period_ns * 1e-9
    for k in range(marks.shape[0]):
        step = first_step + k
        environment = state_at(around.states, k)
        rotation = state.rotation
        dcm_bn = mrp_to_dcm(rotation.sigma_bn)
        sun_b = multiply(dcm_bn, environment.sun_n)
        if v.albedo:
            if v.own_earth:
                light = cases.light[c]
                if v.albedo_model == PATCHES:
                    gather_light(view_at(around.views, k), cases.reflectivity[c], light)
                else:
                    e = environment
                    point_source(v.albedo_model, e.r_n, e.sun_n, e.solar_flux, e.dcm_en, cases.reflectivity[c], light)
            else:
                light = around.light[k]
            albedo_output(light, cells, v.cells.screen, v.cells.cos_half_view, dcm_bn, work, albedo)
        flux = environment.solar_flux * environment.illumination
        sun_cells.sample(v.cells, cells, faults, key, step, sun_b, flux, albedo, voltages)
        gyro_b = (0.0, 0.0, 0.0)
        if v.gyro_on:
            gyro_b = gyro.measure(v.gyro, gyro_errors, key, step, rotation.omega_bn_b)
        field_b, field_step = _measured_field(v, field_bias_b, key, step, dcm_bn, environment, state)
        aiding = Aiding(gyro_b, v.gyro_on, field_b, v.estimator_hears_field and field_step == step)
        estimator, heading = estimate(v.estimator, state.estimator, since_s, voltages, aiding, around.predicted[k])
        wheel_speeds(craft.body, rotation.omega_bn_b, momentum, speeds)
        # as the control node has it: the last measurement, for as long as the next may be on its way
        field_valid = v.control_hears_field and field_step >= 0 and step - field_step < v.field_divider
        control, _ = sun_pointing_control.step(
            v.control,
            state.control,
            since_s,
            heading.sun_b,
            heading.validity,
            heading.eclipse,
            heading.omega_bn_b,
            heading.rate_source,
            speeds,
            field_b,
            field_valid,
            torque,
            dipole,
        )
        momentum_b = sum_along_axes(craft.body.wheels, momentum)
        tally_step(tallies, c, step, marks[k], sun_b, rotation.omega_bn_b, v.array_normal_b, momentum_b, heading)
        if trace.shape[0] > 0:
            _note(trace[c, k], rotation, heading.sun_b, heading.omega_bn_b, torque, speeds)
        rotation, _, _ = advance(craft, rotation, momentum, torque, dipole, environment, cycle_s, applied)
        state = CaseState(rotation, estimator, control, field_b, field_step)
    return state


@kernel
def _note(out, rotation, sun_b, omega_estimated_b, torque, speeds) -> None:
    for i in range(3):
        out[i], out[3 + i] = rotation.sigma_bn[i], rotation.omega_bn_b[i]
        out[6 + i], out[9 + i] = sun_b[i], omega_estimated_b[i]
    wheels = torque.shape[0]
    for i in range(wheels):
        out[12 + i], out[12 + wheels + i] = torque[i], speeds[i]
