# SPDX-License-Identifier: Apache-2.0
"""Sensors with latency in a flight: what bears a stamp is what others said of an earlier one."""

import numpy as np

from css_common.mission import load_mission
from css_monte_carlo.direct_flight import fly_and_keep

QUIET = (
    "mission.duration=20.0",
    "css_array.degradation=0.0",
    "css_array.albedo.enabled=false",
    "gyro.noise_deg_s=0.0",
    "magnetometer.noise_nt=0.0",
)
NODES = "css_sim/dynamics,css_sim/css_array,css_sim/gyro,css_sim/magnetometer,css_estimation/wavg"
FIELDS = {
    "css/voltages": ("css_array", "voltages"),
    "gyro/imu": ("gyro", "angular_velocity"),
    "mag/field": ("magnetometer", "magnetic_field"),
}


def readings(*changes):
    """What each sensor said, by topic, and at which stamps."""
    mission = load_mission("okeefe_2013", [f"graph.nodes={NODES}", "graph.estimator=wavg"])
    messages = fly_and_keep(mission.with_overrides([*QUIET, *changes]), FIELDS)
    stamps = {topic: [m.stamp_ns for m in said] for topic, said in messages.items()}
    return {t: np.array([getattr(m, FIELDS[t][1]) for m in said]) for t, said in messages.items()}, stamps


def late(seconds):
    return [f"{node}.latency={seconds}" for node, _ in FIELDS.values()]


def test_whole_cycles_late_is_the_same_reading_later():
    prompt, stamps = readings()
    delayed, same_stamps = readings(*late(0.3))
    assert stamps == same_stamps
    for topic, said in prompt.items():
        np.testing.assert_array_equal(delayed[topic][3:], said[:-3])
        np.testing.assert_array_equal(delayed[topic][:3], np.broadcast_to(said[0], (3, said.shape[1])))
        assert not np.array_equal(delayed[topic][3:], said[3:])


def test_half_a_cycle_late_is_what_twice_as_fast_sensors_said_between():
    fast, _ = readings("mission.period=0.05")
    delayed, _ = readings(*late(0.05))
    for topic, tolerance in (("css/voltages", 2e-5), ("gyro/imu", 1e-6), ("mag/field", 1e-9)):
        between = fast[topic][1::2][:-1]
        change = np.abs(fast[topic][2::2][: len(between)] - between)
        np.testing.assert_allclose(delayed[topic][1:], between, atol=tolerance)
        assert np.max(change) > 10.0 * tolerance
