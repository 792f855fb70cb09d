# SPDX-License-Identifier: Apache-2.0
"""Switching the gyro off and on in flight, by an event of the mission and by a lifecycle request."""

from itertools import pairwise

import numpy as np
import pytest
from flights import fly_composed, messages_by_topic, samples, short_mission
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.node import Node
from sensor_msgs.msg import Imu

from css_bringup.composed import ComposedFlight
from css_common.mission import find_mission, mission_from_text
from css_msgs.msg import SunEstimate

EVENTS = """
    events:
      gyro_off: {time: 20.0, node: gyro, action: deactivate}
      gyro_on: {time: 40.0, node: gyro, action: activate}
"""


@pytest.fixture
def scripted(tmp_path):
    text = find_mission("okeefe_2013").read_text().replace("    criteria:", EVENTS + "    criteria:")
    return mission_from_text(text, "scripted", ["mission.duration=60.0"])


def test_event_switches_the_estimator_to_sun_rates_and_back(scripted, tmp_path):
    result = fly_composed(scripted, tmp_path / "bag")
    assert result.messages_lost == 0
    imu = samples(tmp_path / "bag", "/gyro/imu", Imu)
    off = np.array([s.angular_velocity_covariance[0] == -1.0 for s in imu])
    assert np.array_equal(np.flatnonzero(off), np.arange(200, 400))
    assert all(np.all(s.angular_velocity == 0.0) for s in imu[200:400])
    source = np.array([s.rate_source for s in samples(tmp_path / "bag", "/ekf/sun_estimate", SunEstimate)])
    assert np.all(source[1:200] == SunEstimate.RATE_GYRO)
    assert np.all(np.isin(source[200:400], (SunEstimate.RATE_SUN, SunEstimate.RATE_NONE)))
    assert np.count_nonzero(source[200:400] == SunEstimate.RATE_SUN) > 150
    assert np.all(source[400:] == SunEstimate.RATE_GYRO)


def test_scripted_flights_repeat_to_the_byte(scripted, tmp_path):
    fly_composed(scripted, tmp_path / "first")
    fly_composed(scripted, tmp_path / "second")
    assert messages_by_topic(tmp_path / "first") == messages_by_topic(tmp_path / "second")


def test_lifecycle_request_from_another_node(tmp_path):
    mission = short_mission(3600.0)
    with ComposedFlight(mission, tmp_path / "bag") as flight:
        operator = Node("operator", context=flight.context, use_global_arguments=False)
        client = operator.create_client(ChangeState, "gyro/change_state")
        asked = []

        def ask(transition: int) -> None:
            asked.append(client.call_async(ChangeState.Request(transition=Transition(id=transition))))

        def follow(seconds: float) -> None:
            if client.service_is_ready() and not asked:
                ask(Transition.TRANSITION_DEACTIVATE)
            elif len(asked) == 1 and asked[0].done() and seconds > 60.0:
                ask(Transition.TRANSITION_ACTIVATE)
            elif len(asked) == 2 and asked[1].done() and seconds > 120.0:
                flight.plant.done = True

        flight.executor.add_node(operator)
        flight.fly(follow)
        assert [future.result().success for future in asked] == [True, True]
        flight.executor.remove_node(operator)
        operator.destroy_node()
    source = [s.rate_source for s in samples(tmp_path / "bag", "/ekf/sun_estimate", SunEstimate)]
    changes = [source[0], *(b for a, b in pairwise(source) if b != a)]
    used = [c for c in changes if c != SunEstimate.RATE_NONE]
    assert used[0] == SunEstimate.RATE_GYRO
    assert SunEstimate.RATE_SUN in used
    assert used[-1] == SunEstimate.RATE_GYRO
