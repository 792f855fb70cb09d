# SPDX-License-Identifier: Apache-2.0
"""State, memory and result of the attitude filter."""

from typing import NamedTuple

import numpy as np

from css_common.kernel import kernel
from css_common.vectors import Vec3
from css_environment.albedo import new_workspace
from css_estimation.attitude.attitude_options import LOST_VARIANCE, AttitudeParameters, largest_variances
from css_estimation.attitude.roll_search import RollSearch, new_weights, no_search
from css_estimation.attitude.slow_errors import forget, new_slow
from css_estimation.health import cell_health
from css_estimation.health.cell_memory import CellHealthMemory, CellHealthState, new_memory
from css_estimation.sun import cell_calibration
from css_estimation.sun.error_covariance import BIAS, FURTHER, new_work

# The numbers of css_msgs/AttitudeEstimate.
VALIDITY_NONE = 0
VALIDITY_HELD = 1
VALIDITY_VALID = 2

USED_FIELD = 1
USED_SUN = 2
USED_GYRO = 4

MODE_WAITING = 0
MODE_STARTED = 1
MODE_TRACKING = 2
MODE_PROPAGATING = 3
MODE_LOST = 4

_ZERO: Vec3 = (0.0, 0.0, 0.0)


class AttitudeState(NamedTuple):
    """Carried from cycle to cycle, beside the arrays of `AttitudeMemory`."""

    started: bool  # there has been an attitude
    aligned: bool  # there is one
    sigma_bn: Vec3
    bias_b: Vec3  # [rad/s]
    omega_bn_b: Vec3  # [rad/s]
    gyro_b: Vec3  # [rad/s] last reading
    gyro_known: bool  # and whether it was one
    age: float  # [s]
    contradicted: float  # [s] for how long the field or the Sun has been refused
    confirmed: bool  # all rolls about the field have been weighed, and this one is it
    search: RollSearch
    cells: CellHealthState


class AttitudeMemory(NamedTuple):
    """Arrays of one filter that are advanced in place, for N cells and n errors."""

    covariance: np.ndarray  # (n, n)
    largest: np.ndarray  # (n,) bounds of the variances
    work: np.ndarray  # (3, n)
    calibration: np.ndarray  # (N, 3)
    slow: np.ndarray  # (10,) of `slow_errors`
    weights: np.ndarray  # (36,) of `roll_search`
    outputs: np.ndarray  # (N,) room for outputs relative to the Sun at normal incidence
    albedo: np.ndarray  # (N,) room for predicted light of the Earth
    albedo_slopes: np.ndarray  # (N, 3) room for its derivatives
    albedo_work: np.ndarray  # (224,) room for its prediction
    health: CellHealthMemory


class AttitudeSolution(NamedTuple):
    """Result of one cycle, beside the covariance in the memory; see css_msgs/AttitudeEstimate."""

    sigma_bn: Vec3
    omega_bn_b: Vec3
    bias_b: Vec3
    age: float
    nis: float
    nis_dof: int
    lit_mask: int
    validity: int
    used: int
    mode: int
    isolated: int = 0  # bit i: cell i is held for failed


def initial_state(p: AttitudeParameters) -> AttitudeState:
    """Nothing known, or the given attitude."""
    given = p.start.is_given
    sigma_bn = p.start.sigma_bn if given else _ZERO
    cells = cell_health.initial_state()
    return AttitudeState(given, given, sigma_bn, _ZERO, _ZERO, _ZERO, False, 0.0, 0.0, False, no_search(), cells)


def initial_memory(p: AttitudeParameters) -> AttitudeMemory:
    """Arrays before the first cycle."""
    cells = len(p.cells.layout.cells)
    largest = largest_variances(p)
    covariance = np.diag(np.full(len(largest), LOST_VARIANCE))
    if p.start.is_given:
        for i in range(3):
            covariance[i, i] = p.start.variance
    for i in range(BIAS, FURTHER):
        covariance[i, i] = p.bias_variance
    slow = new_slow()
    forget(p.slow, covariance, slow)
    c, first = p.cells.calibration, p.cells.calibration_at
    for i in range(first, len(largest)):
        covariance[i, i] = cell_calibration.initial_variance(c, (i - first) % c.per_cell)
    return AttitudeMemory(
        covariance=covariance,
        largest=largest,
        work=new_work(len(largest)),
        calibration=cell_calibration.nominal(cells),
        slow=slow,
        weights=new_weights(),
        outputs=np.zeros(cells),
        albedo=np.zeros(cells),
        albedo_slopes=np.zeros((cells, 3)),
        albedo_work=new_workspace(),
        health=new_memory(cells),
    )


@kernel
def with_attitude(state: AttitudeState, sigma_bn: Vec3, bias_b: Vec3) -> AttitudeState:
    """The state with another attitude and bias."""
    s = state
    return AttitudeState(
        s.started,
        s.aligned,
        sigma_bn,
        bias_b,
        s.omega_bn_b,
        s.gyro_b,
        s.gyro_known,
        s.age,
        s.contradicted,
        s.confirmed,
        s.search,
        s.cells,
    )


@kernel
def with_alignment(state: AttitudeState, aligned: bool, contradicted: float) -> AttitudeState:
    """The state with an attitude that holds or does not, and the time [s] of contradiction."""
    s = state
    return AttitudeState(
        s.started,
        aligned,
        s.sigma_bn,
        s.bias_b,
        s.omega_bn_b,
        s.gyro_b,
        s.gyro_known,
        s.age,
        contradicted,
        s.confirmed,
        s.search,
        s.cells,
    )


@kernel
def with_search(state: AttitudeState, confirmed: bool, search: RollSearch) -> AttitudeState:
    """The state with an attitude that is confirmed or not, and the search for it."""
    s = state
    return AttitudeState(
        s.started,
        s.aligned,
        s.sigma_bn,
        s.bias_b,
        s.omega_bn_b,
        s.gyro_b,
        s.gyro_known,
        s.age,
        s.contradicted,
        confirmed,
        search,
        s.cells,
    )


@kernel
def with_cells(state: AttitudeState, cells: CellHealthState) -> AttitudeState:
    """The state with another health of the cells."""
    s = state
    return AttitudeState(
        s.started,
        s.aligned,
        s.sigma_bn,
        s.bias_b,
        s.omega_bn_b,
        s.gyro_b,
        s.gyro_known,
        s.age,
        s.contradicted,
        s.confirmed,
        s.search,
        cells,
    )
