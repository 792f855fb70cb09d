# SPDX-License-Identifier: Apache-2.0
"""Verdicts of an algorithm become messages and lines of the log when they change, and only then."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from message_numbers import shared_numbers

from css_common import health
from css_common.component import Component
from css_common.health import SORT_GYRO, SORT_WHEEL, Verdict, held_mask, hold, new_verdicts, release, verdicts_of
from css_common.health_report import HealthReport, health_output
from css_common.health_words import EVIDENCE_WORDS
from css_common.mission import load_mission
from css_msgs.msg import Faults, Health


class Judge(Component):
    """A component that holds units for failed."""

    shared = ("wheels",)
    lines: list[str]

    @classmethod
    def outputs(cls, name, values):
        return (health_output(name),)


@pytest.fixture
def judge():
    values = load_mission("okeefe_2013").node("mrp_control").values
    judge = Judge("judge", values)
    judge.lines = []
    judge.report = judge.lines.append
    return judge


def stamp(component, step):
    return component.epoch_ns + step * component.period_ns


@pytest.mark.parametrize(("message", "count"), [(Faults, 6 + 19), (Health, 15)])
def test_numbers_are_those_of_the_messages(message, count):
    own, stated = shared_numbers(health, message)
    assert own == stated and len(own) == count


def test_each_evidence_has_its_words():
    assert set(EVIDENCE_WORDS) == {getattr(Health, name) for name in dir(type(Health)) if name.startswith("EVIDENCE_")}


def test_a_verdict_is_told_once_and_again_when_it_is_withdrawn(judge):
    rows = new_verdicts(SORT_WHEEL, 4)
    report = HealthReport(lambda verdict: f"wheel {verdict.unit} is commanded nothing")
    assert report.told(judge, stamp(judge, 0), rows, 0) == {}
    hold(rows[2], health.KIND_DEAD, health.EVIDENCE_RESPONSE, 12.5, 5.0, 30)
    message = report.told(judge, stamp(judge, 50), rows, 50)["health"]
    assert message.stamp_ns == stamp(judge, 50)
    assert [message.sort.tolist(), message.unit.tolist(), message.kind.tolist(), message.evidence.tolist()] == [
        [Faults.SORT_WHEEL],
        [2],
        [Faults.KIND_DEAD],
        [Health.EVIDENCE_RESPONSE],
    ]
    assert message.rows.tolist() == [12.5, 5.0, 3.0]
    assert judge.left_out == ("wheel.2",)
    assert judge.lines == [
        "wheel.2 held for failed at 5 s, dead: it does not what it is commanded (12.5, more than 5, from 3 s on); "
        "wheel 2 is commanded nothing"
    ]
    assert report.told(judge, stamp(judge, 51), rows, 51) == {}
    health.rename(rows[2], health.KIND_FRICTION)
    message = report.told(judge, stamp(judge, 52), rows, 52)["health"]
    assert message.kind.tolist() == [Faults.KIND_FRICTION] and message.rows[2] == 3.0
    release(rows[2])
    message = report.told(judge, stamp(judge, 60), rows, 60)["health"]
    assert message.unit.tolist() == [] and message.rows.tolist() == []
    assert judge.left_out == ()
    assert judge.lines[1:] == ["wheel.2 at 5.2 s: taken for friction, no longer for dead", "wheel.2 used again at 6 s"]


def test_since_is_counted_back_from_the_stamp_in_the_cycles_of_the_algorithm(judge):
    rows = new_verdicts(SORT_GYRO, 3)
    hold(rows[1], health.KIND_UNKNOWN, health.EVIDENCE_SUN, 1.0, 0.5, 7)
    report = HealthReport()
    message = report.told(judge, stamp(judge, 1000), rows, 27)["health"]  # a node that began at cycle 973
    assert message.rows[2] == pytest.approx(98.0)
    assert judge.lines[0].startswith("gyro.y held for failed at 100 s, wrong in a way that has no name: the motion")
    assert judge.lines[0].endswith("; left out")


def test_a_node_that_begins_late_says_that_it_holds_nothing(judge):
    message = HealthReport().told(judge, stamp(judge, 40), new_verdicts(SORT_WHEEL, 4), 0)["health"]
    assert message.unit.tolist() == []
    assert judge.lines == []


@given(st.sets(st.integers(0, 31)))
def test_rows_that_are_released_are_as_new(units):
    rows = new_verdicts(SORT_WHEEL, 32)
    for unit in units:
        hold(rows[unit], health.KIND_SIGN, health.EVIDENCE_MOMENTUM, 3.0, 2.0, unit)
    assert held_mask(rows) == sum(1 << unit for unit in units)
    assert verdicts_of(rows) == [
        Verdict(SORT_WHEEL, unit, Faults.KIND_SIGN, Health.EVIDENCE_MOMENTUM, 3.0, 2.0, unit) for unit in sorted(units)
    ]
    for unit in units:
        release(rows[unit])
    assert rows.tobytes() == new_verdicts(SORT_WHEEL, 32).tobytes()
