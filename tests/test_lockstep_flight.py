# SPDX-License-Identifier: Apache-2.0
"""The whole graph in lockstep, composed: every stamp answered by every node, recorded without loss, repeatable."""

import numpy as np
from flights import fly_composed, messages_by_topic, samples, short_mission, stamped_topics

from css_bringup.composed import ComposedFlight
from css_msgs.msg import ControlStatus, SpacecraftState, SunEstimate


def test_every_topic_has_every_stamp_once_and_in_order(tmp_path):
    mission = short_mission(20.0)
    result = fly_composed(mission, tmp_path / "bag")
    assert result.failure == ""
    assert result.steps == 200
    assert result.messages_lost == 0
    expected = [mission.epoch_ns + k * mission.period_ns for k in range(200)]
    recorded = messages_by_topic(tmp_path / "bag")
    for topic in stamped_topics(mission):
        assert [stamp for stamp, _ in recorded[f"/{topic}"]] == expected, topic


def test_the_same_case_gives_the_same_bytes(tmp_path):
    mission = short_mission(10.0)
    fly_composed(mission, tmp_path / "first")
    fly_composed(mission, tmp_path / "second")
    assert messages_by_topic(tmp_path / "first") == messages_by_topic(tmp_path / "second")


def test_both_executors_give_the_same_bytes(tmp_path):
    mission = short_mission(5.0)
    for kind in ("events", "draining"):
        with ComposedFlight(mission, tmp_path / kind, executor=kind) as flight:
            assert flight.fly().failure == ""
    assert messages_by_topic(tmp_path / "events") == messages_by_topic(tmp_path / "draining")


def test_another_case_tumbles_another_way(tmp_path):
    rates = []
    for case in (1, 2):
        fly_composed(short_mission(1.0, f"mission.case={case}"), tmp_path / str(case))
        rates.append(samples(tmp_path / str(case), "/truth", SpacecraftState)[0].omega_bn_b)
    assert not np.array_equal(rates[0], rates[1])
    assert np.all(np.abs(rates) <= np.radians(2.0))


def test_the_spacecraft_finds_the_sun(tmp_path):
    fly_composed(short_mission(240.0), tmp_path / "bag")
    truth = samples(tmp_path / "bag", "/truth", SpacecraftState)
    status = samples(tmp_path / "bag", "/control/status", ControlStatus)
    assert status[-1].mode == ControlStatus.MODE_SUN_POINT
    assert np.degrees(np.linalg.norm(truth[-1].omega_bn_b)) < 0.5
    assert np.degrees(status[-1].pointing_error) < 30.0


def test_an_estimator_that_only_watches_does_not_fall_behind(tmp_path):
    nodes = (
        "css_sim/dynamics,css_sim/css_array,css_sim/gyro,css_estimation/ekf,css_estimation/wavg,"
        "sunpoint_control/mrp_control"
    )
    mission = short_mission(10.0, f"graph.nodes={nodes}")
    assert set(mission.awaited) == {"wheels/torque_command", "wavg/sun_estimate"}
    result = fly_composed(mission, tmp_path / "bag")
    assert result.messages_lost == 0
    assert len(samples(tmp_path / "bag", "/wavg/sun_estimate", SunEstimate)) == 100


def test_real_time_flight_holds_its_pace():
    mission = short_mission(2.0, "lockstep.realtime_factor=4.0")
    with ComposedFlight(mission) as flight:
        result = flight.fly()
        assert result.steps == 20
        # paced from below by the wall clock: never faster than asked (the machine may make it slower)
        assert result.wall_s >= 0.95 * 19 * 0.1 / 4.0
