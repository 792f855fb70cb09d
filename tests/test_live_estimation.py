# SPDX-License-Identifier: Apache-2.0
"""Estimators on devices with clocks of their own: stamps that never coincide, jitter, gaps, messages that come late.

One parameter file, as users of ROS write them, serves the estimator; its node runs on a real executor. Stamps are made
up, so nothing waits for a clock.
"""

from pathlib import Path

import numpy as np
import pytest
from sensor_msgs.msg import Imu

from css_common.codec import codec_of
from css_common.mission import find_component
from css_common.node_arguments import mission_of_arguments
from css_common.testing import Bench
from css_msgs.msg import CssVoltages, SunEstimate

FILE = """\
camera:
  ros__parameters: {fps: 30, name: front}
/**:
  ros__parameters:
    use_sim_time: false
    cells:
      normals: [1.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -1.0]
/*:
  ros__parameters:
    io: {input_matching: latest, deadline: 0.2, accepted_frames: [imu_link]}
/**/ekf:
  ros__parameters: {gate: 0.2}
ekf:
  ros__parameters: {use_gyro: true, gate: 0.05}
sat2:
  ekf:
    ros__parameters: {use_gyro: false}
"""
T0 = 1_800_000_000_000_000_000
NORMALS = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)
RATE = np.radians([1.0, -2.0, 1.5])  # in the body, constant


def sun_b(t):
    """Direction to a Sun that stands still, in a body that turns by `RATE`, at times (M,): (M, 3)."""
    s0 = np.array([0.48, 0.6, 0.64])
    speed = np.linalg.norm(RATE)
    axis = RATE / speed
    angle = -speed * np.asarray(t)[:, None]
    along = axis * (s0 @ axis)
    return along + np.cos(angle) * (s0 - along) + np.sin(angle) * np.cross(axis, s0)


def jittered(rng, period, jitter, duration, missing=0.0):
    """Times of a device whose period is not kept and of whose messages some are missing."""
    times = np.cumsum(period * (1.0 + jitter * rng.uniform(-1.0, 1.0, int(duration / period))))
    return times[rng.uniform(size=len(times)) >= missing]


class Flight:
    """An estimator beside devices; messages come in the order of their arrival."""

    def __init__(self, bench, tmp_path):
        file = tmp_path / "robot.yaml"
        file.write_text(FILE, encoding="utf-8")
        kind = find_component("css_estimation", "ekf")
        mission = mission_of_arguments(kind, ["--ros-args", "--params-file", str(file)])
        assert mission.node("ekf").values.gate == 0.05
        self.bench = bench
        self.estimates = bench.listen("ekf/sun_estimate", SunEstimate)
        self.node = bench.host(kind, mission, "ekf")

    def fly(self, cells, gyro, dark=(), late=0.0, late_cells=()):
        """Sends cells and gyro at times [s].

        `dark` is when no cell sees anything, `late` how late the gyro comes, `late_cells` which cells come 0.25 s late.
        """
        voltages = np.maximum(0.0, sun_b(cells) @ NORMALS.T)
        for begin, end in [dark] if dark else []:
            voltages[(cells > begin) & (cells < end)] = 0.0
        events = [
            (t, "css/voltages", CssVoltages, {"voltages": v}, "bus") for t, v in zip(cells, voltages, strict=True)
        ]
        covariance = 1e-8 * np.eye(3).ravel()
        rates = {"angular_velocity": RATE, "angular_velocity_covariance": covariance}
        events += [(t + late, "gyro/imu", Imu, rates, "imu_link") for t in gyro]
        arrival = [t + 0.25 * (k in late_cells) for k, (t, *_) in enumerate(events)]
        for _, (t, topic, kind, fields, frame) in sorted(zip(arrival, events, strict=True), key=lambda pair: pair[0]):
            stamp = T0 + round((t - (late if kind is Imu else 0.0)) * 1e9)
            self.bench.publish(topic, kind, codec_of(kind).sample(stamp, frame, **fields))
            self.bench.executor.spin_once(timeout_sec=0.0)
        self.bench.until(lambda: self.node.health().stamp_ns >= T0 + round(cells[-1] * 1e9), "the last cycle")
        self.bench.until(lambda: self.estimates and self.estimates[-1].stamp_ns >= T0 + round(cells[-1] * 1e9), "heard")
        return self.estimates

    def errors(self, after=0.0):
        """Heading errors [deg] of the estimates from a time on."""
        given = [e for e in self.estimates if e.stamp_ns > T0 + after * 1e9]
        times = (np.array([e.stamp_ns for e in given]) - T0) * 1e-9
        cosine = np.einsum("ij,ij->i", np.array([e.sun_b for e in given]), sun_b(times))
        return np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))


