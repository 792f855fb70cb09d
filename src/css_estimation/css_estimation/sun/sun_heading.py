# SPDX-License-Identifier: Apache-2.0
"""What every Sun estimator is given and returns; `sun_algorithm` has the shape that they share."""

from typing import NamedTuple

import numpy as np

from css_common.vectors import Vec3
from css_environment.earth_light import new_light

# The numbers of css_msgs/SunEstimate.
VALIDITY_NONE = 0
VALIDITY_HELD = 1
VALIDITY_VALID = 2

RATE_NONE = 0
RATE_GYRO = 1
RATE_SUN = 2
RATE_FIELD = 3
RATE_MOMENTUM = 4

ECLIPSE_SUNLIT = 0
ECLIPSE_ECLIPSED = 1

LEFT_GYRO = 1
LEFT_FIELD = 2
HELD_GYRO = 4
HELD_FIELD = 8

# What an orbit model says about the shadow, if there is one.
PREDICTION_UNKNOWN = -1
PREDICTION_SUNLIT = 0
PREDICTION_ECLIPSED = 1

Covariance = tuple[float, float, float, float, float, float, float, float, float]
"""Covariance of sun_b, row-major."""

NO_COVARIANCE: Covariance = (-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class Sky(NamedTuple):
    """What the flight's own models say about Sun and Earth at its place; with unknown place all else is without use."""

    known: bool  # there is an orbit model
    predicted: int  # PREDICTION_*: what it says about the shadow
    sun_n: Vec3  # [-] unit vector to the Sun
    solar_flux: float  # [-] of the Sun in full view, 1 at 1 AU
    illumination: float  # [-] part of the Sun's disc in view
    r_n: Vec3  # [m] from the centre of the Earth
    field_n: Vec3  # [T] geomagnetic field; zeros: not predicted
    light: np.ndarray  # (192,) light of the Earth as `css_environment.earth_light.new_light`; zeros: not predicted


_NOTHING: Vec3 = (0.0, 0.0, 0.0)
UNKNOWN_SKY = Sky(False, PREDICTION_UNKNOWN, (1.0, 0.0, 0.0), 1.0, 1.0, _NOTHING, _NOTHING, new_light())
"""No orbit model."""


class Aiding(NamedTuple):
    """What is known in this cycle beside the cells: measurements of other sensors and models."""

    gyro_b: Vec3  # [rad/s] body rate
    gyro_valid: bool
    field_b: Vec3  # [T] geomagnetic field
    field_valid: bool  # measured in this very cycle; False while the next measurement is not due
    wheel_speeds: np.ndarray  # (N,) [rad/s] of the reaction wheels relative to the body
    wheels_valid: bool
    sky: Sky


UNAIDED = Aiding((0.0, 0.0, 0.0), False, (0.0, 0.0, 0.0), False, np.zeros(0), False, UNKNOWN_SKY)
"""The cells alone."""


class Measured(NamedTuple):
    """What M cycles are given, a row each: the cells, and of `Aiding` what is measured."""

    voltages: np.ndarray  # (M, N)
    gyro_b: np.ndarray  # (M, 3)
    gyro_valid: np.ndarray  # (M,)
    field_b: np.ndarray  # (M, 3)
    field_valid: np.ndarray  # (M,)
    wheel_speeds: np.ndarray  # (M, W)
    wheels_valid: bool


class SunHeading(NamedTuple):
    """Direction to the Sun and body rate after one cycle of an estimator; see css_msgs/SunEstimate."""

    sun_b: Vec3  # [-] unit vector; without an estimate (VALIDITY_NONE) zeros, or what the estimator then stands in
    covariance: Covariance  # [-] of sun_b; first element -1: not estimated
    omega_bn_b: Vec3  # [rad/s] low-pass filtered body rate
    age: float  # [s] since a cell last contributed
    nis: float  # [-] normalised innovation squared of this cycle
    nis_dof: int  # degrees of freedom of nis
    lit_mask: int  # bit i: cell i contributed
    validity: int  # VALIDITY_*
    rate_source: int  # RATE_*
    eclipse: int  # ECLIPSE_*
    mode: int  # documented with the estimator
    # of the health of sensors, which an algorithm need not fill in
    isolated: int = 0  # bit i: cell i is held for failed
    sensors_left: int = 0  # LEFT_* and HELD_*, added
