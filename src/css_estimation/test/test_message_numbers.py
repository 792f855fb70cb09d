# SPDX-License-Identifier: Apache-2.0
"""What compiled functions write into messages is what the messages mean by it."""

import pytest
from message_numbers import shared_numbers

from css_estimation.attitude import attitude_solution
from css_estimation.spin import coning, slit_passage
from css_estimation.sun import sun_heading
from css_msgs.msg import AttitudeEstimate, ConingEstimate, SlitPulse, SlitSunAngle, SunEstimate
from css_sensors.slits import LOWER, UPPER, VERTICAL


@pytest.mark.parametrize(
    ("module", "message", "count"),
    [
        (sun_heading, SunEstimate, 14),
        (attitude_solution, AttitudeEstimate, 6),
        (slit_passage, SlitSunAngle, 10),
        (coning, ConingEstimate, 5),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_numbers_are_those_of_the_message(module, message, count):
    own, stated = shared_numbers(module, message)
    assert own == stated and len(own) == count


def test_slits_are_those_of_the_pulses():
    stated = (SlitPulse.SLIT_UPPER, SlitPulse.SLIT_VERTICAL, SlitPulse.SLIT_LOWER)
    assert stated == (UPPER, VERTICAL, LOWER)
