# SPDX-License-Identifier: Apache-2.0
"""What compiled functions read and write in messages is what the messages mean by it."""

import pytest
from message_numbers import shared_numbers

from css_msgs.msg import ControlStatus, SunEstimate
from sunpoint_control import magnetic_control, modes, sun_pointing_control


@pytest.mark.parametrize(
    ("module", "message", "count"),
    [(modes, ControlStatus, 16), (sun_pointing_control, SunEstimate, 4), (magnetic_control, SunEstimate, 3)],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_numbers_are_those_of_the_message(module, message, count):
    own, stated = shared_numbers(module, message)
    assert own == stated and len(own) == count
