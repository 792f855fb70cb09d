# SPDX-License-Identifier: Apache-2.0
"""Parameters of the attitude filter. Noise is that of the paper's sensors as `config/cubesat_vmm.yaml` has them."""

import math
from typing import NamedTuple

import numpy as np

from css_common.attitude import mrp_shadow
from css_common.schema import Table, Values, choice, flag, real, reals
from css_common.vectors import Vec3
from css_estimation.attitude.cell_voltages import CellModel
from css_estimation.sun import cell_calibration
from css_estimation.sun.cell_layout import cell_layout
from css_estimation.sun.error_covariance import CALIBRATION

PARAMETERS: Table = (
    choice(
        "sun_model",
        "voltage",
        ("vector", "voltage"),
        "the Sun as a least-squares vector of the lit cells, or as the output of each cell",
    ),
    choice(
        "cells_used",
        "lit_or_expected",
        ("lit_or_expected", "lit"),
        "voltage model: cells that are lit or should be, or those that are lit",
    ),
    real("gate", 0.1, "-", "a cell above it is lit", low=0.0, high=1.0, tunable=True),
    real("minimum_output", 0.2, "-", "no Sun unless a cell is above it", low=0.0, high=1.0, tunable=True),
    real("cell_sigma", 0.02, "-", "cell error, all causes, 1 sigma", low=0.0, open_low=True, high=10.0, tunable=True),
    real(
        "field_sigma_nt",
        200.0,
        "nT",
        "error of magnetometer and field model, per axis, 1 sigma",
        low=0.0,
        open_low=True,
        high=1e6,
        tunable=True,
    ),
    flag("use_gyro", True, "use the gyro while it delivers; off: the last rate is held", tunable=True),
    real("gyro.angle_walk_deg", 0.03, "deg/sqrt(s)", "angle random walk of the gyro", low=0.0, high=100.0),
    real("gyro.bias_walk_deg", 1e-4, "deg/s/sqrt(s)", "walk of its bias", low=0.0, high=1.0),
    real("gyro.bias_sigma_deg_s", 0.1, "deg/s", "its bias at the start, 1 sigma", low=0.0, high=100.0),
    real("gyro.limit_deg_s", 300.0, "deg/s", "a reading beyond it is not used", low=0.0, high=1e4),
    real("walk_without_gyro_deg", 1.0, "deg/sqrt(s)", "drift of the attitude without gyro", low=0.0, high=1e3),
    choice(
        "start.attitude",
        "sun_and_field",
        ("sun_and_field", "given"),
        "begin with what Sun and field say together, or with start.sigma_bn",
    ),
    reals("start.sigma_bn", (0.0, 0.0, 0.0), "-", "MRP of the given attitude, b relative to n", length=3),
    real("start.sigma_deg", 20.0, "deg", "its error about each axis, 1 sigma", low=0.0, open_low=True, high=100.0),
    real(
        "nis_gate_below_deg",
        10.0,
        "deg",
        "measurements beyond 99.9 % of chi-square are refused once the attitude error, 1 sigma, is below this",
        low=0.0,
        high=180.0,
    ),
    real(
        "restart_after",
        60.0,
        "s",
        "after so long a contradiction with field or Sun it starts anew, once the two together give an attitude",
        low=0.0,
        high=1e6,
    ),
    real("longest_step", 10.0, "s", "after a longer step the attitude is lost", low=0.0, open_low=True, high=1e6),
    *cell_calibration.PARAMETERS,
)

LOST_VARIANCE = math.pi**2 / 3.0
"""Variance [rad^2] of each component of the attitude error when nothing is known."""


class GivenStart(NamedTuple):
    """Attitude to begin with."""

    is_given: bool
    sigma_bn: Vec3
    variance: float  # of its error about each axis [rad^2]


class AttitudeParameters(NamedTuple):
    """Built by `parameters`; angles in rad, fields in T."""

    by_voltage: bool
    cells: CellModel
    gate: float
    minimum_output: float
    field_variance: float
    use_gyro: bool
    angle_noise: float  # [rad^2/s]
    bias_noise: float  # [rad^2/s^3]
    bias_variance: float
    gyro_limit: float
    noise_without_gyro: float  # [rad^2/s]
    given: GivenStart
    gated_below: float  # trace of the attitude covariance [rad^2]
    restart_after: float  # [s]
    longest_step: float  # [s]
    compensates_albedo: bool


def parameters(values: Values) -> AttitudeParameters:
    """Parameters from checked values (`PARAMETERS`, `flight_references.PARAMETERS` and the mission's `cells`)."""
    s1, s2, s3 = values.start.sigma_bn
    return AttitudeParameters(
        by_voltage=values.sun_model == "voltage",
        cells=CellModel(
            layout=cell_layout(values),
            calibration=cell_calibration.parameters(values),
            expected_too=values.cells_used == "lit_or_expected",
            variance=values.cell_sigma**2,
            albedo_share=values.albedo.share_sigma,
        ),
        gate=values.gate,
        minimum_output=values.minimum_output,
        field_variance=(values.field_sigma_nt * 1e-9) ** 2,
        use_gyro=values.use_gyro,
        angle_noise=math.radians(values.gyro.angle_walk_deg) ** 2,
        bias_noise=math.radians(values.gyro.bias_walk_deg) ** 2,
        bias_variance=math.radians(values.gyro.bias_sigma_deg_s) ** 2,
        gyro_limit=math.radians(values.gyro.limit_deg_s),
        noise_without_gyro=math.radians(values.walk_without_gyro_deg) ** 2,
        given=GivenStart(
            values.start.attitude == "given",
            mrp_shadow((float(s1), float(s2), float(s3))),
            math.radians(values.start.sigma_deg) ** 2,
        ),
        gated_below=math.radians(values.nis_gate_below_deg) ** 2,
        restart_after=values.restart_after,
        longest_step=values.longest_step,
        compensates_albedo=values.albedo.compensate,
    )


def largest_variances(p: AttitudeParameters) -> np.ndarray:
    """Variances (n,) above which errors say no more."""
    c = p.cells.calibration
    n = CALIBRATION + c.per_cell * len(p.cells.layout.cells)
    largest = np.full(n, LOST_VARIANCE)
    largest[3:6] = 100.0 * p.bias_variance + 1e-12
    for i in range(CALIBRATION, n):
        variance = cell_calibration.initial_variance(c, (i - CALIBRATION) % c.per_cell)
        largest[i] = 4.0 * variance + 1e-12
    return largest
