# SPDX-License-Identifier: Apache-2.0
"""A long flight, with the memory and the open handles of each process and its speed, as a table.

Memory is what a process has for itself (RssAnon). Its growth is the slope of a straight line through the samples but
the first fifth, in which caches fill. Handles must be no more in the end than they were after that. The last line is a
JSON object; the exit code is 1 when handles grow, memory grows by more than `--most`, or the flight fails.

    python benchmarks/soak.py --hours 24 --processes
"""

import argparse
import json
import os
import sys
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rclpy.context import Context
from rclpy.node import Node

from css_analysis.readable_table import ReadableTable
from css_bringup.composed import ComposedFlight
from css_bringup.flight_result import FlightResult
from css_bringup.fly_mission import own_domain
from css_bringup.options import console
from css_bringup.processes import Supervisor, fly_processes
from css_common.codec import stamp_of
from css_common.executor import create_executor, retire
from css_common.mission import Mission, load_mission
from css_common.qos import RECORDER_SUBSCRIPTION

_SETTLED = 0.2  # share of the flight after which caches are full


class Sample(NamedTuple):
    """One look at the processes."""

    simulated_s: float
    wall_s: float
    memory_mb: dict[str, float]
    handles: dict[str, int]


class Watch:
    """Looks at processes whenever so much more simulated time has passed."""

    def __init__(self, every_s: float) -> None:
        self.samples: list[Sample] = []
        self._every_s = every_s
        self._due_s = 0.0

    def look(self, simulated_s: float, processes: Mapping[str, int]) -> None:
        """Takes a sample if it is time.

        Args:
            simulated_s: time flown.
            processes: numbers of processes by name.
        """
        if simulated_s < self._due_s:
            return
        self._due_s = simulated_s + self._every_s
        memory = {name: _memory_mb(pid) for name, pid in processes.items()}
        handles = {name: len(os.listdir(f"/proc/{pid}/fd")) for name, pid in processes.items()}
        self.samples.append(Sample(simulated_s, time.monotonic(), memory, handles))


def _memory_mb(pid: int) -> float:
    status = Path(f"/proc/{pid}/status").read_text(encoding="utf-8")
    (line,) = (line for line in status.splitlines() if line.startswith("RssAnon:"))
    return int(line.split()[1]) / 1024.0


def _composed(mission: Mission, bag: Path | None, watch: Watch) -> FlightResult:
    with ComposedFlight(mission, bag) as flight:
        return flight.fly(lambda seconds: watch.look(seconds, {"flight": os.getpid()}))


class _Observer:
    """Hears how far a flight of processes has come, and looks at them."""

    def __init__(self, mission: Mission, watch: Watch) -> None:
        self._mission, self._watch = mission, watch
        self._now_ns = mission.epoch_ns
        self._context = Context()
        self._context.init()
        self._executor = create_executor(None, self._context)
        self._node = Node("soak", context=self._context, use_global_arguments=False)
        kind = mission.topics["truth"]
        self._node.create_subscription(kind, "truth", self._hear, RECORDER_SUBSCRIPTION, raw=True)
        self._executor.add_node(self._node)

    def _hear(self, data: Any) -> None:
        self._now_ns = max(self._now_ns, stamp_of(data))

    def __call__(self, supervisor: Supervisor) -> None:
        """Called between looks of the supervisor at its processes."""
        for _ in range(1000):
            before = self._now_ns
            self._executor.spin_once(timeout_sec=0.0)
            if self._now_ns == before:
                break
        children = [*supervisor.children.values(), *filter(None, [supervisor.recorder])]
        running = {c.name: c.process.pid for c in children if c.process is not None and c.poll() is None}
        if len(running) == len(children) and self._now_ns > self._mission.epoch_ns:
            self._watch.look((self._now_ns - self._mission.epoch_ns) / 1e9, running)

    def end(self) -> None:
        """Leaves."""
        retire(self._executor, self._node)
        self._executor.shutdown()
        self._context.try_shutdown()


