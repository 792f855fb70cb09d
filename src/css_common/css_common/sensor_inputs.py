# SPDX-License-Identifier: Apache-2.0
"""Inputs that components of several packages have: body rate and magnetic field."""

from collections.abc import Iterable

from sensor_msgs.msg import Illuminance, Imu, MagneticField

from css_common.component import Component, Input
from css_common.mission_node import Node
from css_common.schema import Values

RATES = "gyro/imu"
"""Topic of the measured body rate."""

FULL_SUN_LUX = 133_100.0
"""Illuminance of the Sun met head-on at 1 AU [lx], by the solar constant of illumination (Allen 2000, 14.9)."""

FLAG_HELD_S = 120.0
"""Time [s] for which what a spacecraft says of the shadow stands."""


def sunlight_input() -> Input:
    """Whether the spacecraft is in sunlight, by means of its own: 0 lx in the shadow."""
    used = ("illuminance",)
    return Input("sunlight", "sunlight/illuminance", Illuminance, required=False, used=used, held_s=FLAG_HELD_S)


def uses_gyro(component: type[Component]) -> bool:
    """Whether a component has the parameter `use_gyro`, so that it can fly with a gyro or without."""
    return any(parameter.name == "use_gyro" for parameter in component.table())


def measures_rates(nodes: Iterable[Node]) -> bool:
    """Whether a node of a graph publishes the body rate that a gyro measures."""
    return any(output.topic == RATES for node in nodes for output in node.outputs)


def gyro_input(values: Values) -> Input:
    """The measured body rate, for a component with the parameter `use_gyro`; the gyro may die."""
    return Input(
        "gyro",
        RATES,
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
