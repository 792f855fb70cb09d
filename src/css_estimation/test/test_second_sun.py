# SPDX-License-Identifier: Apache-2.0
"""Two lit cells leave two Suns: the Sun filter says so until cells or motion tell, and is right from then on."""

import math

import numpy as np
import pytest
from sun_filter_flight import SunFilterFlight

from css_estimation.sun_filter.filter_state import MODE_CONVERGING, MODE_SEARCHING

# on either side of the plane of two cells of the dual pyramid, of which no other cell sees a Sun so near to it
BETWEEN, BESIDE = np.array([1.0, 1.0, 2.0]) / math.sqrt(6.0), np.array([1.0, 1.0, -1.0]) / math.sqrt(3.0)
SIDES = pytest.mark.parametrize("off_deg", [-10.0, -6.0, 6.0, 10.0])
EARTH = pytest.mark.parametrize("earth", [None, (0.3, 0.9, 0.2)], ids=["no orbit", "orbit"])


def sun_at(off_deg):
    off = math.radians(off_deg)
    return tuple(math.cos(off) * BETWEEN + math.sin(off) * BESIDE)


def error_bars_off(flight, heading):
    """Error across the plane of the cells over its error bar."""
    off = np.array(flight.sun_b) - np.array(heading.sun_b)
    return abs(off @ BESIDE) / math.sqrt(BESIDE @ np.reshape(heading.covariance, (3, 3)) @ BESIDE)


@SIDES
@EARTH
def test_at_rest_both_suns_are_within_the_error_bar(off_deg, earth):
    flight = SunFilterFlight(sun_at(off_deg), white=0.005, earth=earth)
    for _ in range(400):
        heading = flight.step(gyro=True)
        # neither are turns about the Sun line looked for, which might be the wrong one
        assert heading.mode in (MODE_SEARCHING, MODE_CONVERGING)
        assert error_bars_off(flight, heading) < 3.0


@SIDES
@EARTH
@pytest.mark.parametrize("gyro", [True, False])
def test_turning_it_goes_on_with_the_right_one(off_deg, earth, gyro):
    flight = SunFilterFlight(sun_at(off_deg), (0.01, -0.01, 0.0), white=0.005, earth=earth)
    error_deg = math.inf
    for _ in range(900):
        heading = flight.step(gyro=gyro)
        if heading.mode not in (MODE_SEARCHING, MODE_CONVERGING):
            break
        assert error_bars_off(flight, heading) < 3.0
        error_deg = flight.error_deg(heading)
    assert heading.mode not in (MODE_SEARCHING, MODE_CONVERGING)
    # what is left is the light of an Earth that it reckons with and that is not there
    assert error_deg < 10.0
