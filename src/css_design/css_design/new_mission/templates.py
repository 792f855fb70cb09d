# SPDX-License-Identifier: Apache-2.0
"""Spacecraft to begin from: what is taken for whatever nobody gave, typical of their class.

Wheels, gyros and cells are rounded figures of what is sold for such spacecraft, not those of one product.
"""

from collections.abc import Mapping
from typing import NamedTuple

from css_design.new_mission.values import NONE

_COMMON = {
    "inertia": NONE,
    "cells": "all",
    "panels": NONE,
    "array_normal": "auto",
    "wheels": "3",
    "gyro": "0.01",
    "gyro_bias": "5",
    "magnetometer": "100",
    "field_of_view": "180",
    "cell_noise": "0.005",
    "cell_bits": "12",
    "cell_scale": "0.03",
    "cell_tilt": "1",
    "orbit": "sso 500 10:30",
    "epoch": "auto",
    "period": "0.1",
    "orbits": "1",
    "estimator": "auto",
}


class Template(NamedTuple):
    """A spacecraft to begin from."""

    description: str
    values: Mapping[str, str]  # a text for each item


def _template(description: str, **values: str) -> Template:
    return Template(description, {**_COMMON, **values})


TEMPLATES = {
    "1u": _template(
        "10 cm cube with three small wheels",
        size="0.1,0.1,0.1135", mass="1.3", wheel_momentum="0.0015", wheel_torque="0.00023", wheel_speed="8000",
        rods="0.1", tip_off="3",
    ),
    "3u": _template(
        "10 x 10 x 34 cm with three wheels",
        size="0.1,0.1,0.3405", mass="4", wheel_momentum="0.01", wheel_torque="0.001", wheel_speed="6000",
        rods="0.2", tip_off="3",
    ),
    "6u": _template(
        "10 x 23 x 34 cm with four wheels in a pyramid and two deployed panels",
        size="0.1,0.2263,0.3405", mass="10", wheels="4", wheel_momentum="0.03", wheel_torque="0.0023",
        wheel_speed="5600", rods="0.4", tip_off="3", panels="+y:+x:0.3405 -y:+x:0.3405",
    ),
    "3u-rods": _template(
        "3u with two panels, magnetometer and torque rods alone: no wheels, no gyro",
        size="0.1,0.1,0.3405", mass="4", panels="+y:+x:0.2 -y:+x:0.2", wheels=NONE, wheel_momentum="0.01",
        wheel_torque="0.001", wheel_speed="6000", rods="0.2", gyro=NONE, tip_off="10", period="0.25", orbits="4",
    ),
    "smallsat": _template(
        "60 cm cube of 100 kg with four wheels",
        size="0.6,0.6,0.7", mass="100", wheels="4", wheel_momentum="1", wheel_torque="0.03", wheel_speed="6000",
        rods="10", gyro="0.003", gyro_bias="1", tip_off="1",
    ),
}  # fmt: skip

DEFAULT = "3u"
"""What is begun from unless told."""
