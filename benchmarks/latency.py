# SPDX-License-Identifier: Apache-2.0
"""Latency from cell to command: a microcontroller's line in, through driver, estimator and control, torques out.

Each node is a process of its own on the wall clock, started with one parameter file: `css_adc` reads lines on a
pseudo-terminal, `imu_relay` hears an IMU at 50 Hz, `ekf` and `mrp_control` pair messages by the latest. A line begins
its way when its last byte is written; periods are jittered by a fifth, so that no two clocks keep step. Percentiles go
to the terminal, to `--json` and, with `--figure`, into a picture.

    python benchmarks/latency.py --seconds 60 --figure docs/images/latency.png
"""

import argparse
import json
import os
import pty
import subprocess
import sys
import tempfile
import threading
import time
import tty
from functools import partial
from pathlib import Path

import numpy as np
import rclpy
from ament_index_python.packages import get_package_prefix
from rclpy.node import Node
from sensor_msgs.msg import Imu

from css_analysis.figure_style import colours, new_figure, save, style
from css_analysis.readable_table import ReadableTable
from css_bringup.options import console
from css_common import domains, network
from css_common.codec import codec_of, stamp_of
from css_common.executor import create_executor, spin_until
from css_common.mission import Mission, find_component
from css_common.node_arguments import mission_of_arguments
from css_common.qos import LOOP_PUBLISHER, RECORDER_SUBSCRIPTION
from css_drivers.text_line import LineFormat, usual_fields, write_line
from css_msgs.msg import CssVoltages, SunEstimate, WheelState, WheelTorqueCommand

SAMPLE = Path(__file__).parents[1] / "docs" / "samples" / "hardware.yaml"
NODES = (
    ("css_drivers", "css_adc"),
    ("css_drivers", "imu_relay"),
    ("css_estimation", "ekf"),
    ("sunpoint_control", "mrp_control"),
)
TOPICS = {
    "css/voltages": (CssVoltages, "line to voltages"),
    "ekf/sun_estimate": (SunEstimate, "line to Sun estimate"),
    "wheels/torque_command": (WheelTorqueCommand, "line to command"),
}
PERCENTILES = (50.0, 90.0, 99.0, 99.9)
_JITTER, _IMU_PERIOD, _WHEELS_PERIOD = 0.2, 0.02, 0.05
_START_UP = 120.0
_SETTLED = 2.0  # [s] at the begin that do not count: the first messages find caches cold


class Devices:
    """A microcontroller with cells on a line, an IMU and wheels, on clocks of their own."""

    def __init__(self, node: Node, cells: np.ndarray, wheels: int, rate: float) -> None:
        """Begins to say what they measure.

        Args:
            node: that publishes for IMU and wheels.
            cells: normals (N, 3).
            wheels: number of wheels.
            rate: lines a second.
        """
        self.end, self._other = pty.openpty()
        tty.setraw(self._other)
        self.port = os.ttyname(self._other)
        self.written: list[int] = []
        self._form = LineFormat("$CSS", ",", "xor", usual_fields(len(cells)), len(cells))
        self._volts = np.maximum(0.0, cells @ np.array([0.36, 0.48, 0.8]))
        self._stop = threading.Event()
        self._random = np.random.default_rng(1)
        imu = node.create_publisher(Imu, "imu/data", LOOP_PUBLISHER)
        state = node.create_publisher(WheelState, "wheels/state", LOOP_PUBLISHER)

        def say_rate() -> None:
            rates = codec_of(Imu).sample(time.time_ns(), "imu_link", angular_velocity=np.array([0.01, 0.0, -0.02]))
            imu.publish(codec_of(Imu).encode(rates))

        def say_speeds() -> None:
            zeros = np.zeros(wheels)
            speeds = codec_of(WheelState).sample(time.time_ns(), "bus", speed=zeros, torque=zeros)
            state.publish(codec_of(WheelState).encode(speeds))

        def say_cells() -> None:
            noisy = self._volts + 0.001 * self._random.standard_normal(len(self._volts))
            line = write_line(self._form, len(self.written), noisy)
            self.written.append(time.time_ns())
            os.write(self.end, line)

        works = ((say_rate, _IMU_PERIOD), (say_speeds, _WHEELS_PERIOD), (say_cells, 1.0 / rate))
        self._threads = [threading.Thread(target=self._repeat, args=work) for work in works]
        for thread in self._threads:
            thread.start()

    def _repeat(self, work, period: float) -> None:
        random = np.random.default_rng(round(period * 1e6))
        while not self._stop.wait(period * (1.0 + _JITTER * random.uniform(-1.0, 1.0))):
            work()

    def close(self) -> None:
        """Falls silent."""
        self._stop.set()
        for thread in self._threads:
            thread.join()
        for file in (self.end, self._other):
            os.close(file)


def start_nodes(port: str, rate: float, logs: Path) -> list[subprocess.Popen]:
    """The nodes as processes of their own."""
    own = logs / "line.yaml"
    own.write_text(
        f"css_adc:\n  ros__parameters: {{converter: line, line: {{port: {port}}}}}\n"
        f"/**:\n  ros__parameters: {{mission: {{period: {1.0 / rate!r}}}}}\n",
        encoding="utf-8",
    )
    processes = []
    for package, executable in NODES:
        program = Path(get_package_prefix(package)) / "lib" / package / executable
        files = [argument for file in (SAMPLE, own) for argument in ("--params-file", str(file))]
        with (logs / f"{executable}.log").open("w") as log:
            processes.append(subprocess.Popen([program, "--ros-args", *files], stdout=log, stderr=subprocess.STDOUT))
    return processes


