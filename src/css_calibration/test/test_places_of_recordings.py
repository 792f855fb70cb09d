# SPDX-License-Identifier: Apache-2.0
"""Where a spacecraft was, by the orbit of its mission: an element set of another time tells nothing, and says so."""

import numpy as np
import pytest

from css_calibration.calibration import reference_of
from css_calibration.errors import CalibrationError
from css_calibration.recorded import recorded_of
from css_common.epochs import parse_utc
from css_common.message_columns import Columns
from css_common.mission import mission_from_text
from css_environment.tle_checks import checksum
from css_msgs.msg import CssVoltages

LINE1 = "1 25544U 98067A   13152.50000000  .00006000  00000-0  11000-3 0  9998"
LINE2 = "2 25544  51.6450 100.0000 0010000  60.0000 300.0000 15.50000000832003"
MISSION = f"""
/**:
  ros__parameters:
    mission: {{name: mine, epoch: "2013-06-01T12:00:00Z", duration: 100.0, period: 1.0}}
    orbit:
      source: tle
      tle_line1: "{LINE1}"
      tle_line2: "{LINE2[:-1]}{checksum(LINE2)}"
    cells: {{normals: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0], field_of_view_deg: 180.0}}
"""


def recorded(begin: str):
    stamps = parse_utc(begin) + np.arange(100) * 10**9
    cells = Columns(stamps, voltages=np.full((100, 2), 0.5), saturated=np.zeros(100, np.int64))
    return recorded_of("bag", mission_from_text(MISSION, "mine"), {CssVoltages: cells}, [])


def test_a_set_of_the_day_gives_places():
    of_the_day = recorded("2013-06-01T12:00:00Z")
    assert of_the_day.r_n is not None and of_the_day.notes == []
    assert np.linalg.norm(of_the_day.r_n, axis=1) == pytest.approx(6.79e6, rel=0.01)


def test_a_set_of_weeks_ago_is_doubted_and_used():
    late = recorded("2013-07-01T12:00:00Z")
    assert late.r_n is not None
    assert ["used up to 30.0 days after its epoch" in note for note in late.notes] == [True]


def test_a_set_of_years_ago_gives_none():
    years_later = recorded("2023-06-01T12:00:00Z")
    assert years_later.r_n is None
    assert ["used up to 3652.0 days after its epoch" in note for note in years_later.notes] == [True]
    with pytest.raises(CalibrationError, match=r"the place \(orbit.tle_line1: the set of 2013-06-01T12:00 is used"):
        reference_of(years_later, "batch")
