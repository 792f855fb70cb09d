# SPDX-License-Identifier: Apache-2.0
"""Between messages and the values of the algorithms, for every estimator node."""

from typing import Any

import numpy as np

from css_common.codec import Sample
from css_common.vectors import Vec3, vector_of
from css_estimation.sun_heading import SunHeading

_NOTHING: Vec3 = (0.0, 0.0, 0.0)


def sun_estimate_fields(heading: SunHeading) -> dict[str, Any]:
    """Fields of css_msgs/SunEstimate, without the header."""
    return {
        "sun_b": np.array(heading.sun_b),
        "covariance": np.array(heading.covariance),
        "omega_bn_b": np.array(heading.omega_bn_b),
        "age": heading.age,
        "nis": heading.nis,
        "lit_mask": heading.lit_mask,
        "nis_dof": heading.nis_dof,
        "validity": heading.validity,
        "rate_source": heading.rate_source,
        "eclipse": heading.eclipse,
        "mode": heading.mode,
    }


def gyro_reading(imu: Sample | None) -> tuple[Vec3, bool]:
    """Body rate [rad/s] of a sensor_msgs/Imu and whether it is a measurement.

    A gyro that is switched off says so by the message's own convention, a first covariance element of -1.
    """
    if imu is None or imu.angular_velocity_covariance[0] == -1.0:
        return _NOTHING, False
    return vector_of(imu.angular_velocity), True


def field_reading(field: Sample | None) -> tuple[Vec3, bool]:
    """Field [T] of a sensor_msgs/MagneticField and whether it is a measurement, by the same convention."""
    if field is None or field.magnetic_field_covariance[0] == -1.0:
        return _NOTHING, False
    return vector_of(field.magnetic_field), True
