# SPDX-License-Identifier: Apache-2.0
"""Somebody else's magnetometer."""

from typing import ClassVar

from sensor_msgs.msg import MagneticField

from css_common.run import node_main
from css_drivers import mounting
from css_drivers.mounting import unit_parameter
from css_drivers.relay import Relay

_UNITS = {"T": 1.0, "mT": 1e-3, "uT": 1e-6, "nT": 1e-9, "G": 1e-4, "mG": 1e-7}


class MagnetometerRelay(Relay):
    """The field of another driver's sensor_msgs/MagneticField, turned into the body frame and tesla, as `mag/field`."""

    from_topic: ClassVar[str] = "imu/mag"
    to_topic: ClassVar[str] = "mag/field"
    message_type: ClassVar[type] = MagneticField
    vector: ClassVar[str] = "magnetic_field"
    units: ClassVar[dict[str, float]] = _UNITS
    parameters = (*mounting.COMMON, unit_parameter(_UNITS, "T"))


main = node_main(MagnetometerRelay)
