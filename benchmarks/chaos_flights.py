# SPDX-License-Identifier: Apache-2.0
"""The flights of `chaos.py`: one function a kind, each giving what came of its flights."""

import os
import random
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rclpy.node import Node

from css_bringup.composed import ComposedFlight
from css_bringup.flight_result import FlightResult
from css_bringup.fly_mission import own_domain
from css_bringup.options import console
from css_bringup.processes import Supervisor, fly_processes
from css_common.codec import codec_of
from css_common.executor import retire
from css_common.mission import Mission, load_mission
from css_common.mission_file import dump_sections
from css_common.qos import LOOP_PUBLISHER, RECORDER_SUBSCRIPTION
from css_common.testing import installed
from css_recording.bag_reader import BagReader
from css_recording.errors import BagError
from css_recording.recovery import recover

SECONDS = 60.0
FAULTS = {
    "cell": {"time": 8.0, "target": "cell.2", "kind": "stuck", "level": 0.4},
    "cells": {"time": 12.0, "end": 40.0, "target": "cell.4-5", "kind": "noisy", "sigma": 0.1},
    "rate": {"time": 5.0, "target": "gyro.y", "kind": "bias", "offset": 0.2},
    "wheel": {"time": 15.0, "target": "wheel.1", "kind": "friction", "coulomb": 1e-4, "viscous": 1e-6},
    "voltages": {"time": 10.0, "end": 50.0, "target": "message.css/voltages", "kind": "dropped", "share": 0.05},
    "commands": {
        "time": 10.0,
        "end": 50.0,
        "target": "message.wheels/torque_command",
        "kind": "dropped",
        "share": 0.05,
    },
}
"""Faults in whose middle processes are harmed; none that hangs on what a process remembers."""
_ANSWERS_ALIKE = ("css_array", "gyro")  # nodes without a memory: restarted, they say what they would have said
_PATIENCE = 120.0  # wall time [s] for a process flight to end

Messages = dict[str, list[tuple[int, bytes]]]


def messages_of(bag: Path) -> Messages:
    """Stamps and bytes of every topic of a recording."""
    with BagReader(bag) as reader:
        found: Messages = {}
        for message in reader.messages():
            found.setdefault(message.topic, []).append((message.stamp_ns, message.data))
        return found


@dataclass
class Outcome:
    """What came of a flight.

    Attributes:
        code: exit code that `fly` gives.
        said: it had something to say of what was not as it should be.
        wrong: it differs from the undisturbed flight where it must not, or does so without a word.
        lost: messages that its recording lacks.
        lost_silently: of these, without a word.
        tracebacks: in logs.
        left_behind: processes that still run.
        recovered: a recording that was completed afterwards.
    """

    code: int
    said: bool
    wrong: bool = False
    lost: int = 0
    lost_silently: int = 0
    tracebacks: int = 0
    left_behind: int = 0
    recovered: bool = False

    def counts(self) -> dict[str, int]:
        """For a Counter."""
        named = {key: int(value) for key, value in vars(self).items() if key != "code"}
        return {"flights": 1, f"exit_{self.code}": 1, **named}


class Reference:
    """The undisturbed flight."""

    def __init__(self, folder: Path, *, faulted: bool = False) -> None:
        """Flies it; `faulted`: with faults of sensors, a wheel and messages."""
        parameters = load_mission("okeefe_2013", [f"mission.duration={SECONDS}"]).parameters
        # a minute is too short for its criteria
        shared = {key: value for key, value in parameters["/**"].items() if not key.startswith("criteria.")}
        if faulted:
            shared |= {f"faults.{name}.{key}": value for name, entry in FAULTS.items() for key, value in entry.items()}
        self.file = folder / "okeefe_2013.yaml"
        self.file.write_text(dump_sections({**parameters, "/**": shared}), encoding="utf-8")
        self.mission: Mission = load_mission(self.file)
        bag = folder / "reference"
        with own_domain(self.mission.name, None, bag, console), ComposedFlight(self.mission, bag) as flight:
            result = flight.fly()
        assert not result.failure, result.failure
        assert faulted or not result.notes, result.notes
        self.notes = result.notes
        self.messages = messages_of(bag)

    def judge(self, result: FlightResult, logs: Path, *, alike: bool) -> Outcome:
        """What a flight in this process came to; `alike`: it must equal the undisturbed one to the last bit."""
        # what faults leave to be said is said of every flight with them
        said = bool(result.failure) or any(note not in self.notes for note in result.notes)
        outcome = Outcome(int(said), said, lost=result.messages_lost)
        outcome.tracebacks = sum("Traceback" in log.read_text(errors="replace") for log in logs.glob("*.log"))
        if result.bag is None or not any(result.bag.glob("*.mcap")):
            return outcome
        try:
            found = messages_of(result.bag)
        except BagError:
            recover(result.bag)
            outcome.recovered = True
            found = messages_of(result.bag)
        # a node that is started again tells its faults once more
        alike_on = {topic: told for topic, told in self.messages.items() if not topic.startswith("/faults/")}
        pairs = [(found.get(topic, []), expected) for topic, expected in alike_on.items()]
        same = all(recorded == expected for recorded, expected in pairs)
        begun = all(recorded == expected[: len(recorded)] for recorded, expected in pairs)
        outcome.wrong = (alike and not begun) or (not said and not same)
        missing = sum(len(expected) - len(recorded) for recorded, expected in pairs)
        outcome.lost_silently = max(0, missing) if not said else 0
        return outcome


