# SPDX-License-Identifier: Apache-2.0
"""A mission flown with one process per node, supervised.

A node that dies is restarted and named; a second death of the same node within a limit ends the run with its log.
The plant is not restarted: the state of the spacecraft died with it.
"""

import json
import os
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

from ament_index_python.packages import PackageNotFoundError, get_package_prefix

from css_bringup.flight import FlightResult, Stopped, as_flown
from css_common.mission import Mission
from css_common.mission_file import MissionError

RECORDER = "recorder"
_POLL = 0.02
_END_LIMIT = 30.0  # wall time [s] allowed to a process that was asked to end; a loaded machine needs seconds
_RESTART_LIMIT = 60.0  # wall time [s] within which a second death of a node ends the run


@dataclass
class Child:
    """One supervised process."""

    name: str
    command: list[str]
    log: Path
    process: subprocess.Popen | None = None
    stream: IO[bytes] | None = None
    deaths: list[float] = field(default_factory=list)
    asked_to_end: bool = False

    def start(self) -> None:
        """Starts the process; its log begins anew with the flight and goes on after a restart."""
        self.asked_to_end = False
        self.stream = self.log.open("wb" if self.process is None else "ab")
        # its own session: Ctrl-C goes to the supervisor, which stops the nodes in order
        self.process = subprocess.Popen(
            self.command, stdout=self.stream, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL, start_new_session=True
        )

    def poll(self) -> int | None:
        """Exit code, or None while it runs."""
        return self.process.poll() if self.process else None

    def interrupt(self) -> None:
        """Asks the process to end, if it runs; once, because an interpreter that is ending dies of a second SIGINT."""
        if self.process is not None and self.process.poll() is None and not self.asked_to_end:
            self.asked_to_end = True
            self.process.send_signal(signal.SIGINT)

    def stop(self, limit: float) -> None:
        """Asks the process to end, and insists after `limit` seconds."""
        if self.process is None:
            return
        self.interrupt()
        try:
            self.process.wait(limit)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        if self.stream is not None:
            self.stream.close()
            self.stream = None

    def log_tail(self, lines: int = 20) -> str:
        """The end of its log."""
        text = self.log.read_text(encoding="utf-8", errors="replace").splitlines()
        return "\n".join(text[-lines:])


def executable_path(package: str, executable: str) -> str:
    """Installed executable of a node, found as `ros2 run` finds it.

    Raises:
        MissionError: the package or the executable is not installed.
    """
    try:
        path = Path(get_package_prefix(package)) / "lib" / package / executable
    except PackageNotFoundError as error:
        raise MissionError(f"package {package} is not installed; build the workspace first") from error
    if not os.access(path, os.X_OK):
        raise MissionError(f"{package} has no executable {executable}; build the workspace again")
    return str(path)


