# SPDX-License-Identifier: Apache-2.0
"""Inputs that components of several packages have: body rate and magnetic field."""

from sensor_msgs.msg import Imu, MagneticField

from css_common.component import Component, Input
from css_common.schema import Values


def uses_gyro(component: type[Component]) -> bool:
    """Whether a component has the parameter `use_gyro`, so that it can fly with a gyro or without."""
    return any(parameter.name == "use_gyro" for parameter in component.table())


def gyro_input(values: Values) -> Input:
    """The measured body rate, for a component with the parameter `use_gyro`; the gyro may die."""
    return Input(
        "gyro",
        "gyro/imu",
        Imu,
        required=False,
        used=("angular_velocity",),
        heeded=values.use_gyro,
        switch="use_gyro",
    )


def field_input(values: Values, *, required: bool = False) -> Input:
    """The measured magnetic field, at the rate of the mission's magnetometer."""
    return Input(
        "field",
        "mag/field",
        MagneticField,
        required=required,
        divider=values.magnetometer.divider,
        used=("magnetic_field",),
        once=not required,
    )