def _processes(mission: Mission, bag: Path | None, watch: Watch, logs: Path) -> FlightResult:
    observer = _Observer(mission, watch)
    try:
        return fly_processes(mission, bag, logs, observer)
    finally:
        observer.end()


def growth(samples: list[Sample], name: str) -> float:
    """Slope of a process's memory [MB per 1000 s of simulated time] once caches are full."""
    settled = [s for s in samples if s.simulated_s >= _SETTLED * samples[-1].simulated_s]
    if len(settled) < 3:
        return 0.0
    slope = np.polyfit([s.simulated_s for s in settled], [s.memory_mb[name] for s in settled], 1)[0]
    return float(slope) * 1000.0


def more_handles(samples: list[Sample], name: str) -> int:
    """How many more handles a process has in the end than it had when caches were full."""
    settled = [s for s in samples if s.simulated_s >= _SETTLED * samples[-1].simulated_s]
    return settled[-1].handles[name] - settled[0].handles[name]


def table_of(samples: list[Sample]) -> ReadableTable:
    """The samples, a line each."""
    names = list(samples[0].memory_mb)
    table = ReadableTable()
    table.add_number("simulated\ns")
    table.add_number("real-time\nfactor")
    for name in names:
        table.add_number(f"{name}\nMB")
    for name in names:
        table.add_number(f"{name}\nhandles")
    for before, now in zip([None, *samples], samples, strict=False):
        factor = (
            "" if before is None else f"{(now.simulated_s - before.simulated_s) / (now.wall_s - before.wall_s):.0f}"
        )
        memory = [f"{now.memory_mb[name]:.1f}" for name in names]
        table.add_texts([f"{now.simulated_s:.0f}", factor, *memory, *(str(now.handles[name]) for name in names)])
    return table


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--mission", default="okeefe_2013")
    parser.add_argument("--hours", type=float, default=24.0, help="simulated time (default: %(default)s)")
    parser.add_argument("--processes", action="store_true", help="one process for each node")
    parser.add_argument("--no-record", action="store_true")
    parser.add_argument("--samples", type=int, default=24, help="lines of the table (default: %(default)s)")
    parser.add_argument("--most", type=float, default=1.0, help="growth of memory that is borne [MB per 1000 s]")
    parser.add_argument("--faulted", action="store_true", help="with some faults of sensors and messages")
    arguments = parser.parse_args()
    mission = soaked(arguments.mission, arguments.hours, faulted=arguments.faulted)
    watch = Watch(mission.values.mission.duration / arguments.samples)
    with tempfile.TemporaryDirectory(prefix="sunpoint_soak_") as folder:
        bag = None if arguments.no_record else Path(folder) / "bag"
        with own_domain(mission.name, None, bag, console):
            if arguments.processes:
                result = _processes(mission, bag, watch, Path(folder))
            else:
                result = _composed(mission, bag, watch)
    console.print(table_of(watch.samples))
    names = list(watch.samples[0].memory_mb)
    grown = {name: round(growth(watch.samples, name), 3) for name in names}
    handles = {name: more_handles(watch.samples, name) for name in names}
    print(
        json.dumps(
            {
                "simulated_s": result.simulated_s,
                "realtime_factor": round(result.realtime_factor, 1),
                "memory_mb_per_1000_s": grown,
                "more_handles": handles,
                "messages_lost": result.messages_lost,
                "failure": result.failure,
            }
        )
    )
    return int(bool(result.failure) or max(grown.values()) > arguments.most or max(handles.values()) > 0)


def soaked(name: str, hours: float, *, faulted: bool) -> Mission:
    """A mission for so long, without criteria; with faults that come and go if asked for."""
    mission = load_mission(name, [f"mission.duration={3600.0 * hours!r}"])
    if not faulted:
        return mission
    lines = "cell.2 noisy 0.05 from 100,cell.any intermittent 0.2 30 from 200,cell.5 drifting 0.00001"
    return mission.with_overrides(
        [f"css_array.faults={lines}", "css_array.io.faults=message.css/voltages dropped 0.01 from 50"]
    )


if __name__ == "__main__":
    sys.exit(main())
