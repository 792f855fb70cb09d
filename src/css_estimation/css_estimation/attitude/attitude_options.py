# SPDX-License-Identifier: Apache-2.0
"""Parameters of the attitude filter. Noise is that of the paper's sensors as `config/cubesat_vmm.yaml` has them."""

import math
from typing import NamedTuple

import numpy as np

from css_common.attitude import mrp_shadow
from css_common.conversions import square_of_degrees
from css_common.declared import builder, given, made, part, table_of
from css_common.schema import choice, flag, real, reals
from css_common.vectors import Vec3, vector_of
from css_estimation.attitude import slow_errors
from css_estimation.attitude.cell_voltages import CellModel
from css_estimation.attitude.flight_references import COMPENSATE
from css_estimation.attitude.slow_errors import SlowErrors
from css_estimation.health.cell_options import ENABLED, CellHealthParameters
from css_estimation.sun import cell_calibration
from css_estimation.sun.error_covariance import BIAS, FURTHER

LOST_VARIANCE = math.pi**2 / 3.0
"""Variance [rad^2] of each component of the attitude error when nothing is known."""


SUN_MODEL = choice(
    "sun_model",
    "voltage",
    ("vector", "voltage"),
    "the Sun as a least-squares vector of the lit cells, or as the output of each cell",
)


def _mrp(sigma_bn: np.ndarray) -> Vec3:
    return mrp_shadow(vector_of(sigma_bn))


def _field_variance(sigma_nt: float) -> float:
    return (sigma_nt * 1e-9) ** 2


class GivenStart(NamedTuple):
    """Attitude to begin with."""

    is_given: bool = made(
        lambda word: word == "given",
        choice(
            "start.attitude",
            "sun_and_field",
            ("sun_and_field", "given"),
            "begin with what Sun and field say together, or with start.sigma_bn",
        ),
    )
    sigma_bn: Vec3 = made(
        _mrp,
        reals("start.sigma_bn", (0.0, 0.0, 0.0), "-", "MRP of the given attitude, b relative to n", length=3),
    )
    variance: float = made(  # of its error about each axis [rad^2]
        square_of_degrees,
        real("start.sigma_deg", 20.0, "deg", "its error about each axis, 1 sigma", low=0.0, open_low=True, high=100.0),
    )


class AttitudeParameters(NamedTuple):
    """All of the filter; angles in rad, fields in T."""

    by_voltage: bool = made(lambda word: word == "voltage", SUN_MODEL)
    cells: CellModel = part(CellModel)
    gate: float = given(real("gate", 0.1, "-", "a cell above it is lit", low=0.0, high=1.0, tunable=True))
    minimum_output: float = given(
        real("minimum_output", 0.2, "-", "no Sun unless a cell is above it", low=0.0, high=1.0, tunable=True)
    )
    field_variance: float = made(
        _field_variance,
        real(
            "field_sigma_nt",
            200.0,
            "nT",
            "white error of magnetometer and field model, per axis, 1 sigma",
            low=0.0,
            open_low=True,
            high=1e6,
            tunable=True,
        ),
    )
    use_gyro: bool = given(
        flag("use_gyro", True, "use the gyro while it delivers; off: the last rate is held", tunable=True)
    )
    angle_noise: float = made(  # [rad^2/s]
        square_of_degrees,
        real("gyro.angle_walk_deg", 0.03, "deg/sqrt(s)", "angle random walk of the gyro", low=0.0, high=100.0),
    )
    bias_noise: float = made(  # [rad^2/s^3]
        square_of_degrees, real("gyro.bias_walk_deg", 1e-4, "deg/s/sqrt(s)", "walk of its bias", low=0.0, high=1.0)
    )
    bias_variance: float = made(
        square_of_degrees,
        real("gyro.bias_sigma_deg_s", 0.1, "deg/s", "its bias at the start, 1 sigma", low=0.0, high=100.0),
    )
    gyro_limit: float = made(
        math.radians, real("gyro.limit_deg_s", 300.0, "deg/s", "a reading beyond it is not used", low=0.0, high=1e4)
    )
    noise_without_gyro: float = made(  # [rad^2/s]
        square_of_degrees,
        real("walk_without_gyro_deg", 1.0, "deg/sqrt(s)", "drift of the attitude without gyro", low=0.0, high=1e3),
    )
    start: GivenStart = part(GivenStart)
    gated_below: float = made(  # trace of the attitude covariance [rad^2]
        square_of_degrees,
        real(
            "nis_gate_below_deg",
            10.0,
            "deg",
            "measurements beyond 99.9 % of chi-square are refused once the attitude error, 1 sigma, is below this",
            low=0.0,
            high=180.0,
        ),
    )
    restart_after: float = given(  # [s]
        real(
            "restart_after",
            60.0,
            "s",
            "after so long a contradiction with field or Sun it starts anew, once the two together give an attitude",
            low=0.0,
            high=1e6,
        )
    )
    longest_step: float = given(  # [s]
        real("longest_step", 10.0, "s", "after a longer step the attitude is lost", low=0.0, open_low=True, high=1e6)
    )
    compensates_albedo: bool = given(COMPENSATE)
    slow: SlowErrors = part(SlowErrors)
    judges_cells: bool = given(ENABLED)
    health: CellHealthParameters = part(CellHealthParameters)


PARAMETERS = table_of(AttitudeParameters)
parameters = builder(AttitudeParameters)


def largest_variances(p: AttitudeParameters) -> np.ndarray:
    """Variances (n,) above which errors say no more."""
    c = p.cells.calibration
    scales = [4.0 * cell_calibration.initial_variance(c, k) + 1e-12 for k in range(c.per_cell)]
    largest = [LOST_VARIANCE] * BIAS + [100.0 * p.bias_variance + 1e-12] * (FURTHER - BIAS)
    return np.array([*largest, *slow_errors.largest_variances(p.slow), *scales * len(p.cells.layout.cells)])
