# SPDX-License-Identifier: Apache-2.0
"""The Sun as the cells together see it, apart from any estimator."""

from typing import NamedTuple

from css_common.vectors import Vec3


class Sight(NamedTuple):
    """After the last look."""

    sun_b: Vec3
    variance: float  # [rad^2] per axis across the Sun line
    known: bool