def _processes(
    reference: Reference, place: Path, on_poll: Callable[[Supervisor], None], *, alike: bool = False
) -> Outcome:
    bag, logs = place / "bag", place / "logs"
    with own_domain(reference.mission.name, None, bag, console):
        result = fly_processes(reference.mission, bag, logs, on_poll)
    return reference.judge(result, logs, alike=alike)


class Harm:
    """Does something to one process of a flight when its recording has a certain size."""

    def __init__(self, bag: Path, name: str, number: signal.Signals, size: int) -> None:
        self._bag, self._name, self._number, self._size = bag, name, number, size
        self.done = False

    def __call__(self, supervisor: Supervisor) -> None:
        """Looks whether it is time, whenever the supervisor looks after its processes."""
        size = sum(file.stat().st_size for file in self._bag.glob("*.mcap"))
        if self.done or size < self._size:
            return
        child = supervisor.recorder if self._name == "recorder" else supervisor.children[self._name]
        if child is not None and child.process is not None and child.poll() is None:
            os.kill(child.process.pid, self._number)
            self.done = True


def _size(seed: int) -> int:
    return random.Random(seed).randrange(20_000, 180_000)


def _harm_nodes(reference: Reference, place: Path, seed: int, number: signal.Signals) -> Iterator[Outcome]:
    for name in (*_ANSWERS_ALIKE, "ekf", "mrp_control"):
        folder = place / name
        harm = Harm(folder / "bag", name, number, _size(seed))
        yield _processes(reference, folder, harm, alike=name in _ANSWERS_ALIKE)


def _harm_one(reference: Reference, place: Path, name: str, seed: int, number: signal.Signals) -> Iterator[Outcome]:
    yield _processes(reference, place, Harm(place / "bag", name, number, _size(seed)), alike=True)


def kill_nodes(reference: Reference, place: Path, seed: int) -> Iterator[Outcome]:
    """SIGKILL of each sensor, estimator and controller."""
    yield from _harm_nodes(reference, place, seed, signal.SIGKILL)


def freeze_nodes(reference: Reference, place: Path, seed: int) -> Iterator[Outcome]:
    """SIGSTOP of each of them, for ever."""
    yield from _harm_nodes(reference, place, seed, signal.SIGSTOP)


def kill_plant(reference: Reference, place: Path, seed: int) -> Iterator[Outcome]:
    """SIGKILL of the process that owns simulated time."""
    yield from _harm_one(reference, place, "dynamics", seed, signal.SIGKILL)


def freeze_plant(reference: Reference, place: Path, seed: int) -> Iterator[Outcome]:
    """SIGSTOP of it."""
    yield from _harm_one(reference, place, "dynamics", seed, signal.SIGSTOP)


def kill_recorder(reference: Reference, place: Path, seed: int) -> Iterator[Outcome]:
    """SIGKILL of the recorder; its recording is recovered."""
    yield from _harm_one(reference, place, "recorder", seed, signal.SIGKILL)


def freeze_recorder(reference: Reference, place: Path, seed: int) -> Iterator[Outcome]:
    """SIGSTOP of the recorder."""
    yield from _harm_one(reference, place, "recorder", seed, signal.SIGSTOP)


# Flights in a process of their own


def _start_fly(mission: Path, place: Path, *options: str) -> subprocess.Popen:
    command = [str(installed("css_bringup", "fly")), str(mission), "--out", str(place / "bag"), *options]
    with (place / "fly.log").open("wb") as log:
        return subprocess.Popen(command, stdout=log, stderr=log, stdin=subprocess.DEVNULL, start_new_session=True)


def _until(condition: Callable[[], bool], limit: float) -> bool:
    end = time.monotonic() + limit
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(0.02)
    return True


