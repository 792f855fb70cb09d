# SPDX-License-Identifier: Apache-2.0
"""Relays of other people's sensors: axes, units, frames, age."""

import time

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from hypothesis import given
from hypothesis import strategies as st
from rclpy.qos import qos_profile_sensor_data
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import Imu, MagneticField

from css_common.codec import codec_of
from css_common.mission import find_component
from css_common.mission_file import MissionError
from css_drivers.mounting import permutation, turned_covariance

COVARIANCE = np.diag([1.0, 4.0, 9.0]).ravel()


class Relayed:
    """A relay in its node, fed and heard."""

    def __init__(self, bench, mission, executable, message_type, topics, parameters):
        self.bench, self.type, (self.source, target) = bench, message_type, topics
        self.heard = bench.listen(target, message_type)
        self.node = bench.host(find_component("css_drivers", executable), mission(executable, parameters), executable)

    def send(self, stamp_ns=None, frame="bus", **fields):
        sample = codec_of(self.type).sample(time.time_ns() if stamp_ns is None else stamp_ns, frame, **fields)
        self.bench.publish(self.source, self.type, sample)

    def one(self, **given):
        before = len(self.heard)
        self.send(**given)
        self.bench.until(lambda: len(self.heard) > before, "it is passed on")
        return self.heard[-1]


@pytest.fixture
def imu(bench, mission):
    return lambda parameters="": Relayed(bench, mission, "imu_relay", Imu, ("imu/data", "gyro/imu"), parameters)


@pytest.fixture
def mag(bench, mission):
    return lambda parameters="": Relayed(
        bench, mission, "magnetometer_relay", MagneticField, ("imu/mag", "mag/field"), parameters
    )


def test_rates_are_turned_scaled_and_keep_their_covariance(imu):
    relay = imu("axes: -y x z, unit: deg/s, sensor_frame: imu_link")
    message = relay.one(
        frame="imu_link",
        angular_velocity=np.array([10.0, 20.0, 30.0]),
        angular_velocity_covariance=COVARIANCE,
        linear_acceleration=np.array([0.0, 0.0, 9.8]),
    )
    degree = np.pi / 180.0
    np.testing.assert_allclose(message.angular_velocity, np.array([-20.0, 10.0, 30.0]) * degree)
    np.testing.assert_allclose(message.angular_velocity_covariance, np.diag([4.0, 1.0, 9.0]).ravel() * degree**2)
    assert message.frame_id == "bus"
    assert message.orientation_covariance[0] == message.linear_acceleration_covariance[0] == -1.0


def test_gyro_that_says_that_it_has_nothing_says_so_behind_the_relay(imu):
    none = np.array([-1.0] + [0.0] * 8)
    message = imu().one(angular_velocity=np.zeros(3), angular_velocity_covariance=none)
    assert message.angular_velocity_covariance[0] == -1.0


@pytest.mark.parametrize(("unit", "factor"), [("uT", 1e-6), ("nT", 1e-9), ("G", 1e-4), ("mG", 1e-7), ("T", 1.0)])
def test_fields_come_in_tesla(mag, unit, factor):
    turn = Rotation.from_euler("z", 30.0, degrees=True).as_matrix()
    relay = mag(f"unit: {unit}, mounting: {turn.ravel().tolist()}")
    message = relay.one(magnetic_field=np.array([1.0, 2.0, 3.0]))
    np.testing.assert_allclose(message.magnetic_field, factor * (turn @ [1.0, 2.0, 3.0]))


def test_driver_that_publishes_with_best_effort_is_heard(imu, bench):
    relay = imu()
    publisher = bench.node.create_publisher(Imu, "imu/data", qos_profile_sensor_data)
    codec = codec_of(Imu)

    def hears():
        publisher.publish(codec.encode(codec.sample(time.time_ns(), "bus", angular_velocity=np.ones(3))))
        bench.executor.spin_once(timeout_sec=0.02)
        return relay.heard

    bench.until(hears, "it is passed on")
    assert relay.heard[0].angular_velocity.tolist() == [1.0, 1.0, 1.0]


def test_old_messages_are_left_out_and_said(imu, bench):
    relay = imu("max_age: 0.2")
    relay.send(stamp_ns=time.time_ns() - 10**9, angular_velocity=np.ones(3))
    bench.until(lambda: relay.node.health().counters.get("left_out_old") == 1, "it is counted")
    assert relay.node.health().level == DiagnosticStatus.WARN
    assert bench.until(lambda: bench.logged("max_age is 0.2 s"), "it is said") is None
    assert relay.heard == []


def test_driver_without_a_clock_gets_the_time_of_arrival(imu):
    relay = imu("stamps: arrival")
    before = time.time_ns()
    stamps = [relay.one(stamp_ns=0, angular_velocity=np.ones(3)).stamp_ns for _ in range(3)]
    assert before < stamps[0] < stamps[1] < stamps[2] < time.time_ns()


def test_silent_sensor_and_wrong_frame_are_said(imu, bench):
    relay = imu("max_age: 0.05")
    relay.send(frame="imu_link", angular_velocity=np.ones(3))
    bench.until(lambda: relay.node.health().counters.get("sensor.rejected.wrong_frame") == 1, "it is refused")
    relay.one(angular_velocity=np.ones(3))
    bench.until(lambda: "no message of imu/data" in relay.node.health().message, "silence is said")
    assert relay.node.health().level == DiagnosticStatus.ERROR


@pytest.mark.parametrize(
    ("parameters", "reason"),
    [
        ("axes: x y", "three of x, y, z"),
        ("axes: x y w", "three of x, y, z"),
        ("axes: x x z", "each of x, y and z once"),
        ("axes: x y -z", "mirrors"),
        ("mounting: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 2.0]", "no rotation"),
        ("unit: rpm", "rad/s, deg/s"),
    ],
)
def test_mountings_that_cannot_be_are_refused(mission, parameters, reason):
    with pytest.raises(MissionError, match=reason):
        mission("imu_relay", parameters)


@given(st.permutations("xyz"), st.lists(st.sampled_from(["", "-"]), min_size=3, max_size=3))
def test_turned_covariance_is_that_of_turned_draws(order, signs):
    matrix = permutation(" ".join(s + a for s, a in zip(signs, order, strict=True)))
    root = np.array([[1.0, 0.0, 0.0], [0.3, 2.0, 0.0], [-0.5, 0.7, 1.5]])
    turned = turned_covariance(matrix, (root @ root.T).ravel(), 2.0).reshape(3, 3)
    columns = 2.0 * matrix @ root  # of vectors whose outer products sum up to it
    np.testing.assert_allclose(turned, columns @ columns.T, atol=1e-12)
