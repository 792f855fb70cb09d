# SPDX-License-Identifier: Apache-2.0
"""The tutorial's graph on the wall clock: a line of cells, somebody's IMU, wheels, estimator and control, one file."""

import os
import pty
import threading
import time
import tty
from pathlib import Path

import numpy as np
import pytest
from sensor_msgs.msg import Imu

from css_common.codec import codec_of
from css_common.link import GAP
from css_common.mission import find_component
from css_common.node_arguments import mission_of_arguments
from css_common.testing import Bench
from css_drivers.text_line import LineFormat, usual_fields, write_line
from css_msgs.msg import SunEstimate, WheelState, WheelTorqueCommand

SAMPLE = Path(__file__).parents[1] / "docs" / "samples" / "hardware.yaml"
FORM = LineFormat("$CSS", ",", "xor", usual_fields(6), 6)
SUN = np.array([0.6, 0.0, 0.8])
VOLTS = 1.5 * np.array([0.6, 0.0, 0.0, 0.0, 0.8, 0.0])
NODES = [
    ("css_drivers", "css_adc"),
    ("css_drivers", "imu_relay"),
    ("css_estimation", "ekf"),
    ("sunpoint_control", "mrp_control"),
]


class Devices(threading.Thread):
    """A microcontroller that prints cells, an IMU and wheels, each with a period of its own that it does not keep."""

    def __init__(self, bench):
        super().__init__(daemon=True)
        self.end, self.other = pty.openpty()
        tty.setraw(self.other)
        self.over, self.mute = threading.Event(), False
        self.imu = bench.node.create_publisher(Imu, "imu/data", 10)
        self.wheels = bench.node.create_publisher(WheelState, "wheels/state", 10)

    def run(self):
        random, sequence, due = np.random.default_rng(1), 0, [0.0, 0.0, 0.0]
        while not self.over.wait(0.002):
            now = time.monotonic()
            if now >= due[0] and not self.mute:
                due[0] = now + 0.05 * random.uniform(0.7, 1.3)
                sequence += 1
                os.write(self.end, write_line(FORM, sequence, VOLTS.tolist()))
            if now >= due[1]:
                due[1] = now + 0.02 * random.uniform(0.5, 1.5)
                rate = {"angular_velocity": np.array([0.0, -0.018, 0.024])}
                self.imu.publish(codec_of(Imu).encode(codec_of(Imu).sample(time.time_ns(), "imu_link", **rate)))
            if now >= due[2]:
                due[2] = now + 0.05
                rest = {"speed": np.zeros(3), "torque": np.zeros(3)}
                codec = codec_of(WheelState)
                self.wheels.publish(codec.encode(codec.sample(time.time_ns(), "bus", **rest)))

    def end_it(self):
        self.over.set()
        self.join()
        os.close(self.end)
        os.close(self.other)


@pytest.fixture
def graph(tmp_path):
    """The nodes, what they publish, and the devices."""
    with Bench("events") as bench:
        devices = Devices(bench)
        own = tmp_path / "own.yaml"
        port = os.ttyname(devices.other)
        own.write_text(
            "css_adc:\n  ros__parameters:\n    converter: line\n    dark_level: [0.0]\n    full_scale: [1.5]\n"
            f"    line: {{port: {port}, patience: 0.3}}\n",
            encoding="utf-8",
        )
        arguments = ["--ros-args", "--params-file", str(SAMPLE), "--params-file", str(own)]
        estimates = bench.listen("ekf/sun_estimate", SunEstimate)
        commands = bench.listen("wheels/torque_command", WheelTorqueCommand)
        nodes = {}
        for package, executable in NODES:
            kind = find_component(package, executable)
            nodes[executable] = bench.host(kind, mission_of_arguments(kind, arguments), executable)
        devices.start()
        try:
            yield bench, devices, nodes, estimates, commands
        finally:
            devices.end_it()


def test_cells_and_gyro_become_an_estimate_and_torques(graph):
    bench, devices, nodes, estimates, commands = graph

    # about the Sun line, so that cells see no change; the body's x is -y of the sensor, its y is x
    turning = 0.03 * SUN
    bench.until(lambda: estimates and np.allclose(estimates[-1].omega_bn_b, turning, atol=1e-3), "the gyro's rate")
    last = estimates[-1]
    assert last.rate_source == SunEstimate.RATE_GYRO
    assert last.validity == SunEstimate.VALIDITY_VALID
    np.testing.assert_allclose(last.sun_b, SUN, atol=0.02)
    bench.until(lambda: any(c.frame_id == "bus" and np.any(c.torque) for c in commands), "torques")
    assert abs(time.time_ns() - last.stamp_ns) < 3600 * 1e9

    devices.mute = True
    begin = len(estimates)
    bench.until(lambda: any(e.frame_id == GAP for e in estimates[begin:]), "gaps while the line is silent")
    at = len(commands)
    bench.until(lambda: any(c.frame_id == "bus" and not np.any(c.torque) for c in commands[at:]), "wheels at rest")
    devices.mute = False
    begin = len(estimates)
    bench.until(lambda: any(e.frame_id == "bus" for e in estimates[begin:]), "estimates again")
    assert nodes["css_adc"].health().counters["recoveries"] >= 1
    for node in nodes.values():
        assert node.counters["cycle_failed"] == 0
