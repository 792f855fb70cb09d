# SPDX-License-Identifier: Apache-2.0
"""Between messages and the values of the algorithms, for every estimator node."""

from typing import Any

import numpy as np

from css_common.attitude import mrp_to_quaternion
from css_common.component import Input
from css_common.kernel import typed_call
from css_common.readings import Readings
from css_common.schema import Values
from css_estimation.attitude.attitude_solution import VALIDITY_NONE, AttitudeSolution
from css_estimation.sun.error_covariance import FURTHER
from css_estimation.sun.sun_heading import SunHeading
from css_msgs.msg import CssVoltages, WheelState

_to_quaternion = typed_call(mrp_to_quaternion)


def cells_input(values: Values) -> Input:
    """The outputs of the mission's cells, of which some may be missing (NaN)."""
    cells = values.cells
    return Input(
        "cells",
        "css/voltages",
        CssVoltages,
        lengths={"voltages": len(cells.normals)},
        readings={"voltages": Readings(cells.smallest_reading, cells.largest_reading)},
    )


def wheels_input(values: Values) -> Input:
    """The measured speeds of the wheels, for a component that can do without."""
    return Input(
        "wheels",
        "wheels/state",
        WheelState,
        required=False,
        lengths={"speed": len(values.wheels.axes)},
        used=("speed",),
    )


def sun_estimate_fields(heading: SunHeading) -> dict[str, Any]:
    """Fields of css_msgs/SunEstimate, without the header."""
    return {
        "sun_b": np.array(heading.sun_b),
        "covariance": np.array(heading.covariance),
        "omega_bn_b": np.array(heading.omega_bn_b),
        "age": heading.age,
        "nis": heading.nis,
        "lit_mask": heading.lit_mask,
        "isolated": heading.isolated,
        "nis_dof": heading.nis_dof,
        "validity": heading.validity,
        "rate_source": heading.rate_source,
        "eclipse": heading.eclipse,
        "mode": heading.mode,
        "sensors_left": heading.sensors_left,
    }


def attitude_estimate_fields(solution: AttitudeSolution, covariance: np.ndarray) -> dict[str, Any]:
    """Fields of css_msgs/AttitudeEstimate, without the header; of the covariance (n, n) attitude and bias."""
    if solution.validity == VALIDITY_NONE:
        quaternion, reported = np.zeros(4), np.zeros(36)
        reported[0] = -1.0
    else:
        quaternion = np.array(_to_quaternion(solution.sigma_bn))
        reported = covariance[:FURTHER, :FURTHER].ravel()
    return {
        "q_bn": quaternion,
        "omega_bn_b": np.array(solution.omega_bn_b),
        "gyro_bias_b": np.array(solution.bias_b),
        "covariance": reported,
        "age": solution.age,
        "delay": 0.0,
        "nis": solution.nis,
        "lit_mask": solution.lit_mask,
        "isolated": solution.isolated,
        "nis_dof": solution.nis_dof,
        "validity": solution.validity,
        "used": solution.used,
        "mode": solution.mode,
    }
