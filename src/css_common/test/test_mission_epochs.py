# SPDX-License-Identifier: Apache-2.0
"""When the cases of a mission begin."""

import numpy as np
import pytest

from css_common.epochs import mission_epoch, parse_utc
from css_common.mission import MissionError, load_mission
from css_common.mission_section import MISSION
from css_common.schema import default_values

DAY_NS = 86_400 * 10**9


def epoch(case, days):
    given = {"mission__epoch": "2013-06-01T00:00:00Z", "mission__case": case, "mission__epoch_spread_days": days}
    return mission_epoch(default_values(MISSION, **given).mission)


def test_without_a_spread_all_begin_at_the_epoch():
    assert {epoch(case, 0.0) for case in range(5)} == {parse_utc("2013-06-01T00:00:00Z")}


def test_cases_begin_at_whole_seconds_evenly_over_the_days():
    after = np.array([epoch(case, 365.0) for case in range(1000)]) - parse_utc("2013-06-01T00:00:00Z")
    assert np.all(after % 10**9 == 0) and after.min() >= 0 and after.max() < 365 * DAY_NS
    assert abs(after.mean() / DAY_NS - 182.5) < 10.0 and abs(after.std() / DAY_NS - 365.0 / np.sqrt(12.0)) < 5.0
    assert epoch(3, 365.0) == epoch(3, 365.0)


def test_the_stamps_of_a_case_begin_there():
    mission = load_mission("okeefe_2013", ["mission.case=3", "mission.epoch_spread_days=365"])
    assert mission.epoch_ns == epoch(3, 365.0)
    node = mission.node("dynamics")
    assert node.component("dynamics", node.values).epoch_ns == mission.epoch_ns


def test_no_case_may_end_after_the_last_stamp():
    with pytest.raises(MissionError, match=r"mission.epoch: .* expected a flight"):
        load_mission("okeefe_2013", ["mission.epoch_spread_days=9200"])
