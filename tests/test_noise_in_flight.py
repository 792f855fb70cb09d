# SPDX-License-Identifier: Apache-2.0
"""Noise of sensors is set in flight, by a parameter or by the mission, on the graph as in a study."""

import numpy as np
import pytest
from flights import messages_by_topic, operator_of, samples
from rclpy.parameter import Parameter
from test_faults_in_flight import CASE, mission_with, trace_of

from css_analysis.flight_log import read_flight
from css_bringup.composed import ComposedFlight
from css_common.codec import codec_of
from css_common.random_streams import Stream, normal4, random_key
from css_monte_carlo.chunk import fly_cases
from css_monte_carlo.direct_flight import fly_and_keep, fly_directly
from css_monte_carlo.mission_flight import MissionFlight

SET = {
    "cells": ("css_array", "noise", 0.05),
    "loss": ("css_array", "degradation", 0.5),
    "rates": ("gyro", "noise_deg_s", 0.5),
    "field": ("magnetometer", "noise_nt", 5000.0),
}


def events(at: float) -> str:
    return "    events:\n" + "".join(
        f"      {name}: {{time: {at!r}, node: {node}, action: set, parameter: {parameter}, value: {value!r}}}\n"
        for name, (node, parameter, value) in SET.items()
    )


def test_scripted_noise_is_the_same_on_the_graph_directly_and_in_the_compiled_loop(tmp_path):
    mission = mission_with(events(2.0), duration=4.0)
    with ComposedFlight(mission, tmp_path / "bag") as flight:
        assert flight.fly().notes == []
    kept = fly_and_keep(mission, mission.topics)
    recorded = messages_by_topic(tmp_path / "bag")
    for topic, given in kept.items():
        encode = codec_of(mission.topics[topic]).encode
        assert [(s.stamp_ns, encode(s)) for s in given] == recorded.get(f"/{topic}", []), topic
    trace = fly_cases(MissionFlight(mission), np.array([1, CASE]), 10, traced=True).trace
    np.testing.assert_array_equal(trace[1], trace_of(read_flight(tmp_path / "bag")))
    np.testing.assert_array_equal(trace[0], trace_of(fly_directly(mission.with_overrides(["mission.case=1"]))))


def test_readings_scatter_and_say_so_from_the_change_on():
    """Up to the change the truth is the same; draws are, so that the noise is that of before times a factor."""
    mission, plain = mission_with(events(2.0), duration=2.1), mission_with("", duration=2.1)
    quiet = mission_with("", "gyro.noise_deg_s=0", duration=2.1)
    loud, usual, none = (fly_and_keep(of, ["gyro/imu"])["gyro/imu"] for of in (mission, plain, quiet))
    np.testing.assert_array_equal(loud[19].angular_velocity, usual[19].angular_velocity)
    noise = [np.asarray(s[0].angular_velocity) - none[0].angular_velocity for s in (loud, usual)]
    np.testing.assert_array_equal(*noise)
    # at the change the truth of both flights is still the same
    turned = np.asarray(loud[20].angular_velocity) - usual[20].angular_velocity
    drawn = np.array(normal4(random_key(mission.values.mission.seed, CASE), Stream.GYRO_NOISE, 20, 0)[:3])
    np.testing.assert_allclose(turned, np.radians(0.5 - 0.01) * drawn, rtol=1e-12)
    variances = [s.angular_velocity_covariance[0] for s in loud]
    assert np.unique(variances[:20]).size == 1
    assert variances[20] - variances[19] == pytest.approx(np.radians(0.5) ** 2 - np.radians(0.01) ** 2)


def test_a_parameter_set_in_flight_acts_from_the_next_cycle_on(tmp_path):
    """As the event of that time does."""
    mission = mission_with("", duration=4.0)
    with ComposedFlight(mission, tmp_path / "bag") as flight:
        done: list[int] = []

        def change() -> None:
            if not done and flight.plant.stamp_ns >= mission.epoch_ns + 10**9:
                done.append(flight.plant.stamp_ns)
                for node, name, value in SET.values():
                    (result,) = flight.nodes[node].set_parameters([Parameter(name, value=value)])
                    assert result.successful

        with operator_of(flight, change):
            flight.fly()
    assert done
    gyro = samples(tmp_path / "bag", "/gyro/imu", mission.topics["gyro/imu"])
    variances = [s.angular_velocity_covariance[0] for s in gyro]
    changed = int(np.flatnonzero(np.diff(variances))[0]) + 1
    assert changed >= 10
    scripted = fly_and_keep(mission_with(events(changed * 0.1), duration=4.0), ["gyro/imu"])["gyro/imu"]
    assert variances == [s.angular_velocity_covariance[0] for s in scripted]
