# SPDX-License-Identifier: Apache-2.0
"""The compiled loop over cases and steps: sample sensors, estimate, control, propagate.

Each of the four is the function that the node calls, with the values that the node would have from its topics, so
that a case flies as on the graph, bit for bit. A Sun estimator, an attitude filter and a control law fly if the mission
has them (`dispatch_by_type`); without control the spacecraft flies free.
"""

from typing import Any, NamedTuple

import numpy as np

from css_common.attitude import mrp_to_dcm
from css_common.kernel import kernel, outer_kernel, steps_kernel
from css_common.random_streams import RandomKey
from css_common.vectors import Vec3, mat3, multiply
from css_environment.albedo_vector import PATCHES, point_source
from css_estimation.sun.sun_heading import Aiding
from css_monte_carlo.dispatch_by_type import command, estimate_attitude, estimate_heading, note_estimate, tally
from css_monte_carlo.step_truth import Truth
from css_monte_carlo.surroundings import Surroundings, gather_light_at, state_at
from css_sim import gyro, magnetometer
from css_sim.disturbances import Disturbances
from css_sim.rigid_body import RigidBody, RotationState, sum_along_axes, wheel_speeds
from css_sim.sensing import CellsOfCase, Sensors, SensorsOfCase, sense
from css_sim.spacecraft import Spacecraft, advance


class Vehicle(NamedTuple):
    """What is common to all cases, from one scripted event to the next."""

    period_ns: int
    sensors: Sensors
    own_earth: bool  # each case has its own reflectivities
    albedo_model: int  # of `albedo_vector`
    heading_hears_field: bool
    control_hears_field: bool
    heading: Any  # parameters of the Sun estimator, or None
    attitude: Any  # parameters of the attitude filter, or None
    control: Any  # parameters of the control law, or None
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
    albedo: np.ndarray  # (C, n) room for the light of the Earth on each cell
    work: np.ndarray  # (C, 224) room for its sum


class CaseState(NamedTuple):
    """What a flight carries from step to step, beside the wheel momenta; None for parts that it does not have."""

    rotation: RotationState
    heading: Any
    attitude: Any
    memory: Any  # arrays of the attitude filter, advanced in place
    control: Any
    field_b: Vec3  # [T] last measurement of the field
    field_step: int  # when it was taken; -1: never


class Actuators(NamedTuple):
    """Arrays of the N wheels and M rods of one case."""

    momentum: np.ndarray  # (N,) [N m s] advanced in place
    torque: np.ndarray  # (N,) [N m] commanded
    applied: np.ndarray  # (N,) [N m]
    speeds: np.ndarray  # (N,) [rad/s]
    dipole: np.ndarray  # (M,) [A m^2] commanded


TRUTH_COLUMNS = 6
"""Columns of a trace that hold sigma_bn and omega_bn_b; the measured estimate, wheel torques and speeds follow."""


@kernel
def case_key(cases: Cases, c: int) -> RandomKey:
    """Key of the draws of a case."""
    return RandomKey(cases.seed_low, cases.seed_high, cases.numbers[c])


@outer_kernel
def _case_spacecraft(v: Vehicle, cases: Cases, c: int) -> Spacecraft:
    body = RigidBody(mat3(cases.inertia[c]), mat3(cases.inertia_inverse[c]), cases.wheels[c], v.substeps)
    return Spacecraft(body, v.disturbances, v.rod_axes_b, v.rod_max_dipole, v.disturbed)


@outer_kernel
def _case_sensors(v: Vehicle, cases: Cases, c: int) -> SensorsOfCase:
    key = case_key(cases, c)
    cells = CellsOfCase(cases.cells[c], cases.faults[c], cases.albedo[c], cases.work[c])
    gyro_errors = gyro.draw_errors(v.sensors.gyro, key)
    return SensorsOfCase(key, cells, gyro_errors, magnetometer.draw_bias(v.sensors.magnetometer, key))


@outer_kernel
def fly_block(
    v: Vehicle, cases: Cases, states, around: Surroundings, marks, first_step: int, tallies: Any, trace
) -> None:
    """Flies all cases through one block of steps.

    Args:
        states: list of the `CaseState` of each case, advanced.
        marks: (K,) of `case_tallies.step_marks` for the steps of the block.
        first_step: number of the first step of the block.
        tallies: of `case_tallies` or of `attitude_tallies`: which estimate is measured.
        trace: (C, K, columns) or (0, 0, 0): every step's values for comparisons.
    """
    for c in range(cases.numbers.shape[0]):
        states[c] = _fly_case(v, cases, c, states[c], around, marks, first_step, tallies, trace)


