# SPDX-License-Identifier: Apache-2.0
"""A study flies with the gyro that the mission has, and says no other."""

from argparse import Namespace
from typing import Any

import numpy as np
import pytest

from css_analysis.configured_mission import configured
from css_analysis.errors import StudyError
from css_analysis.flight_log import FlightLog
from css_common.mission import Mission, load_mission
from css_monte_carlo.verbs.monte_carlo import _configurations
from css_msgs.msg import SunEstimate

NODES = "css_sim/dynamics,css_sim/css_array,css_estimation/ekf,sunpoint_control/mrp_control"


def gyros(mission: Mission, *asked: str) -> list[bool]:
    options = Namespace(sweep=[], estimators=[], gyro=list(asked) or None)
    return [one.gyro for one in _configurations(mission, options)]


def test_without_being_told_a_study_has_the_gyro_of_the_mission():
    assert gyros(load_mission("okeefe_2013")) == [True]
    assert gyros(load_mission("okeefe_2013", ["ekf.use_gyro=false"])) == [False]
    assert gyros(load_mission("clark_1996_flat")) == [False]
    # an estimator that may use a gyro, and a graph that has none
    assert gyros(load_mission("okeefe_2013", [f"graph.nodes={NODES}"])) == [False]


def test_a_gyro_that_no_node_has_is_not_flown_with():
    assert gyros(load_mission("okeefe_2013"), "on", "off") == [True, False]
    with pytest.raises(StudyError, match=r"--gyro on: .*has no gyro in graph.nodes; expected off"):
        gyros(load_mission("clark_1996_flat"), "off", "on")


def test_off_changes_nothing_where_there_is_none():
    mission = load_mission("okeefe_2013", [f"graph.nodes={NODES}"])
    assert configured(mission, gyro=False).parameters == mission.parameters
    assert not configured(load_mission("okeefe_2013"), gyro=False).node("ekf").values.use_gyro


@pytest.mark.parametrize(("source", "used"), [(SunEstimate.RATE_SUN, False), (SunEstimate.RATE_GYRO, True)])
def test_a_flight_without_a_gyro_does_not_say_that_it_had_one(source, used):
    estimates: Any = Namespace(rate_source=np.full(3, source))
    bare = FlightLog(
        "bare", estimates={"ekf": estimates}, mission=load_mission("okeefe_2013", [f"graph.nodes={NODES}"])
    )
    # rates from outside of the graph, of hardware
    assert bare.uses_gyro("ekf") == used
    fitted = FlightLog("fitted", estimates={"ekf": estimates}, mission=load_mission("okeefe_2013"))
    assert fitted.uses_gyro("ekf")
