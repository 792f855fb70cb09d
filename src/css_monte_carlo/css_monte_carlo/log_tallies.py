# SPDX-License-Identifier: Apache-2.0
"""The running sums of the loop, from the log of a flight that was not flown in it."""

from typing import NamedTuple

import numpy as np

from css_analysis.estimate_errors import true_attitudes
from css_analysis.flight_log import FlightLog
from css_analysis.flight_metrics import windows_of
from css_common.attitude import quaternion_to_mrp
from css_common.kernel import typed_call
from css_common.vectors import Vec3
from css_estimation.attitude import attitude_solution
from css_estimation.attitude.attitude_solution import AttitudeSolution
from css_estimation.sun import sun_heading
from css_estimation.sun.sun_heading import Covariance, SunHeading
from css_monte_carlo import attitude_tallies, case_tallies
from css_monte_carlo.attitude_tallies import AttitudeTallies
from css_monte_carlo.case_tallies import Tallies, step_marks
from css_monte_carlo.failing_of_log import cell_kinds_by_step, failing_by_step, fault_table
from css_monte_carlo.failing_units import NOTHING_FAILS
from css_monte_carlo.health_tallies import NO_ACTUATORS_LEFT, ActuatorsLeft
from css_monte_carlo.named_faults import note_cell_kinds
from css_monte_carlo.step_truth import Truth

_ZERO: Vec3 = (0.0, 0.0, 0.0)
_NO_HEADING = SunHeading(
    _ZERO,
    sun_heading.NO_COVARIANCE,
    _ZERO,
    0.0,
    0.0,
    0,
    0,
    sun_heading.VALIDITY_NONE,
    sun_heading.RATE_NONE,
    0,
    0,
    0,
    0,
)
_NO_ATTITUDE = AttitudeSolution(_ZERO, _ZERO, _ZERO, 0.0, 0.0, 0, 0, attitude_solution.VALIDITY_NONE, 0, 0)


class ReportedCovariance(NamedTuple):
    """What a filter tells of its memory."""

    covariance: np.ndarray  # (6, 6) of attitude and bias


def tally_headings(tallies: Tallies, c: int, log: FlightLog, name: str, wheels: np.ndarray) -> None:
    """Counts the flight of case `c`, as the loop counts its steps.

    Args:
        name: of the Sun estimator.
        wheels: (N,) of `rigid_body.WHEEL`, of the case.
    """
    estimates = log.estimates.get(name)
    rows = _rows_by_step(log, None if estimates is None else log.truth_rows(estimates))
    momentum_b = _wheel_momentum(log, wheels)
    dipoles = _rod_dipoles(log)
    marks = step_marks(log.having("truth").illumination, log.period, windows_of(log.mission))
    faults, left = fault_table(log), _actuators_left(log)
    failing, kinds = failing_by_step(log, faults), cell_kinds_by_step(log, name)
    read = _voltages_by_step(log)
    count, note = typed_call(case_tallies.tally_step), typed_call(note_cell_kinds)
    for step, row in enumerate(rows):
        heading = _NO_HEADING if estimates is None or row < 0 else _heading(estimates, row)
        truth = _truth(
            log, step, log.having("truth").sigma_bn[step], momentum_b[step], np.zeros(3), dipoles[step]
        )._replace(failing=failing[step])
        count(tallies, c, step, int(marks[step]), truth, heading, None, None, left[step])
        taken_for = next(kinds)
        held = failing[step].cells & heading.isolated
        if held and step in read:
            note(tallies.health, c, held, taken_for, faults, step, read[step])


def tally_attitudes(tallies: AttitudeTallies, c: int, log: FlightLog, name: str, gyro_bias_b: np.ndarray) -> None:
    """Counts the flight of case `c`, as the loop counts its steps; an attitude is compared with that of its instant.

    Args:
        name: of the attitude filter.
        gyro_bias_b: (K, 3) true bias at every step [rad/s]; NaN: there is none.
    """
    attitudes = log.attitudes.get(name)
    sigma_bn = log.having("truth").sigma_bn.copy()
    pairs = None if attitudes is None else log.truth_rows(attitudes)
    if attitudes is not None and pairs is not None:
        sigma_bn[pairs[1]] = true_attitudes(log, pairs[1], attitudes.delay[pairs[0]])
    marks = step_marks(log.having("truth").illumination, log.period, windows_of(log.mission))
    count = typed_call(attitude_tallies.tally_step)
    memory = ReportedCovariance(np.zeros((6, 6)))
    for step, row in enumerate(_rows_by_step(log, pairs)):
        solution = _NO_ATTITUDE
        if attitudes is not None and row >= 0:
            solution = _solution(attitudes, row)
            memory.covariance[:] = attitudes.covariance[row].reshape(6, 6)
        truth = _truth(log, step, sigma_bn[step], np.zeros(3), gyro_bias_b[step], 0.0)
        count(tallies, c, step, int(marks[step]), truth, None, solution, memory, NO_ACTUATORS_LEFT)


