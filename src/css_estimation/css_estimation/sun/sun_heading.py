# SPDX-License-Identifier: Apache-2.0
"""What every Sun estimator is given and returns; `sun_algorithm` has the shape that they share."""

from typing import NamedTuple

from css_common.vectors import Vec3

# The numbers of css_msgs/SunEstimate.
VALIDITY_NONE = 0
VALIDITY_HELD = 1
VALIDITY_VALID = 2

RATE_NONE = 0
RATE_GYRO = 1
RATE_SUN = 2
RATE_FIELD = 3

ECLIPSE_SUNLIT = 0
ECLIPSE_ECLIPSED = 1

# What an orbit model says about the shadow, if there is one.
PREDICTION_UNKNOWN = -1
PREDICTION_SUNLIT = 0
PREDICTION_ECLIPSED = 1

Covariance = tuple[float, float, float, float, float, float, float, float, float]
"""Covariance of sun_b, row-major."""

NO_COVARIANCE: Covariance = (-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class Aiding(NamedTuple):
    """What other sensors measured in this cycle."""

    gyro_b: Vec3  # [rad/s] body rate
    gyro_valid: bool
    field_b: Vec3  # [T] geomagnetic field
    field_valid: bool  # measured in this very cycle; False while the next measurement is not due


UNAIDED = Aiding((0.0, 0.0, 0.0), False, (0.0, 0.0, 0.0), False)
"""No other sensor."""


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