@outer_kernel
def _fly_case(v, cases, c, state, around, marks, first_step, tallies, trace):
    wheels = cases.wheel_momentum.shape[1]
    actuators = Actuators(
        cases.wheel_momentum[c], np.zeros(wheels), np.zeros(wheels), np.zeros(wheels), np.zeros(v.rod_axes_b.shape[0])
    )
    craft, sensors, voltages = _case_spacecraft(v, cases, c), _case_sensors(v, cases, c), np.zeros(cases.cells.shape[1])
    rotation, heading, attitude, control, field_b, field_step = _fly_steps(
        v, craft, sensors, actuators, cases, c, state, around, marks, first_step, voltages, tallies, trace
    )
    return CaseState(rotation, heading, attitude, state.memory, control, field_b, field_step)


@steps_kernel
def _fly_steps(v, craft, sensors, actuators, cases, c, state, around, marks, first_step, voltages, tallies, trace):
    """The steps of a block, apart so that no array is counted as a reference; returns the state but the memory."""
    torque, dipole, speeds, momentum = actuators.torque, actuators.dipole, actuators.speeds, actuators.momentum
    # nodes divide the time between stamps, the plant multiplies its period: the last bit may differ
    since_s = v.period_ns / 1e9
    cycle_s = v.period_ns * 1e-9
    rotation, field_b, field_step = state.rotation, state.field_b, state.field_step
    heading_state, attitude_state, control_state = state.heading, state.attitude, state.control
    for k in range(marks.shape[0]):
        step = first_step + k
        environment = state_at(around.states, k)
        dcm_bn = mrp_to_dcm(rotation.sigma_bn)
        sun_b = multiply(dcm_bn, environment.sun_n)
        light = around.light[min(k, around.light.shape[0] - 1)]
        if v.own_earth:
            light = cases.light[c]
            _own_light(v.albedo_model, around, k, environment, cases.reflectivity[c], light)
        read = sense(v.sensors, sensors, step, dcm_bn, sun_b, rotation.omega_bn_b, environment, light, voltages)
        if read.field_valid:
            field_b, field_step = read.field_b, step
        aiding = Aiding(read.gyro_b, read.gyro_valid, field_b, v.heading_hears_field and read.field_valid)
        heading_state, heading = estimate_heading(
            v.heading, heading_state, since_s, voltages, aiding, around.predicted[k]
        )
        # the node of a filter counts from its first stamp, that of a Sun estimator begins with a period
        filtered_s = since_s if step > 0 else 0.0
        aiding = Aiding(read.gyro_b, read.gyro_valid, read.field_b, read.field_valid)
        attitude_state, attitude = estimate_attitude(
            v.attitude, attitude_state, state.memory, filtered_s, voltages, aiding, around, k
        )
        wheel_speeds(craft.body, rotation.omega_bn_b, momentum, speeds)
        # as the control node has it: the last measurement, for as long as the next may be on its way
        field_valid = v.control_hears_field and field_step >= 0 and step - field_step < v.sensors.field_divider
        control_state = command(
            v.control, control_state, since_s, heading, speeds, field_b, field_valid, torque, dipole
        )
        momentum_b = sum_along_axes(craft.body.wheels, momentum)
        truth = Truth(rotation.sigma_bn, rotation.omega_bn_b, sun_b, v.array_normal_b, momentum_b, read.gyro_bias_b)
        tally(tallies, c, step, marks[k], truth, heading, attitude, state.memory)
        if trace.shape[0] > 0:
            _note(trace[c, k], rotation, torque, speeds)
            note_estimate(tallies, heading, attitude, trace[c, k, TRUTH_COLUMNS:])
        rotation, _, _ = advance(craft, rotation, momentum, torque, dipole, environment, cycle_s, actuators.applied)
    return rotation, heading_state, attitude_state, control_state, field_b, field_step


@kernel
def _own_light(albedo_model, around, k, e, reflectivity, light_out) -> None:
    """Light of an Earth of its own (192,), written."""
    if albedo_model == PATCHES:
        gather_light_at(around.views, k, reflectivity, light_out)
    else:
        point_source(albedo_model, e.r_n, e.sun_n, e.solar_flux, e.dcm_en, reflectivity, light_out)


@kernel
def _note(out, rotation, torque, speeds) -> None:
    for i in range(3):
        out[i], out[3 + i] = rotation.sigma_bn[i], rotation.omega_bn_b[i]
    wheels = torque.shape[0]
    end = out.shape[0]
    for i in range(wheels):
        out[end - 2 * wheels + i], out[end - wheels + i] = torque[i], speeds[i]
