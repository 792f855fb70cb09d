# SPDX-License-Identifier: Apache-2.0
"""The compiled loop over cases and steps: sample sensors, estimate, control, propagate.

Each of the four is the function that the node calls, with the values that the node would have from its topics, so
that a case flies as on the graph, bit for bit. A Sun estimator, an attitude filter and a control law fly if the mission
has them (`dispatch_by_type`); without control the spacecraft flies free.
"""

from typing import Any, NamedTuple

import numpy as np

from css_common.attitude import mrp_to_dcm
from css_common.kernel import kernel, study_kernel
from css_common.random_streams import RandomKey
from css_common.vectors import Vec3, mat3, multiply, row
from css_environment.albedo_vector import PATCHES, point_source
from css_environment.moving_clouds import CloudMotion, Clouds, is_cloud_step, reflect
from css_estimation.sun.heading_dispatch import estimate_heading
from css_estimation.sun.sky_table import sky_at
from css_estimation.sun.sun_heading import Aiding
from css_monte_carlo.dispatch_by_type import command, estimate_attitude, note_estimate, tally
from css_monte_carlo.failing_units import NOTHING_FAILS, Failing, Uncertainty, evident_cells, failing_units
from css_monte_carlo.named_faults import note_kinds
from css_monte_carlo.state_table import keep_state, state_of
from css_monte_carlo.step_truth import Truth
from css_monte_carlo.surroundings import Surroundings, gather_light_at, state_at
from css_sensors.corrections import Corrections, correct_cells, heard_field, heard_rate
from css_sim import gyro, magnetometer, tachometer
from css_sim.actuator_faults import Felt, spoil_actuators
from css_sim.disturbances import with_dipole
from css_sim.rigid_body import RigidBody, RotationState, sum_along_axes, wheel_speeds
from css_sim.sensing import CellsOfCase, Sensors, SensorsOfCase, draw_lags, sense
from css_sim.spacecraft import Spacecraft, advance
from css_sim.tachometer import Tachometer
from sunpoint_control.held_field import HeldField


class Vehicle(NamedTuple):
    """What is common to all cases, from one scripted event to the next."""

    period_ns: int
    sensors: Sensors
    uncertainty: Uncertainty  # of healthy cells
    own_earth: bool  # each case has its own reflectivities
    albedo_model: int  # of `albedo_vector`
    clouds: Clouds
    heading_hears_field: bool
    control_hears_field: bool
    attitude_hears_field: bool
    heading_hears_wheels: bool
    attitude_hears_wheels: bool
    heading: Any  # parameters of the Sun estimator, or None
    attitude: Any  # parameters of the attitude filter, or None
    heading_corrections: Corrections  # of readings, by a calibration that the Sun estimator knows
    attitude_corrections: Corrections  # the same of the attitude filter
    control_corrections: Corrections  # and of the control law, which hears the field
    control: Any  # parameters of the control law, or None
    craft: Spacecraft  # nominal
    tachometer: Tachometer
    array_normal_b: Vec3


class Cases(NamedTuple):
    """What differs from case to case, one row each."""

    seed_low: np.uint32
    seed_high: np.uint32
    numbers: np.ndarray  # (C,) uint32
    inertia: np.ndarray  # (C, 3, 3) [kg m^2]
    inertia_inverse: np.ndarray  # (C, 3, 3)
    dipole: np.ndarray  # (C, 3) [A m^2] residual
    wheels: np.ndarray  # (C, N) of rigid_body.WHEEL
    wheel_momentum: np.ndarray  # (C, N) [N m s] advanced in place
    torque: np.ndarray  # (C, N) [N m] room for what is commanded
    applied: np.ndarray  # (C, N) [N m]
    speeds: np.ndarray  # (C, N) [rad/s]
    rod_dipole: np.ndarray  # (C, M) [A m^2]
    voltages: np.ndarray  # (C, n) [V]
    corrected: np.ndarray  # (C, n) [V] room for what a calibration makes of them
    healthy: np.ndarray  # (C, n) [V] what the cells of cases with faults would read without them
    rates: np.ndarray  # (C, 3) [rad/s] omega_bn_b after the last block
    cells: np.ndarray  # (C, n) of cell_errors.CELL
    faults: np.ndarray  # (C, F) of fault_effects.FAULT, of all sensors and actuators
    felt_wheels: np.ndarray  # (C, N) of rigid_body.WHEEL, room for wheels with faults
    felt_torque: np.ndarray  # (C, N) [N m] room for what they are then commanded
    felt_dipole: np.ndarray  # (C, M) [A m^2] the same of the rods
    reflectivity: np.ndarray  # (C, rows, columns), written where clouds move; (0, 0, 0) when the Earth is common
    cloud_fields: np.ndarray  # (C, F, rows, columns) of clouds that move; else (0, 0, 0, 0)
    cloud_motion: np.ndarray  # (C, 3) of `moving_clouds.CloudMotion`
    light: np.ndarray  # (C, 192) room for the light of an own Earth
    albedo: np.ndarray  # (C, n) room for the light of the Earth on each cell
    work: np.ndarray  # (C, 224) room for its sum
    history: np.ndarray  # (C, L) of latency.MOMENT, what late sensors still sense


