# SPDX-License-Identifier: Apache-2.0
"""A mission flown with one process per node, supervised.

A node that dies or freezes is restarted and named; a second time of the same node within a limit ends the run with its
log. The plant is not restarted: the state of the spacecraft died with it.
"""

import contextlib
import json
import os
import signal
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from ament_index_python.packages import PackageNotFoundError, get_package_prefix

from css_bringup.child import Child
from css_bringup.flight_result import FlightResult, Stopped, as_flown
from css_bringup.incidents import node_incidents
from css_bringup.warden import Warden
from css_common.mission import Mission
from css_common.mission_file import MissionError
from css_recording.bag_folder import prepare_folder

RECORDER = "recorder"
_POLL = 0.02
_LOOK = 0.25  # wall time [s] between looks at whether the processes work
_END_LIMIT = 30.0  # wall time [s] allowed to a process that was asked to end; a loaded machine needs seconds
_RESTART_LIMIT = 60.0  # wall time [s] within which a second death of a node ends the run
# Wall times [s], and shares of the time for which the plant holds for a partner: after them a process counts as frozen.
_STOPPED_LIMIT, _STOPPED_SHARE = 2.0, 0.25
_SILENT_LIMIT, _SILENT_SHARE = 5.0, 0.5


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
        self._folder = logs / f"run_{os.getpid()}"  # gone when the flight is
        self._parameters = self._folder / f"{mission.name}.flown.yaml"
        self._mission_file = self._folder / f"{mission.name}.yaml"
        self._notes_file = self._folder / "notes.json"
        self.children = {node.name: self._child(node.name, node.package, node.executable) for node in mission.nodes}
        self.recorder = self._recorder() if bag is not None else None
        hold_limit = mission.values.lockstep.hold_limit
        self._limits = (
            min(_STOPPED_LIMIT, _STOPPED_SHARE * hold_limit),
            max(_SILENT_LIMIT, _SILENT_SHARE * hold_limit),
        )
        self._looked = time.monotonic()
        self._warden: Warden | None = None

    def _child(self, name: str, package: str, executable: str) -> Child:
        command = [executable_path(package, executable), "--summary", str(self._summary(name)), "--ros-args"]
        command += ["--params-file", str(self._parameters), "-r", f"__node:={name}"]
        return Child(name, command, self.logs / f"{name}.log")

    def _summary(self, name: str) -> Path:
        return self._folder / f"{name}.summary.json"

    def _recorder(self) -> Child:
        command = [executable_path("css_recording", RECORDER), "--mission", str(self._mission_file), "--in-flight"]
        command += ["--output", str(self.bag), "--summary", str(self._summary(RECORDER))]
        command += ["--notes", str(self._notes_file)]
        command += ["--overwrite"] if self._overwrite else []
        return Child(RECORDER, command, self.logs / f"{RECORDER}.log")

    @property
    def plant(self) -> Child:
        """The process that owns simulated time."""
        return self.children[self._plant_name]

    def start(self) -> None:
        """Starts all processes, the plant last.

        Raises:
            BagError: there is something in the place of the recording, or it cannot be made.
            MissionError: the logs cannot be written.
        """
        if self.bag is not None:
            prepare_folder(self.bag, self._overwrite)
        flown = as_flown(self.mission, recorded=self.bag is not None)
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            self._parameters.write_text(flown.text(), encoding="utf-8")
            self._mission_file.write_text(self.mission.text(), encoding="utf-8")
        except OSError as error:
            raise MissionError(f"{self._folder}: logs cannot be written there: {error.strerror}") from error
        self._warden = Warden(self._folder)
        for child in sorted(self._all(), key=lambda child: child is self.plant):
            self._start(child)

    def _all(self) -> Iterator[Child]:
        if self.recorder is not None:
            yield self.recorder
        yield from self.children.values()

    def _start(self, child: Child) -> None:
        pid = child.start()
        if self._warden is not None:
            self._warden.look_after(pid)

    def check(self) -> bool:
        """Looks after the processes once; False when the flight is over, well or not."""
        codes = {child.name: child.poll() for child in self._all()}
        if codes[self._plant_name] == 0:
            return False
        frozen = self._frozen()
        for child in self._all():
            code = codes[child.name]
            if code is not None:
                what = f"died ({_cause(code)})"
            elif child.name in frozen:
                what = f"froze ({frozen[child.name]})"
            else:
                continue
            if not self._replace(child, what):
                return False
        return True

    def _frozen(self) -> dict[str, str]:
        """Names of the processes that do not work, with the reason."""
        now = time.monotonic()
        if now - self._looked < _LOOK:
            return {}
        # a supervisor that was stopped itself has not been looking for so long
        elapsed, self._looked = min(now - self._looked, 2.0 * _LOOK), now
        frozen = {}
        for child in self._all():
            if child.pulse is not None:
                child.pulse.look(elapsed)
                frozen[child.name] = child.pulse.frozen(*self._limits)
        return {name: reason for name, reason in frozen.items() if reason}

    def _replace(self, child: Child, what: str) -> bool:
        """Starts a process anew that died or froze; False when that cannot help."""
        now = time.monotonic()
        meant = child.announced()
        if meant:
            what = f"{what}, as its fault {meant[-1]!r} says,"
        else:
            child.deaths.append(now)
        if child is self.plant:
            return self._fail(child, what, "the spacecraft's state is lost with it")
        if child is self.recorder:
            return self._fail(child, what, "the flight is not recorded any more")
        if len(child.deaths) > 1 and now - child.deaths[-2] < _RESTART_LIMIT:
            return self._fail(child, what, f"for the second time within {_RESTART_LIMIT:g} s")
        self.notes.append(f"{child.name} {what} and was restarted")
        child.kill()
        child.stop(0.0)
        self._start(child)
        return True

    def stop(self) -> None:
        """Ends all processes: the plant first, whose last stamp the others answer, and the recorder last."""
        for child in self._all():
            child.wake()
        self.plant.stop(_END_LIMIT)
        for child in self.children.values():
            child.interrupt()
        for child in self.children.values():
            child.stop(_END_LIMIT)
        counters = {name: self.summary(name).get("counters", {}) for name in self.children}
        self.notes += node_incidents(self.mission, counters)
        if self.recorder is not None:
            with contextlib.suppress(OSError):  # a full disk; the notes are still shown
                self._notes_file.write_text(json.dumps(self.notes), encoding="utf-8")
            self.recorder.stop(_END_LIMIT)
            self.notes += [f"recorder: {fault}" for fault in self.summary(RECORDER).get("faults", [])]

    def summary(self, name: str) -> dict[str, Any]:
        """Figures that a process left at its end; empty when it was killed."""
        file = self._summary(name)
        return json.loads(file.read_text(encoding="utf-8")) if file.is_file() else {}

    def clean(self) -> None:
        """Removes temporary files."""
        if self._warden is not None:
            self._warden.dismiss()

    def _fail(self, child: Child, what: str, consequence: str) -> bool:
        self.failure = f"{child.name} {what}, {consequence}; its log {child.log} ends:\n{child.log_tail()}"
        return False


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
    result.note_losses()
    result.cpu_s = sum(supervisor.summary(name).get("cpu_s", 0.0) for name in (*supervisor.children, RECORDER))
    supervisor.clean()
    return result


def _recorded_steps(mission: Mission, recorded: Mapping[str, int]) -> int:
    """Control cycles of a plant that could not tell: those of which the recording has a message of its own."""
    assert mission.plant is not None
    return max(0, *((recorded[f"/{o.topic}"] - 1) * o.divider + 1 for o in mission.plant.outputs))