@pytest.fixture(params=["events", "draining"])
def flight(request, tmp_path):
    with Bench(request.param) as bench:
        yield Flight(bench, tmp_path)


@pytest.fixture
def rng():
    return np.random.default_rng(1)


def test_jitter_missing_and_late_messages_cost_little(flight, rng):
    cells = jittered(rng, 0.1, 0.3, 60.0, missing=0.1)
    gyro = jittered(rng, 0.02, 0.3, 60.0, missing=0.2)
    estimates = flight.fly(cells, gyro, late=0.05)
    assert [e.stamp_ns for e in estimates] == [T0 + round(t * 1e9) for t in cells]
    assert {e.rate_source for e in estimates[5:]} == {SunEstimate.RATE_GYRO}
    assert np.max(flight.errors(after=10.0)) < 0.2
    counters = flight.node.health().counters
    assert counters["unmatched"] == 0
    assert not any("rejected" in key for key in counters)


def test_cells_that_come_behind_later_ones_are_left_out_and_counted(flight, rng):
    cells = jittered(rng, 0.1, 0.3, 30.0)
    late = set(range(20, 280, 9))
    estimates = flight.fly(cells, jittered(rng, 0.02, 0.3, 30.0), late_cells=late)
    assert [e.stamp_ns for e in estimates] == [T0 + round(t * 1e9) for k, t in enumerate(cells) if k not in late]
    assert flight.node.health().counters["cells.rejected.stamp_back"] == len(late)
    assert np.max(flight.errors(after=10.0)) < 0.2


def test_in_the_dark_the_direction_turns_by_the_time_between_stamps(flight, rng):
    """A constant period in the place of measured intervals would be off by the 27 % that are missing: 19 of 70 deg."""
    cells = jittered(rng, 0.1, 0.5, 60.0, missing=0.3)
    gyro = jittered(rng, 0.02, 0.5, 60.0)
    flight.fly(cells, gyro, dark=(25.0, 51.0))
    held = [e for e in flight.estimates if e.validity == SunEstimate.VALIDITY_HELD]
    assert len(held) > 100
    turned = np.degrees(np.linalg.norm(RATE)) * 26.0
    assert turned > 65.0
    assert np.max(flight.errors(after=10.0)) < 0.5


def test_gyro_that_dies_is_done_without_and_taken_back(flight, rng):
    cells = jittered(rng, 0.1, 0.2, 60.0)
    gyro = jittered(rng, 0.02, 0.2, 60.0)
    estimates = flight.fly(cells, gyro[(gyro < 20.0) | (gyro > 40.0)])
    of = lambda begin, end: {  # noqa: E731
        e.rate_source for e in estimates if T0 + begin * 1e9 < e.stamp_ns < T0 + end * 1e9
    }
    assert of(5.0, 20.0) == of(40.2, 60.0) == {SunEstimate.RATE_GYRO}
    # not older than io.deadline, 0.2 s
    assert SunEstimate.RATE_GYRO not in of(20.3, 39.9)
    assert np.max(flight.errors(after=10.0)) < 1.0


def test_sample_of_the_tutorial_is_read_by_every_node_of_it():
    file = Path(__file__).parents[1] / "docs" / "samples" / "hardware.yaml"
    nodes = [
        ("css_drivers", "css_adc"),
        ("css_drivers", "imu_relay"),
        ("css_drivers", "magnetometer_relay"),
        ("css_estimation", "ekf"),
        ("sunpoint_control", "mrp_control"),
    ]
    for package, executable in nodes:
        kind = find_component(package, executable)
        mission = mission_of_arguments(kind, ["--ros-args", "--params-file", str(file)])
        values = mission.node_of(kind, executable).values
        assert values.io.input_matching == "latest"
    assert values.graph.estimator == "ekf"