class CaseState(NamedTuple):
    """What a flight carries from step to step, beside the wheel momenta; None for parts that it does not have."""

    rotation: RotationState
    heading: Any
    heading_memory: Any  # arrays of the Sun estimator, advanced in place
    attitude: Any
    memory: Any  # the same of the attitude filter
    control: Any
    control_memory: Any  # arrays of the control law
    field_b: Vec3  # [T] last measurement of the field
    field_step: int  # when it was taken; -1: never


TRUTH_COLUMNS = 6
"""Columns of a trace that hold sigma_bn and omega_bn_b; the estimate, dipoles, wheel torques and speeds follow."""


@study_kernel
def fly_block(
    v: Vehicle, cases: Cases, states, like, around: Surroundings, marks, first_step: int, tallies: Any, trace
) -> None:
    """Flies all cases through one block of steps.

    Args:
        states, like: rows of the `StateTable` of the cases, advanced, and one of its states.
        marks: (K,) of `case_tallies.step_marks` for the steps of the block.
        first_step: number of the first step of the block.
        tallies: of `case_tallies` or of `attitude_tallies`: which estimate is measured.
        trace: (C, steps, columns) or (0, 0, 0): every step's values for comparisons.
    """
    # nodes divide the time between stamps, the plant multiplies its period: the last bit may differ
    since_s = v.period_ns / 1e9
    cycle_s = v.period_ns * 1e-9
    for c in range(cases.numbers.shape[0]):
        state, voltages = state_of(states, c, like), cases.voltages[c]
        momentum, torque, applied = cases.wheel_momentum[c], cases.torque[c], cases.applied[c]
        speeds, dipole = cases.speeds[c], cases.rod_dipole[c]
        inertia, inverse = mat3(cases.inertia[c]), mat3(cases.inertia_inverse[c])
        faults, felt = cases.faults[c], Felt(cases.felt_wheels[c], cases.felt_torque[c], cases.felt_dipole[c])
        # chosen once for a case: flights without faults are as fast as if there were none
        wheels, felt_torque, felt_dipole = cases.wheels[c], torque, dipole
        if faults.shape[0] > 0:
            wheels, felt_torque, felt_dipole = felt
        body = RigidBody(inertia, inverse, wheels, v.craft.body.substeps)
        disturbances = with_dipole(v.craft.disturbances, row(cases.dipole, c))
        craft = Spacecraft(body, disturbances, v.craft.rod_axes_b, v.craft.rod_max_dipoles, v.craft.disturbed)
        key = RandomKey(cases.seed_low, cases.seed_high, cases.numbers[c])
        cells = CellsOfCase(cases.cells[c], faults, cases.albedo[c], cases.work[c])
        gyro_errors = gyro.draw_errors(v.sensors.gyro, key)
        field_bias_b = magnetometer.draw_bias(v.sensors.magnetometer, key)
        lags = draw_lags(v.sensors, key)
        sensors = SensorsOfCase(key, cells, gyro_errors, field_bias_b, lags, cases.history[c], cases.healthy[c])
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
                elapsed_ns = step * v.period_ns
                if v.clouds.moving and (k == 0 or is_cloud_step(elapsed_ns, v.period_ns)):
                    motion = CloudMotion(*row(cases.cloud_motion, c))
                    reflect(v.clouds, motion, cases.cloud_fields[c], elapsed_ns, cases.reflectivity[c])
                own_light(v.albedo_model, around, k, environment, cases.reflectivity[c], light)
            read = sense(v.sensors, sensors, step, dcm_bn, sun_b, rotation, environment, light, voltages)
            if read.field_valid:
                field_b, field_step = read.field_b, step
            wheel_speeds(craft.body, rotation.omega_bn_b, momentum, speeds)
            tachometer.report(v.tachometer, faults, key, step, speeds)
            sky = sky_at(around.sky, around.sky_light, k)
            field_is_new = v.heading_hears_field and read.field_valid
            heard, known = voltages, v.heading_corrections
            if known.of_cells:
                heard = cases.corrected[c]
                correct_cells(known, voltages, heard)
            gyro_b = heard_rate(known, read.gyro_b, read.gyro_valid)
            heard_b = heard_field(known, field_b, field_is_new)
            aiding = Aiding(gyro_b, read.gyro_valid, heard_b, field_is_new, speeds, v.heading_hears_wheels, sky)
            heading_state, heading = estimate_heading(
                v.heading, heading_state, state.heading_memory, since_s, heard, aiding
            )
            # the node of a filter counts from its first stamp, that of a Sun estimator begins with a period
            filtered_s = since_s if step > 0 else 0.0
            sky = sky_at(around.attitude_sky, around.attitude_sky_light, k)
            field_is_new = v.attitude_hears_field and read.field_valid
            heard, known = voltages, v.attitude_corrections
            if known.of_cells:
                heard = cases.corrected[c]
                correct_cells(known, voltages, heard)
            gyro_b = heard_rate(known, read.gyro_b, read.gyro_valid)
            heard_b = heard_field(known, read.field_b, field_is_new)
            aiding = Aiding(gyro_b, read.gyro_valid, heard_b, field_is_new, speeds, v.attitude_hears_wheels, sky)
            attitude_state, attitude = estimate_attitude(
                v.attitude, attitude_state, state.memory, filtered_s, heard, aiding, around, k
            )
            # as the control node has it: the last measurement, for as long as the next may be on its way
            field_valid = v.control_hears_field and field_step >= 0 and step - field_step < v.sensors.field_divider
            heard_b = heard_field(v.control_corrections, field_b, field_step >= 0)
            held = HeldField(heard_b, field_valid, v.control_hears_field and read.field_valid)
            control_state, left = command(
                v.control, control_state, state.control_memory, since_s, heading, speeds, held, torque, dipole
            )
            failing = NOTHING_FAILS
            if faults.shape[0] > 0:
                failing = failing_units(faults, step)
                evident = evident_cells(v.uncertainty, failing.cells, cases.healthy[c], voltages, cases.albedo[c])
                failing = Failing(failing.cells, evident, failing.wheels, failing.rods, failing.sensors)
            momentum_b = sum_along_axes(craft.body.wheels, momentum)
            truth = Truth(
                rotation.sigma_bn,
                rotation.omega_bn_b,
                sun_b,
                v.array_normal_b,
                momentum_b,
                read.gyro_bias_b,
                sum_of_sizes(dipole),
                failing,
            )
            tally(tallies, c, step, marks[k], truth, heading, attitude, state.memory, left)
            if faults.shape[0] > 0:
                note_kinds(tallies, c, heading, state.heading_memory, failing.cells, faults, step, voltages)
            if trace.shape[0] > 0:
                _note(trace[c, step], rotation, dipole, torque, speeds)
                note_estimate(tallies, heading, attitude, trace[c, step, TRUTH_COLUMNS:])
            if faults.shape[0] > 0:
                spoil_actuators(faults, key, step, cases.wheels[c], torque, dipole, felt)
            rotation, _, _ = advance(craft, rotation, momentum, felt_torque, felt_dipole, environment, cycle_s, applied)
        for i in range(3):
            cases.rates[c, i] = rotation.omega_bn_b[i]
        after = CaseState(
            rotation,
            heading_state,
            state.heading_memory,
            attitude_state,
            state.memory,
            control_state,
            state.control_memory,
            field_b,
            field_step,
        )
        keep_state(states, c, like, after)


@kernel
def sum_of_sizes(values) -> float:
    """Sum of an array (N,) without its signs."""
    total = 0.0
    for value in values:
        total += abs(value)
    return total


@kernel
def own_light(albedo_model, around, k, e, reflectivity, light_out) -> None:
    """Light of an Earth of its own (192,), written."""
    if albedo_model == PATCHES:
        gather_light_at(around.views, k, reflectivity, light_out)
    else:
        point_source(albedo_model, e.r_n, e.sun_n, e.solar_flux, e.dcm_en, reflectivity, light_out)


@kernel
def _note(out, rotation, dipole, torque, speeds) -> None:
    for i in range(3):
        out[i], out[3 + i] = rotation.sigma_bn[i], rotation.omega_bn_b[i]
    wheels, rods = torque.shape[0], dipole.shape[0]
    end = out.shape[0]
    for i in range(rods):
        out[end - 2 * wheels - rods + i] = dipole[i]
    for i in range(wheels):
        out[end - 2 * wheels + i], out[end - wheels + i] = torque[i], speeds[i]