class Supervisor:
    """Starts, watches and stops the processes of a flight."""

    def __init__(self, mission: Mission, bag: Path | None, logs: Path, *, overwrite: bool = False) -> None:
        """Prepares a flight; `start` begins it.

        Args:
            mission: what to fly.
            bag: where to record; None records nothing.
            logs: folder for the nodes' logs.
            overwrite: replace a recording that is there.

        Raises:
            MissionError: an executable is missing, or no node owns simulated time.
        """
        if mission.plant is None:
            raise MissionError(f"{mission.origin}: no node of graph.nodes owns simulated time, nothing can fly")
        self.mission = mission
        self.bag = bag
        self._plant_name = mission.plant.name
        self.logs = logs
        self._overwrite = overwrite
        self.notes: list[str] = []
        self.failure = ""
        self._folder = tempfile.TemporaryDirectory(prefix="sunpoint_")
        logs.mkdir(parents=True, exist_ok=True)
        flown = as_flown(mission, recorded=bag is not None)
        self._parameters = Path(self._folder.name) / f"{mission.name}.flown.yaml"
        self._parameters.write_text(flown.text(), encoding="utf-8")
        self._mission_file = Path(self._folder.name) / f"{mission.name}.yaml"
        self._mission_file.write_text(mission.text(), encoding="utf-8")
        self.children = {node.name: self._child(node.name, node.package, node.executable) for node in flown.nodes}
        self.recorder = self._recorder() if bag is not None else None

    def _child(self, name: str, package: str, executable: str) -> Child:
        command = [executable_path(package, executable), "--summary", str(self._summary(name)), "--ros-args"]
        command += ["--params-file", str(self._parameters), "-r", f"__node:={name}"]
        return Child(name, command, self.logs / f"{name}.log")

    def _summary(self, name: str) -> Path:
        return Path(self._folder.name) / f"{name}.summary.json"

    def _recorder(self) -> Child:
        command = [executable_path("css_recording", RECORDER), "--mission", str(self._mission_file), "--in-flight"]
        command += ["--output", str(self.bag), "--summary", str(self._summary(RECORDER))]
        command += ["--overwrite"] if self._overwrite else []
        return Child(RECORDER, command, self.logs / f"{RECORDER}.log")

    @property
    def plant(self) -> Child:
        """The process that owns simulated time."""
        return self.children[self._plant_name]

    def start(self) -> None:
        """Starts all processes, the plant last."""
        first = [self.recorder] if self.recorder else []
        for child in (*first, *(c for c in self.children.values() if c is not self.plant), self.plant):
            child.start()

    def check(self) -> bool:
        """Looks after the processes once; False when the flight is over, well or not."""
        code = self.plant.poll()
        if code is not None:
            if code != 0:
                self._fail(self.plant, code, "the spacecraft's state is lost with it")
            return False
        for child in (*self.children.values(), *filter(None, [self.recorder])):
            code = child.poll()
            if code is None:
                continue
            now = time.monotonic()
            child.deaths.append(now)
            if child is self.recorder:
                self._fail(child, code, "the flight is not recorded any more")
                return False
            if len(child.deaths) > 1 and now - child.deaths[-2] < _RESTART_LIMIT:
                self._fail(child, code, f"for the second time within {_RESTART_LIMIT:g} s")
                return False
            self.notes.append(f"{child.name} died ({_cause(code)}) and was restarted")
            child.stop(0.0)
            child.start()
        return True

    def stop(self) -> None:
        """Ends all processes: the plant first, whose last stamp the others answer, and the recorder last."""
        self.plant.stop(_END_LIMIT)
        for child in self.children.values():
            child.interrupt()
        for child in self.children.values():
            child.stop(_END_LIMIT)
        if self.recorder is not None:
            self.recorder.stop(_END_LIMIT)

    def summary(self, name: str) -> dict[str, Any]:
        """Figures that a process left at its end; empty when it was killed."""
        file = self._summary(name)
        return json.loads(file.read_text(encoding="utf-8")) if file.is_file() else {}

    def clean(self) -> None:
        """Removes temporary files."""
        self._folder.cleanup()

    def _fail(self, child: Child, code: int, consequence: str) -> None:
        self.failure = (
            f"{child.name} died ({_cause(code)}), {consequence}; its log {child.log} ends:\n{child.log_tail()}"
        )


def _cause(code: int) -> str:
    if code < 0:
        try:
            return signal.Signals(-code).name
        except ValueError:
            return f"signal {-code}"
    return f"exit code {code}"


def fly_processes(
    mission: Mission,
    bag: Path | None,
    logs: Path,
    on_poll: Callable[[Supervisor], None] | None = None,
    stopped: Stopped = lambda: False,
    *,
    overwrite: bool = False,
) -> FlightResult:
    """Flies a mission with one process per node.

    Args:
        mission: what to fly.
        bag: where to record; None records nothing.
        logs: folder for the nodes' logs.
        on_poll: called between looks at the processes.
        stopped: the flight is asked to end.
        overwrite: replace a recording that is there.
    """
    result = FlightResult(mission, bag=bag)
    supervisor = Supervisor(mission, bag, logs, overwrite=overwrite)
    try:
        supervisor.start()
        while supervisor.check():
            if stopped():
                result.interrupted = True
                break
            if on_poll is not None:
                on_poll(supervisor)
            time.sleep(_POLL)
    except KeyboardInterrupt:
        result.interrupted = True
    finally:
        supervisor.stop()
    result.failure, result.notes = supervisor.failure, supervisor.notes
    recorded = supervisor.summary(RECORDER).get("recorded", {})
    result.recorded = {f"/{topic}": recorded.get(f"/{topic}", 0) for topic in mission.topics}
    flown = supervisor.summary(supervisor.plant.name)
    if flown:
        result.wall_s = flown["wall_s"]
        result.steps = flown["counters"].get("cycles", 0)
    else:
        result.steps = _recorded_steps(mission, result.recorded)
    result.simulated_s = result.steps * mission.period_ns * 1e-9
    result.cpu_s = sum(supervisor.summary(name).get("cpu_s", 0.0) for name in (*supervisor.children, RECORDER))
    supervisor.clean()
    return result


def _recorded_steps(mission: Mission, recorded: Mapping[str, int]) -> int:
    """Control cycles of a plant that could not tell: those of which the recording has a message of its own."""
    assert mission.plant is not None
    return max(0, *((recorded[f"/{o.topic}"] - 1) * o.divider + 1 for o in mission.plant.outputs))
