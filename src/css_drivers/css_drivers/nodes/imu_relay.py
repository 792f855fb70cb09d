# SPDX-License-Identifier: Apache-2.0
"""Somebody else's gyro."""

from typing import Any, ClassVar

import numpy as np
from sensor_msgs.msg import Imu

from css_common.codec import Sample
from css_common.run import node_main
from css_drivers import mounting
from css_drivers.mounting import DEGREE, unit_parameter
from css_drivers.relay import NOTHING, Relay

_UNITS = {"rad/s": 1.0, "deg/s": DEGREE}


class ImuRelay(Relay):
    """Body rates of another driver's sensor_msgs/Imu, turned into the body frame and rad/s, as `gyro/imu`."""

    from_topic: ClassVar[str] = "imu/data"
    to_topic: ClassVar[str] = "gyro/imu"
    message_type: ClassVar[type] = Imu
    vector: ClassVar[str] = "angular_velocity"
    units: ClassVar[dict[str, float]] = _UNITS
    parameters = (*mounting.COMMON, unit_parameter(_UNITS, "rad/s"))

    def _turned(self, message: Sample) -> dict[str, Any]:
        # orientation and acceleration are of other axes, and nobody here listens to them
        nothing = {"orientation": np.array([0.0, 0.0, 0.0, 1.0]), "linear_acceleration": np.zeros(3)}
        return super()._turned(message) | nothing | {f"{key}_covariance": NOTHING for key in nothing}


main = node_main(ImuRelay)
