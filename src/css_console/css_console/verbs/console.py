# SPDX-License-Identifier: Apache-2.0
"""Starts the console, and what it shows."""

import argparse
import os
import signal
import time
import webbrowser
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from css_bringup.composed import ComposedFlight
from css_bringup.flight_director import Wish
from css_bringup.flight_result import FlightResult, default_bag
from css_bringup.fly_mission import own_domain
from css_bringup.mission_asked_for import mission_of, overrides_of
from css_bringup.options import console, errors
from css_bringup.staying import Staying, fly_and_stay
from css_bringup.verbs.fly import conclude
from css_common.command import FAILED, INTERRUPTED
from css_common.executor import executor_with
from css_common.mission import Mission, load_mission, mission_from_text
from css_common.mission_lookup import known_missions
from css_common.output_port import OutputPort
from css_common.stop_signal import StopSignal
from css_console.errors import ConsoleError
from css_console.guards import new_token
from css_console.provision import provide
from css_estimation.sun.offered import estimators
from css_recording.bag_reader import BagReader
from css_recording.playback import PlaybackOptions
from css_recording.player import PlayerNode
from css_recording.process import ros_process

_FIRST_MISSION = "okeefe_2013"
_RATE = 10.0
_LOOK_S = 0.2


def run(options: argparse.Namespace) -> int:
    """Starts what the options ask for; the exit code.

    Raises:
        ConsoleError: the console cannot run.
        MissionError, BagError: what it is to show is wrong.
    """
    libraries = provide(lambda line: errors.print(line, soft_wrap=True))
    if options.attach:
        return _attach(options, libraries)
    if options.subject is not None and _is_recording(options.subject):
        return _play(options, libraries)
    return _fly(options, libraries)


def _is_recording(subject: str) -> bool:
    return Path(subject).is_dir() or subject.endswith((".mcap", ".db3"))


def _fly(options: argparse.Namespace, libraries: Mapping[str, Path]) -> int:
    options.mission = options.subject or _FIRST_MISSION
    mission = mission_of(options)
    wish = Wish(options.mission, tuple(overrides_of(options)), paused=True)  # until the first browser is there
    rate = _RATE if options.rate is None else options.rate
    told = {"title": mission.name, "missions": tuple(known_missions()), "estimators": tuple(estimators())}

    def bag_of(flown: Mission) -> Path | None:
        return default_bag(flown) if options.record else None

    def end(flown: Mission, result: FlightResult) -> int:
        return conclude(flown, result, as_json=False, with_page=options.record)

    inside = _Inside()
    served = _Served(options, libraries, "flight", told, inside=inside.output_ports)
    with own_domain(mission.name, options.domain, None, console), served:
        code = fly_and_stay(wish, mission, Staying(bag_of, console, end, inside.enter), rate)
    return served.code(code)


class _Inside:
    """The flight of this process."""

    def __init__(self) -> None:
        self._flight: ComposedFlight | None = None

    def enter(self, flight: ComposedFlight) -> None:
        """The next one."""
        self._flight = flight

    def output_ports(self) -> Mapping[str, OutputPort]:
        """What its nodes publish now, by full name."""
        return {} if self._flight is None else self._flight.output_ports()


def _play(options: argparse.Namespace, libraries: Mapping[str, Path]) -> int:
    path = Path(options.subject)
    rate = _RATE if options.rate is None else options.rate
    with BagReader(path) as recording, own_domain(path.name, options.domain, path, console):
        mission = _mission_of(recording)
        begin_ns = recording.start_ns if mission is None else mission.epoch_ns
        told = {"title": str(path), "length_s": (recording.end_ns - begin_ns) * 1e-9}
        fallback = {} if mission is None else mission.shared
        served = _Served(options, libraries, "recording", told, fallback, begin_ns)
        with StopSignal() as stop, ros_process("player", ()), served:
            node = PlayerNode(recording, PlaybackOptions(rate=rate, paused=True, stay=True))
            with executor_with(node) as executor:
                node.play(executor, lambda: stop.came)
        for note in recording.notes:
            errors.print(f"note: {note}", soft_wrap=True)
    return served.code(INTERRUPTED if stop.came else 0)


def _mission_of(recording: BagReader) -> Mission | None:
    text = recording.mission_text
    return None if text is None else mission_from_text(text, f"{recording.name}: mission")


def _attach(options: argparse.Namespace, libraries: Mapping[str, Path]) -> int:
    fallback = {} if options.subject is None else load_mission(options.subject).shared
    told = {"title": options.subject or "running graph", "missions": tuple(known_missions())}
    told["estimators"] = tuple(estimators())
    with StopSignal() as stop, _Served(options, libraries, "attached", told, fallback) as served:
        while not stop.came:
            time.sleep(_LOOK_S)
    return served.code(INTERRUPTED)


class _Served:
    """The page, while the context lasts."""

    def __init__(
        self,
        options: argparse.Namespace,
        libraries: Mapping[str, Path],
        kind: str,
        told: Mapping[str, Any],
        fallback: Mapping[str, Any] | None = None,
        begin_ns: int | None = None,
        inside: Callable[[], Mapping[str, OutputPort]] = dict,
    ) -> None:
        from css_console.stage import Subject  # the server is there now, not before `provide`
        from css_console.thread import ConsoleThread

        self._open, self._waits = options.open, not (options.paused or options.attach)
        # a signal, because whatever flies in the main thread ends by one
        self._thread = ConsoleThread(
            Subject(kind=kind, **told), libraries, new_token(), options.port, fallback, begin_ns,
            failed=lambda: os.kill(os.getpid(), signal.SIGTERM), begins=not (options.paused or options.attach),
            inside=inside,
        )  # fmt: skip

    def __enter__(self) -> "_Served":
        address = self._thread.__enter__().address
        console.print(f"console: {address}  (Ctrl-C ends it)", soft_wrap=True)
        if self._waits:
            console.print("it begins when the page is open")
        if self._open and not webbrowser.open(address):
            errors.print("no browser could be started; open the address by hand")
        return self

    def __exit__(self, *given: Any) -> None:
        self._thread.__exit__(*given)

    def code(self, code: int) -> int:
        """The exit code, when that of what flew is `code`."""
        if self._thread.failure is None:
            return code
        if isinstance(self._thread.failure, ConsoleError):
            raise self._thread.failure
        errors.print(f"the console failed: {self._thread.failure!r}", soft_wrap=True)
        return FAILED
