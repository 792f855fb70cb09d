# SPDX-License-Identifier: Apache-2.0
"""What healthy sensors of a spacecraft read, told to the estimator that looks for those that fail.

Its defaults are those of a body that turns slowly, with quiet sensors: the wheels of a small one turn it up by more in
a second, and a noisier gyro is no broken one.
"""

import math
from collections.abc import Iterator

import numpy as np

from css_common.schema import Parameter
from css_design.new_mission.commented import Entry
from css_design.new_mission.design import Design
from css_estimation.health.watched import PARAMETERS

_MARGIN = 1.5
_STRONGEST_FIELD = 6e-5  # [T] in a low orbit
_USUAL: dict[str, Parameter] = {parameter.name: parameter for parameter in PARAMETERS}


def healthy_readings(design: Design) -> Iterator[Entry]:
    """Entries of the estimator's section, where something is more than usual."""
    asked = design.asked
    yield from _more("health.cells.noise", asked["cell_noise"], "[computed] that of the cells")
    yield from _more("health.cells.share", asked["cell_scale"], "[computed] what nobody has calibrated")
    yield from _more("health.cells.heading_deg", asked["cell_tilt"], "[computed] likewise")
    if asked["gyro"] is not None:
        fastest = round(_MARGIN * largest_acceleration_deg_s2(design), 3)
        yield from _more("health.gyro.noise_deg_s", asked["gyro"], "[computed] that of the gyro")
        yield from _more("health.gyro.bias_deg_s", asked["gyro_bias"] / 3600.0, "[computed] likewise")
        yield from _more(
            "health.gyro.acceleration_deg_s2", fastest, "[computed] wheels and rods together, and half more"
        )
    if asked["magnetometer"] is not None:
        yield from _more("health.field.noise_nt", asked["magnetometer"], "[computed] that of the magnetometer")


def _more(name: str, value: float, comment: str) -> Iterator[Entry]:
    usual = _USUAL[name]
    if value > usual.default:
        yield Entry(name, value if usual.high is None else min(value, usual.high), comment)


def largest_acceleration_deg_s2(design: Design) -> float:
    """Largest angular acceleration about any axis by wheels and rods [deg/s^2]."""
    torque = np.zeros(3)
    if design.wheels is not None:
        torque += design.asked["wheel_torque"] * np.sum(np.abs(design.wheel_axes), axis=0)
    if design.asked["rods"] is not None:
        torque += math.sqrt(2.0) * design.asked["rods"] * _STRONGEST_FIELD
    return math.degrees(float(np.max(np.abs(np.linalg.inv(design.inertia)) @ torque)))