def _running(place: Path) -> list[int]:
    """Processes whose command line names a folder, this flight's alone."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                text = (entry / "cmdline").read_bytes()
            except OSError:
                continue
            if str(place).encode() in text:
                found.append(int(entry.name))
    return found


def _harm_supervisor(reference: Reference, place: Path, seed: int, number: signal.Signals) -> Outcome:
    fly = _start_fly(reference.file, place, "--processes")
    _until(lambda: sum(f.stat().st_size for f in (place / "bag").glob("*.mcap")) > _size(seed), _PATIENCE)
    os.kill(fly.pid, number)
    if number == signal.SIGSTOP:
        time.sleep(3.0)
        os.kill(fly.pid, signal.SIGCONT)
    code = fly.wait(_PATIENCE)
    _until(lambda: not _running(place), 30.0)
    left = _running(place)
    for pid in left:
        os.kill(pid, signal.SIGKILL)
    outcome = Outcome(code, code != 0, left_behind=len(left))
    outcome.tracebacks = sum("Traceback" in log.read_text(errors="replace") for log in place.rglob("*.log"))
    try:
        found = messages_of(place / "bag")
    except BagError:
        recover(place / "bag")
        outcome.recovered, found = True, messages_of(place / "bag")
    for topic, expected in reference.messages.items():
        recorded = found.get(topic, [])
        outcome.wrong = outcome.wrong or recorded != expected[: len(recorded)] or (code == 0 and recorded != expected)
    return outcome


def kill_supervisor(reference: Reference, place: Path, seed: int) -> Iterator[Outcome]:
    """SIGKILL of `fly --processes` itself: its nodes end with it."""
    yield _harm_supervisor(reference, place, seed, signal.SIGKILL)


def freeze_supervisor(reference: Reference, place: Path, seed: int) -> Iterator[Outcome]:
    """SIGSTOP of it for three seconds: nobody is blamed for that time."""
    yield _harm_supervisor(reference, place, seed, signal.SIGSTOP)


def two_flights(reference: Reference, place: Path, seed: int) -> Iterator[Outcome]:
    """Two flights at once, each as if it were alone."""
    options = () if seed % 2 else ("--processes",)
    started = []
    for name in ("one", "two"):
        (place / name).mkdir()
        started.append(_start_fly(reference.file, place / name, *options))
    for name, fly in zip(("one", "two"), started, strict=True):
        code = fly.wait(_PATIENCE)
        outcome = Outcome(code, code != 0)
        outcome.wrong = messages_of(place / name / "bag") != reference.messages
        outcome.tracebacks = int("Traceback" in (place / name / "fly.log").read_text(errors="replace"))
        yield outcome


# Strangers

_FALSE = {
    "css/voltages": ("voltages", 0.5, 0),
    "truth": ("sun_n", -1.0, 0),
    "gyro/imu": ("angular_velocity", 3.0, 0),
    "ekf/sun_estimate": ("sun_b", -1.0, 0),
    "wheels/torque_command": ("torque", 5.0, 1),
}


def strangers(reference: Reference, place: Path, seed: int) -> Iterator[Outcome]:
    """A node that answers each message of one topic by a false one, on each of five topics."""
    del seed
    for topic, (field, factor, ahead) in _FALSE.items():
        bag = place / topic.replace("/", "_")
        with own_domain(reference.mission.name, None, bag, console), ComposedFlight(reference.mission, bag) as flight:
            stranger = _stranger(flight, topic, field, factor, ahead)
            result = flight.fly()
            retire(flight.executor, stranger)
        outcome = reference.judge(result, place, alike=True)
        outcome.wrong = outcome.wrong or messages_of(bag) != reference.messages or not outcome.said
        yield outcome


def _stranger(flight: ComposedFlight, topic: str, field: str, factor: float, ahead: int) -> Node:
    node = Node("stranger", context=flight.context, use_global_arguments=False)
    kind = flight.mission.topics[topic]
    codec, false = codec_of(kind), set()
    publisher = node.create_publisher(kind, topic, LOOP_PUBLISHER)

    def answer(data: bytes) -> None:
        if data in false:
            return
        sample = codec.decode(data)
        setattr(sample, field, np.array(getattr(sample, field)) * factor)
        sample.stamp_ns += ahead * flight.mission.period_ns
        false.add(codec.encode(sample))
        publisher.publish(codec.encode(sample))

    node.create_subscription(kind, topic, answer, RECORDER_SUBSCRIPTION, raw=True)
    flight.executor.add_node(node)
    return node