def _rows_by_step(log: FlightLog, pairs: tuple[np.ndarray, np.ndarray] | None) -> list[int]:
    """Row of the estimate at each step of the truth, -1 for none."""
    rows = np.full(len(log.having("truth")), -1)
    if pairs is not None:
        rows[pairs[1]] = pairs[0]
    return rows.tolist()


def _wheel_momentum(log: FlightLog, wheels: np.ndarray) -> np.ndarray:
    """(K, 3) momentum of all wheels in b [N m s]."""
    truth = log.having("truth")
    true = log.wheels if log.true_wheels is None else log.true_wheels
    if true is None or len(wheels) == 0:
        return np.zeros((len(truth), 3))
    axes = np.stack([wheels["gx"], wheels["gy"], wheels["gz"]], axis=1)
    return (wheels["inertia"] * (true.speed + truth.omega_bn_b @ axes.T)) @ axes


def _rod_dipoles(log: FlightLog) -> list[float]:
    """(K,) dipoles of all rods without their signs [A m^2]; zero where none is commanded."""
    dipoles = np.zeros(len(log.having("truth")))
    if log.rod_command is not None:
        rows, steps = log.truth_rows(log.rod_command)
        dipoles[steps] = np.sum(np.abs(log.rod_command.dipole[rows]), axis=1)
    return dipoles.tolist()


def _voltages_by_step(log: FlightLog) -> dict[int, np.ndarray]:
    """What the cells read at each step of the truth that has it."""
    if log.voltages is None:
        return {}
    rows, steps = log.truth_rows(log.voltages)
    return {step: log.voltages.voltages[row] for step, row in zip(steps.tolist(), rows.tolist(), strict=True)}


def _actuators_left(log: FlightLog) -> list[ActuatorsLeft]:
    """The actuators that the control held for failed at every step of the truth."""
    left = [NO_ACTUATORS_LEFT] * len(log.having("truth"))
    if log.control is not None:
        rows, steps = log.truth_rows(log.control)
        wheels, rods = (getattr(log.control, name)[rows].tolist() for name in ("wheels_isolated", "rods_isolated"))
        for step, *masks in zip(steps.tolist(), wheels, rods, strict=True):
            left[step] = ActuatorsLeft(*masks)
    return left


def _truth(log: FlightLog, step: int, sigma_bn, momentum_b, gyro_bias_b, rod_dipole: float) -> Truth:
    omega_bn_b = log.having("truth").omega_bn_b[step]
    return Truth(
        _vec3(sigma_bn),
        _vec3(omega_bn_b),
        _vec3(log.sun_b[step]),
        _vec3(log.array_normal_b),
        _vec3(momentum_b),
        _vec3(gyro_bias_b),
        rod_dipole,
        NOTHING_FAILS,
    )


def _heading(estimates, row: int) -> SunHeading:
    e = estimates
    covariance: Covariance = tuple(e.covariance[row].tolist())
    numbers = (e.nis_dof, e.lit_mask, e.validity, e.rate_source, e.eclipse, e.mode, e.isolated, e.sensors_left)
    return SunHeading(
        _vec3(e.sun_b[row]),
        covariance,
        _vec3(e.omega_bn_b[row]),
        float(e.age[row]),
        float(e.nis[row]),
        *(int(column[row]) for column in numbers),
    )


def _solution(attitudes, row: int) -> AttitudeSolution:
    a = attitudes
    numbers = (a.nis_dof, a.lit_mask, a.validity, a.used, a.mode, a.isolated)
    return AttitudeSolution(
        _vec3(quaternion_to_mrp(tuple(a.q_bn[row].tolist()))) if a.validity[row] else _ZERO,
        _vec3(a.omega_bn_b[row]),
        _vec3(a.gyro_bias_b[row]),
        float(a.age[row]),
        float(a.nis[row]),
        *(int(column[row]) for column in numbers),
    )


def _vec3(values) -> Vec3:
    x, y, z = (float(value) for value in values)
    return (x, y, z)
