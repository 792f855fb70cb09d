# SPDX-License-Identifier: Apache-2.0
"""Exponential atmosphere and its rotation."""

import math

import numpy as np
import pytest

from css_environment.atmosphere import ATMOSPHERE_400_KM, air_velocity, density
from css_environment.constants import EARTH_RADIUS, EARTH_ROTATION_RATE


def test_density_falls_by_e_in_a_scale_height():
    base = density(ATMOSPHERE_400_KM, (EARTH_RADIUS + 400e3, 0.0, 0.0))
    assert base == pytest.approx(3.725e-12)
    above = density(ATMOSPHERE_400_KM, (0.0, 0.0, EARTH_RADIUS + 400e3 + ATMOSPHERE_400_KM.scale_height))
    assert above == pytest.approx(base / math.e)


def test_450_km_is_the_next_value_of_the_table():
    """Vallado, Table 8-4: 1.585e-12 kg/m3 at 450 km."""
    assert density(ATMOSPHERE_400_KM, (0.0, EARTH_RADIUS + 450e3, 0.0)) == pytest.approx(1.585e-12, rel=1e-3)


def test_density_stays_finite_below_ground():
    assert density(ATMOSPHERE_400_KM, (0.0, 0.0, 0.0)) == density(ATMOSPHERE_400_KM, (EARTH_RADIUS, 0.0, 0.0))


def test_air_turns_with_the_earth():
    r, v = (6.8e6, 1e6, 3e6), (100.0, 7500.0, -20.0)
    expected = np.array(v) - np.cross([0.0, 0.0, EARTH_ROTATION_RATE], r)
    np.testing.assert_allclose(air_velocity(r, v), expected)
