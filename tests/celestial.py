# SPDX-License-Identifier: Apache-2.0
"""Orbits and the Sun in closed form, for tests of what is tabulated or integrated."""

import math

import numpy as np

from css_environment.constants import EARTH_MU
from css_environment.sun import sun_positions


def orbit_period(orbit):
    """Two-body period [s]."""
    return 2.0 * math.pi * math.sqrt(orbit.semi_major_axis**3 / EARTH_MU)


def sun_directions(epoch_ns, elapsed_s, r_n):
    """Unit vectors from positions (T, 3) [m] to the Sun, and distances (T,) [m]."""
    line = sun_positions(epoch_ns, elapsed_s) - r_n
    distance = np.linalg.norm(line, axis=1)
    return line / distance[:, None], distance
