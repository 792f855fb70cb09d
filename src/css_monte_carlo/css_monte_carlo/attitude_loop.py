# SPDX-License-Identifier: Apache-2.0
"""The compiled loop over cases and steps of a tumbling spacecraft: sample sensors, estimate attitude, propagate.

Several attitude filters run on the same data. Each part is the function that its node calls, with the values that the
node would have from its topics, so that a case flies as on the graph, bit for bit.
"""

from typing import NamedTuple

import numpy as np

from css_common.attitude import mrp_to_dcm
from css_common.kernel import kernel, outer_kernel
from css_common.random_streams import RandomKey
from css_common.vectors import Vec3, multiply
from css_environment.albedo import albedo_output
from css_estimation.attitude import attitude_ekf
from css_estimation.attitude.attitude_options import AttitudeParameters
from css_estimation.attitude.attitude_solution import AttitudeMemory, AttitudeSolution, AttitudeState
from css_estimation.attitude.flight_references import References
from css_monte_carlo.attitude_tallies import AttitudeTallies, tally_attitude
from css_monte_carlo.surroundings import Surroundings, state_at
from css_sim import gyro, magnetometer, sun_cells
from css_sim.gyro import Gyro
from css_sim.magnetometer import Magnetometer
from css_sim.rigid_body import RotationState
from css_sim.spacecraft import Spacecraft, advance
from css_sim.sun_cells import SunCells

REFERENCE = np.dtype(
    [("sun_n", np.float64, 3), ("field_n", np.float64, 3), ("intensity", np.float64), ("sunlit", np.bool_)], align=True
)
"""`References` of one step."""


class Sensors(NamedTuple):
    """What is common to all cases."""

    period_ns: int
    cells: SunCells
    albedo: bool
    gyro: Gyro
    magnetometer: Magnetometer
    field_divider: int  # steps from one measurement of the field to the next; 0: there is no magnetometer


class Tumbler(NamedTuple):
    """One case."""

    key: RandomKey
    craft: Spacecraft
    cells: np.ndarray  # (N,) of cell_errors.CELL
    faults: np.ndarray  # (F,) of cell_faults.FAULT
    work: np.ndarray  # (224,) room for the albedo


class FilterModel(NamedTuple):
    """One attitude filter, common to all cases."""

    parameters: AttitudeParameters
    references: np.ndarray  # (K,) of REFERENCE, every step of the flight
    light: np.ndarray  # (K, 192) patches of light of the Earth; (1, 192) without compensation


class FilterRun(NamedTuple):
    """One attitude filter in one case."""

    state: AttitudeState
    memory: AttitudeMemory


TRACE = ("sigma_bn", "omega_bn_b", "gyro_bias_b")
"""Triples of a trace of one filter; the true attitude follows."""

TRACE_COLUMNS = 3 * len(TRACE) + 3


@kernel
def _references_at(table, k: int) -> References:
    r = table[k]
    return References(
        (r.sun_n[0], r.sun_n[1], r.sun_n[2]),
        r.intensity,
        r.sunlit,
        (r.field_n[0], r.field_n[1], r.field_n[2]),
    )


@outer_kernel
def fly_attitude_block(
    v: Sensors,
    case: Tumbler,
    rotation: RotationState,
    models,
    runs,
    around: Surroundings,
    first_step: int,
    tallies: AttitudeTallies,
    c: int,
    trace,
) -> RotationState:
    """Flies one case through one block of steps; returns its rotation after it.

    Args:
        models: list of the `FilterModel` of each filter.
        runs: list of their `FilterRun`, advanced.
        around: surroundings of the block.
        first_step: number of its first step.
        tallies: of all filters and cases.
        c: row of the case in the tallies.
        trace: (filters, K, `TRACE_COLUMNS`) or (0, 0, 0): every step's values for comparisons.
    """
    key = case.key
    gyro_errors = gyro.draw_errors(v.gyro, key)
    field_bias_b = magnetometer.draw_bias(v.magnetometer, key)
    n = case.cells.shape[0]
    voltages, albedo = np.zeros(n), np.zeros(n)
    nothing, momentum = np.zeros(0), np.zeros(0)
    since_s, cycle_s = v.period_ns / 1e9, v.period_ns * 1e-9
    for k in range(around.states.shape[0]):
        step = first_step + k
        environment = state_at(around.states, k)
        dcm_bn = mrp_to_dcm(rotation.sigma_bn)
        if v.albedo:
            screen, half = v.cells.screen, v.cells.cos_half_view
            albedo_output(around.light[k], case.cells, screen, half, dcm_bn, case.work, albedo)
        flux = environment.solar_flux * environment.illumination
        sun_b = multiply(dcm_bn, environment.sun_n)
        sun_cells.sample(v.cells, case.cells, case.faults, key, step, sun_b, flux, albedo, voltages)
        gyro_b = gyro.measure(v.gyro, gyro_errors, key, step, rotation.omega_bn_b)
        field_b = (0.0, 0.0, 0.0)
        has_field = v.field_divider > 0 and step % v.field_divider == 0
        if has_field:
            true_field_b = multiply(dcm_bn, environment.field_n)
            field_b = magnetometer.measure(v.magnetometer, field_bias_b, key, step, true_field_b)
        for f in range(len(models)):
            model, run = models[f], runs[f]
            light = model.light[step if model.light.shape[0] > 1 else 0]
            state, solution = attitude_ekf.step(
                model.parameters,
                run.state,
                run.memory,
                since_s if step > 0 else 0.0,
                voltages,
                gyro_b,
                True,
                field_b,
                has_field,
                _references_at(model.references, step),
                light,
            )
            runs[f] = FilterRun(state, run.memory)
            true_bias_b = gyro.bias_at(v.gyro, gyro_errors, key, step)
            tally_attitude(tallies, f, c, step, rotation.sigma_bn, true_bias_b, solution, run.memory.covariance)
            if trace.shape[0] > 0:
                _note(trace[f, k], solution, rotation.sigma_bn)
        rotation, _, _ = advance(case.craft, rotation, momentum, nothing, nothing, environment, cycle_s, nothing)
    return rotation


@kernel
def _note(out, solution: AttitudeSolution, sigma_bn: Vec3) -> None:
    for i in range(3):
        out[i], out[3 + i] = solution.sigma_bn[i], solution.omega_bn_b[i]
        out[6 + i], out[9 + i] = solution.bias_b[i], sigma_bn[i]
