# SPDX-License-Identifier: Apache-2.0
"""A sensor that still speaks when it is off."""

import numpy as np
from sensor_msgs.msg import Imu

from css_common.component import INERTIAL, Component, Input, Outgoing, Output, Received
from css_common.schema import Values
from css_msgs.msg import SpacecraftState


class Gyro(Component):
    """Measures nothing at all, and says so while it is off."""

    @classmethod
    def inputs(cls, name: str, values: Values) -> tuple[Input, ...]:
        """The truth."""
        return (Input("truth", "truth", SpacecraftState, frame=INERTIAL),)

    @classmethod
    def outputs(cls, name: str, values: Values) -> tuple[Output, ...]:
        """The rate."""
        return (Output("imu", "gyro/imu", Imu),)

    def cycle(self, stamp_ns: int, received: Received) -> Outgoing:
        """A rate."""
        return self._imu(stamp_ns, 0.0)

    def idle(self, stamp_ns: int, received: Received) -> Outgoing:
        """No rate."""
        return self._imu(stamp_ns, -1.0)

    def _imu(self, stamp_ns: int, covariance: float) -> Outgoing:
        nine, three = np.zeros(9), np.zeros(3)
        return {
            "imu": self.message(
                "imu", stamp_ns, orientation=np.array([0.0, 0.0, 0.0, 1.0]), orientation_covariance=nine,
                angular_velocity=three, angular_velocity_covariance=np.full(9, covariance),
                linear_acceleration=three, linear_acceleration_covariance=nine,
            )
        }  # fmt: skip
