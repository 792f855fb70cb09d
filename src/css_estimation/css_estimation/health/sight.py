# SPDX-License-Identifier: Apache-2.0
"""The Sun as the cells alone show it: what gyro and magnetometer are held against."""

from typing import NamedTuple

from css_common.vectors import Vec3


class Sight(NamedTuple):
    """Direction to the Sun without any help of gyro and magnetometer, of the last cycle."""

    sun_b: Vec3  # [-] unit vector
    variance: float  # [rad^2] per axis across the Sun line
    known: bool


UNSEEN = Sight((0.0, 0.0, 0.0), 0.0, False)
"""No Sun in sight."""
