# SPDX-License-Identifier: Apache-2.0
"""What is true of a spacecraft at one step, for the running sums to measure estimates against."""

from typing import NamedTuple

from css_common.vectors import Vec3
from css_monte_carlo.failing_units import Failing


class Truth(NamedTuple):
    """One step of one case."""

    sigma_bn: Vec3
    omega_bn_b: Vec3  # [rad/s]
    sun_b: Vec3
    array_normal_b: Vec3
    wheel_momentum_b: Vec3  # [N m s] of all wheels
    gyro_bias_b: Vec3  # [rad/s]
    rod_dipole: float  # [A m^2] commanded in this step, of all rods together without their signs
    failing: Failing  # units that faults act on