def latencies(written: list[int], heard: list[tuple[int, int]]) -> np.ndarray:
    """Latencies [ms] of messages, by stamp and arrival [ns], each from the last line written before its stamp."""
    begins = np.array(written)
    stamps, arrivals = np.array(heard, np.int64).reshape(-1, 2).T
    which = np.searchsorted(begins, stamps, side="right") - 1
    known = which >= 0
    return (arrivals[known] - begins[which[known]]) * 1e-6


def _note(arrivals: list[tuple[int, int]], data: bytes) -> None:
    arrivals.append((stamp_of(data), time.time_ns()))


def measure(mission: Mission, rate: float, seconds: float) -> tuple[dict[str, np.ndarray], int]:
    """Latencies [ms] by way, and the number of lines written."""
    heard: dict[str, list[tuple[int, int]]] = {topic: [] for topic in TOPICS}
    rclpy.init()
    node = Node("latency")
    executor = create_executor()
    executor.add_node(node)
    for topic, (kind, _) in TOPICS.items():
        node.create_subscription(
            kind,
            topic,
            partial(_note, heard[topic]),
            RECORDER_SUBSCRIPTION,
            raw=True,
        )
    values = mission.values
    node_values = mission.node_of(find_component("css_drivers", "css_adc"), "css_adc").values
    devices = Devices(node, node_values.cells.normals, len(values.wheels.axes), rate)
    with tempfile.TemporaryDirectory() as logs:
        processes = start_nodes(devices.port, rate, Path(logs))
        try:
            limit = time.monotonic() + _START_UP
            spin_until(executor, lambda: len(heard["wheels/torque_command"]) > 10 or time.monotonic() > limit)
            if not heard["wheels/torque_command"]:
                said = "".join(file.read_text() for file in Path(logs).glob("*.log"))
                raise SystemExit(f"no command within {_START_UP:g} s; the nodes said:\n{said}")
            begin = time.time_ns() + round(_SETTLED * 1e9)
            end = begin + round(seconds * 1e9)
            spin_until(executor, lambda: time.time_ns() > end)
        finally:
            devices.close()
            for process in processes:
                process.terminate()
            for process in processes:
                process.wait()
    counted = sum(begin < line < end for line in devices.written)
    rclpy.try_shutdown()
    found = {}
    for topic, (_, way) in TOPICS.items():
        found[way] = latencies(devices.written, [one for one in heard[topic] if begin < one[0] < end])
    return found, counted


def draw(found: dict[str, np.ndarray], path: Path, rate: float) -> None:
    """Share of the messages above a latency, by way."""
    with style():
        figure = new_figure(7.0, 4.2)
        axes = figure.add_subplot()
        for (way, given), colour in zip(found.items(), colours(len(found)), strict=True):
            ordered = np.sort(given)
            above = 1.0 - np.arange(len(ordered)) / len(ordered)
            high = np.percentile(given, 99.0)
            axes.step(ordered, above, color=colour, label=f"{way}: median {np.median(given):.2f}, 99 % {high:.2f} ms")
        axes.set(xscale="log", yscale="log", xlabel="latency [ms]", ylabel="share of messages above [-]")
        axes.set_title(f"From a cell's line to the wheels' torque, {rate:g} lines a second")
        axes.xaxis.set_major_formatter("{x:g}")
        axes.legend(loc="lower left", frameon=False)
        save(figure, path)


def main() -> int:
    """Measures and prints; 1 when more than one line in a hundred had no command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60.0, help="how long to measure (default 60)")
    parser.add_argument("--rate", type=float, default=10.0, help="lines a second (default 10)")
    parser.add_argument("--figure", type=Path, help="draw the distributions into this file")
    parser.add_argument("--json", action="store_true", help="print the result as one JSON object on the last line")
    arguments = parser.parse_args()
    mission = load_sample()
    with domains.own(os.environ, "latency") as held:
        os.environ[network.DOMAIN] = str(held.domain)
        found, lines = measure(mission, arguments.rate, arguments.seconds)
    table = ReadableTable(f"latency [ms], {lines} lines at {arguments.rate:g} a second")
    table.add_name("way")
    for heading in ("messages", *(f"{p:g} %" for p in PERCENTILES), "largest"):
        table.add_number(heading)
    result = {}
    for way, given in found.items():
        figures = [*np.percentile(given, PERCENTILES), float(np.max(given))]
        table.add_texts([way, str(len(given)), *(f"{value:.2f}" for value in figures)])
        result[way] = {"messages": len(given), **{f"p{p:g}": v for p, v in zip(PERCENTILES, figures, strict=False)}}
        result[way]["largest"] = figures[-1]
    console.print(table)
    console.print(f"{os.cpu_count()} processors, load {os.getloadavg()[0]:.1f}")
    if arguments.figure is not None:
        draw(found, arguments.figure, arguments.rate)
    if arguments.json:
        print(json.dumps({"lines": lines, "latency_ms": result}))
    return int(len(found["line to command"]) < 0.99 * lines)


def load_sample() -> Mission:
    """The parameters of the tutorial, as the driver reads them."""
    return mission_of_arguments(find_component("css_drivers", "css_adc"), ["--ros-args", "--params-file", str(SAMPLE)])


if __name__ == "__main__":
    sys.exit(main())
