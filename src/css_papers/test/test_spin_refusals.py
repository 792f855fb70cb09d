# SPDX-License-Identifier: Apache-2.0
"""Refusals by reason add up to all refusals."""

from types import SimpleNamespace
from typing import Any

from css_analysis.spin_flight import UNNAMED, spin_flight
from css_common.mission import load_mission
from css_estimation.spin.slit_passage import REASON_DOUBLE, REASON_MISSED, REASON_NONE, REASON_TIMER, REASONS
from css_msgs.msg import SlitSunAngle


def test_several_refusals_in_one_cycle_are_counted_although_one_is_named():
    cycles = [(0, REASON_NONE), (1, REASON_MISSED), (1, REASON_NONE), (4, REASON_DOUBLE), (5, REASON_MISSED)]
    cycles += [(6, REASON_TIMER), (6, REASON_NONE)]
    angles: list[Any] = [
        SimpleNamespace(refused=refused, reason=reason, validity=SlitSunAngle.VALIDITY_HELD)
        for refused, reason in cycles
    ]
    flight = spin_flight(load_mission("esprit_2006"), {SlitSunAngle: angles})
    assert flight.reasons == {
        REASONS[REASON_MISSED]: 2,
        REASONS[REASON_DOUBLE]: 1,
        UNNAMED: 2,
        REASONS[REASON_TIMER]: 1,
    }
    assert flight.reasons.total() == flight.refused == 6
