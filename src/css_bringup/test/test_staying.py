# SPDX-License-Identifier: Apache-2.0
"""Flights one after another in one process: what `/flight/reset` takes, what it refuses, and what flies then."""

import pytest
from diagnostic_msgs.msg import DiagnosticStatus

from css_bringup.flight_director import FlightDirector, Wish
from css_bringup.flight_result import FlightResult
from css_bringup.staying import mission_of_wish
from css_common.mission import load_mission
from css_common.testing import Bench
from css_msgs.srv import ResetFlight

FLIES = Wish("okeefe_2013", ("mission.case=4", "ekf.use_gyro=false"))


@pytest.fixture
def reset():
    """Asks a director that flies case 4 without gyro; its answer and what it was asked for."""
    with Bench() as bench:
        mission = mission_of_wish(FLIES)
        director = FlightDirector(bench.context, FLIES, mission, mission_of_wish)
        bench.add(director)

        def ask(**fields):
            director.asked = None
            answer = bench.request(ResetFlight, "/flight/reset", ResetFlight.Request(**{"case_number": -1, **fields}))
            assert answer.success == (answer.message == "") == (director.asked is not None)
            return answer.message, director.asked

        yield ask, director


def test_another_case_keeps_what_was_asked_for_when_told(reset):
    ask, _ = reset
    _, (wish, mission) = ask(case_number=9, keep=True)
    assert (mission.values.mission.case, mission.node("ekf").values.use_gyro) == (9, False)
    assert wish.overrides == ("mission.case=9", "ekf.use_gyro=false")
    _, (wish, mission) = ask(case_number=9)
    assert (mission.values.mission.case, mission.node("ekf").values.use_gyro) == (9, True)
    _, (wish, mission) = ask(overrides=["ekf.gate=0.2"], paused=True)
    assert (mission.values.mission.case, mission.node("ekf").values.gate, wish.paused) == (4, 0.2, True)


def test_another_estimator_takes_the_place_of_the_one_that_flies(reset):
    ask, _ = reset
    _, (_, mission) = ask(estimator="wavg")
    assert [node.name for node in mission.nodes] == ["dynamics", "css_array", "gyro", "wavg", "mrp_control"]
    assert mission.values.graph.estimator == "wavg"
    _, (wish, _) = ask(estimator="ekf")
    assert wish.overrides == ("mission.case=4",)


@pytest.mark.parametrize(
    ("fields", "complaint"),
    [
        ({"case_number": -2}, "case_number: -2 given, expected a number from 0 on, or -1"),
        ({"mission": "okeefe_2014"}, "okeefe_2014"),
        ({"overrides": ["ekf.gate"]}, "'ekf.gate' given, expected KEY=VALUE"),
        ({"overrides": ["ekf.gate=7"]}, "gate"),
        ({"estimator": "nobody"}, "css_estimation/nobody"),
        ({"estimator": "ekf", "overrides": ["mrp_control.gains.rate=1e9"]}, "gains.rate"),
    ],
)
def test_what_cannot_fly_is_refused_and_the_flight_goes_on(reset, fields, complaint):
    ask, _ = reset
    message, asked = ask(**fields)
    assert asked is None
    assert complaint in message and "\n" not in message


def test_diagnostics_say_what_flies_and_how_it_ended(reset):
    _, director = reset
    assert director.health().message == "flying okeefe_2013, case 4"
    mission = load_mission("okeefe_2013", ["mission.case=4"])
    for result, level, message in (
        (FlightResult(mission, steps=7), DiagnosticStatus.OK, "ended: okeefe_2013, case 4"),
        (FlightResult(mission, notes=["held"]), DiagnosticStatus.WARN, "ended: okeefe_2013, case 4"),
        (FlightResult(mission, failure="it broke"), DiagnosticStatus.ERROR, "ended: it broke"),
    ):
        director.ended(result)
        assert director.health()[:2] == (level, message)
