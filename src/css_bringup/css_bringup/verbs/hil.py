# SPDX-License-Identifier: Apache-2.0
"""Flies a mission with a board in the loop, and says what became of the frames."""

import argparse
import math
from typing import Any

from css_bringup.board_mission import BRIDGE, with_board
from css_bringup.composed import ComposedFlight
from css_bringup.flight_result import default_bag
from css_bringup.fly_mission import fly, own_domain
from css_bringup.mission_asked_for import mission_of
from css_bringup.options import complain, console
from css_bringup.verbs.fly import conclude
from css_common.command import FAILED
from css_common.mission import Mission
from css_common.mission_file import MissionError
from css_common.progress_lines import still_working
from css_common.schema import Values
from css_common.stop_signal import StopSignal
from css_drivers.device_errors import DeviceError
from css_drivers.hil_exchange import ANSWERED, CORRUPT, SENT, WRONG, greet
from css_drivers.hil_frame import VERSION, Sensors
from css_drivers.hil_link import HilLink, open_link
from css_drivers.nodes.hil_bridge import HilBridge, actuators


def run(arguments: argparse.Namespace) -> int:
    """Flies as the options say; the exit code."""
    mission, replaced = with_board(mission_of(arguments), _bridge_options(arguments))
    values = mission.node(BRIDGE[2]).values
    try:
        link = open_link(values)
    except DeviceError as error:
        raise MissionError(f"{error}; expected the board's serial device or address") from error
    console.print(f"the board on {link.name} takes the place of {', '.join(replaced)}", soft_wrap=True)
    try:
        answers = _answers(link, mission, values, arguments.wait)
    except BaseException:
        link.close()
        raise
    if not answers:
        link.close()
        return FAILED
    HilBridge.opened = link
    bag = None if arguments.no_record else (arguments.out or default_bag(mission))
    watch = _Watch(arguments.silence)
    with own_domain(mission.name, arguments.domain, bag, console) as domain:
        result = fly(mission, bag, processes=False, console=console, overwrite=arguments.overwrite, ends=watch)
    result.domain = domain
    result.notes += watch.notes()
    figures = watch.figures()
    console.print(_line(figures), soft_wrap=True)
    return conclude(mission, result, as_json=arguments.json, further={"hil": figures})


def _bridge_options(arguments: argparse.Namespace) -> dict[str, str]:
    """Parameters of the bridge that the options ask for."""
    changes = {"board_estimates": "true"} if arguments.estimate else {}
    given = {"answer_within": arguments.within, "hold_cycles": arguments.hold}
    changes |= {key: str(value) for key, value in given.items() if value is not None}
    if arguments.serial is not None:
        changes |= {"link": "serial", "serial.port": arguments.serial}
        if arguments.listen is not None:
            raise MissionError("--listen goes with --udp")
        return changes | ({} if arguments.baud is None else {"serial.baud": str(arguments.baud)})
    if arguments.baud is not None:
        raise MissionError("--baud goes with --serial")
    host, separator, port = arguments.udp.rpartition(":")
    if not separator or not host or not port.isdecimal():
        raise MissionError(f"--udp {arguments.udp}: expected HOST:PORT, for instance 192.168.7.2:47000")
    changes |= {"link": "udp", "udp.host": host, "udp.port": port}
    return changes | ({} if arguments.listen is None else {"udp.listen": str(arguments.listen)})


def _answers(link: HilLink, mission: Mission, values: Values, wait: float) -> bool:
    """Waits until the board answers; False, after a line that says why, when it does not."""
    wheels, rods = actuators(values)
    cells = (math.nan,) * len(values.cells.normals)
    none = (0.0, 0.0, 0.0)
    told = Sensors(0, round(mission.period_ns * 1e-3), none, none, cells, (0.0,) * wheels, rods)
    with StopSignal() as stop, still_working("waiting for the board"):
        exchange = greet(link, told, wheels, mission.epoch_ns - mission.period_ns, wait, lambda: stop.came)
    if stop.came:
        raise KeyboardInterrupt
    counts = exchange.counts
    if counts[ANSWERED]:
        return True
    reason = exchange.trouble or (
        f"{counts[SENT]} frames of version {VERSION} sent, {counts[CORRUPT]} damaged and {counts[WRONG]} wrong ones "
        f"came back; expected a command for {wheels} wheels and {rods} rods"
    )
    complain("hil: error:", f"no answer of the board on {link.name} within {wait:g} s: {reason}")
    return False


class _Watch:
    """Looks at the bridge in flight."""

    def __init__(self, silence: float) -> None:
        self._silence = silence
        self._bridge: HilBridge | None = None
        self._late_cycles: Any = {}

    def __call__(self, flight: ComposedFlight) -> str:
        """Why the flight ends early: the board has been silent for too long."""
        bridge = flight.nodes[BRIDGE[2]].component
        if not isinstance(bridge, HilBridge):  # not configured yet
            return ""
        self._bridge, self._late_cycles = bridge, flight.plant.counters
        if not flight.plant.begun or bridge.silent_for <= self._silence:
            return ""
        return bridge.trouble or f"the board has not answered for {self._silence:g} s"

    def notes(self) -> list[str]:
        """What was not as it should be, beyond what nodes count."""
        late = self._late_cycles.get("deadline_missed", 0)
        return [f"real time was missed in {late} cycles, which came late"] if late else []

    def figures(self) -> dict[str, int | float]:
        """Frames by what became of them, and round trips [ms]."""
        return {} if self._bridge is None else dict(self._bridge.standing().figures)


def _line(figures: dict[str, int | float]) -> str:
    counts = ", ".join(
        f"{value} {key.removeprefix('frames_').replace('_', ' ')}"
        for key, value in figures.items()
        if "_ms_" not in key
    )
    times = {key.rpartition("_")[2]: value for key, value in figures.items() if key.startswith("round_trip_ms_")}
    if not times:
        return f"frames: {counts}"
    return (
        f"frames: {counts}; round trip {times['p50']} ms median, {times['p99']} ms 99th percentile of the last 1000, "
        f"{times['max']} ms largest"
    )
