# SPDX-License-Identifier: Apache-2.0
"""The ROS node of the console: looks at a graph now and then, and asks its nodes for what browsers order."""

import math
import time
from collections import deque
from collections.abc import Callable, Mapping
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from lifecycle_msgs.msg import TransitionEvent
from lifecycle_msgs.srv import GetState
from rclpy.context import Context
from rclpy.node import Node

from css_common.epochs import mission_epoch
from css_common.executor import create_executor
from css_common.fault_lines import FAULTS
from css_common.link_kinds import LINK_FAULTS
from css_common.output_port import OutputPort
from css_common.vectors import vector_of
from css_console.calls import Call, Known, Verdict
from css_console.frames import Frame, Spacecraft, frame_of
from css_console.history import History
from css_console.inventory import Inventory, take_inventory
from css_console.parameters import Parameters
from css_console.requests import Requests
from css_console.taps import TYPES, Taps

_INVENTORY_EVERY_S = 3.0  # wall time [s] between looks around
_LOOK_EVERY_S = 0.2  # the same before anything flies
_MOST_CALLBACKS = 24  # in a look
_FACTOR_OVER_S = 2.0
_LEVELS = {
    DiagnosticStatus.OK: "ok",
    DiagnosticStatus.WARN: "warn",
    DiagnosticStatus.ERROR: "error",
    DiagnosticStatus.STALE: "stale",
}
_MOVES = 3  # instants in a row by which time goes on; one by one it may be stepped


class Watcher:
    """What is known of the graph now.

    Attributes:
        inventory: nodes and topics.
        parameters: of all nodes.
        history: of the strip charts.
        frame: the last instant seen; None: nothing yet.
        version: grows when anything but the instant changes.
        flights: grows when time goes back: another flight, or another place in a recording.
    """

    def __init__(
        self,
        fallback: Mapping[str, Any] | None = None,
        begin_ns: int | None = None,
        inside: Callable[[], Mapping[str, OutputPort]] = dict,
    ) -> None:
        """Joins the ROS domain of this process.

        Args:
            fallback: parameters of the mission, for a graph whose nodes tell none.
            begin_ns: stamp from which seconds count; None: the epoch that the nodes tell.
            inside: what nodes of this process publish now, by full name.
        """
        self._context = Context()
        self._context.init()
        self._node = Node("console", context=self._context, use_global_arguments=False)
        self._executor = create_executor(None, self._context)
        self._executor.add_node(self._node)
        self._fallback = fallback or {}
        self._begin_ns = begin_ns
        self._first_ns = self._shown_begin_ns = 0
        self._taps = Taps()
        self._inside = inside
        self._ports: Mapping[str, OutputPort] = {}
        self._requests = Requests(self._node)
        self.parameters = Parameters(self._node, self._requests.ask)
        self.inventory = Inventory()
        self.history = History(0)
        self.frame: Frame | None = None
        self.version = 0
        self.flights = 0
        self._stamp_ns = -1
        self._taken = 0
        self._series: tuple = ()
        self._looked = -math.inf
        self._times: deque[tuple[float, int]] = deque()
        self._diagnostics: dict[str, dict[str, Any]] = {}
        self._heard = 0  # messages by callbacks
        self._moves = 0  # instants that came since the node that paces time has told of itself
        self._states: dict[str, str] = {}
        self._watched_states: dict[str, Any] = {}
        self._node.create_subscription(DiagnosticArray, "/diagnostics", self._note_diagnostics, 100)

    def close(self) -> None:
        """Leaves the graph."""
        for tap in self._taps:
            tap.close()
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.try_shutdown()

    # Looking

    def look(self) -> bool:
        """Looks once; whether there is an instant that was not there before."""
        self._listen()
        self._requests.look()
        now = time.monotonic()
        if now - self._looked > (_INVENTORY_EVERY_S if self.frame is not None else _LOOK_EVERY_S):
            self._looked = now
            self._look_around()
        elif self._inside() != self._ports:
            self._follow_topics()
        if self._taps.take():
            self._begin_anew()
        stamp_ns = self._taps.common_stamp()
        taken = self._taps.taken
        if stamp_ns is None or taken == self._taken:
            return False
        self._taken = taken
        if stamp_ns < self._stamp_ns:
            self._begin_anew()
        self._show(stamp_ns, now)
        return True

    def _listen(self) -> None:
        """Lets the node hear what has come, one thing at a time, and once more than there was.

        Each time the interpreter goes to the flight's thread and back, which costs the flight more than what is heard.
        """
        for _ in range(_MOST_CALLBACKS):
            heard = self._heard + self.parameters.heard
            self._executor.spin_once(timeout_sec=0.0)
            if self._heard + self.parameters.heard == heard and not self._requests.pending:
                return

    def _look_around(self) -> None:
        found = take_inventory(self._node)
        if found != self.inventory:
            if set(self.inventory.director.split()) and found.director != self.inventory.director:
                self.parameters.read_again()
            self.inventory = found
            self.version += 1
        self._follow_topics()
        self.parameters.follow(found.parameters)
        self._follow_states(found.lifecycle)

    def _follow_topics(self) -> None:
        self._ports = self._inside()
        self._taps.follow(self._node, [(topic, TYPES[kind]) for topic, kind in self.inventory.topics], self._ports)

    def _begin_anew(self) -> None:
        self.flights += 1
        self._stamp_ns = -1
        self._times.clear()
        self.history = History(len(self._series))
        self.parameters.read_again()

    def _show(self, stamp_ns: int, now: float) -> None:
        if self._stamp_ns < 0:
            self._first_ns = stamp_ns
        fresh, self._stamp_ns = stamp_ns != self._stamp_ns, stamp_ns
        begin_ns = self.begin_ns
        if begin_ns != self._shown_begin_ns:  # nodes have told the epoch: what was shown counted from another instant
            self._shown_begin_ns = begin_ns
            self.history = History(len(self._series))
            self.flights += 1
        samples = self._taps.samples(stamp_ns)
        frame = frame_of(samples, stamp_ns, begin_ns, self._craft())
        if frame.series != self._series:
            self.history = self.history.rearranged(
                [self._series.index(s) if s in self._series else None for s in frame.series]
            )
            self._series = frame.series
            self.version += 1
        self.history.add(frame.shown["time"], frame.row)
        if fresh:
            self._moves += 1
            self._times.append((now, stamp_ns))
        while self._times and self._times[-1][0] - self._times[0][0] > _FACTOR_OVER_S:
            self._times.popleft()
        self.frame = frame

    def factor(self) -> float | None:
        """Seconds of flight per second of the wall clock over the last two; None: time stands still."""
        now = time.monotonic()
        if not self._times or now - self._times[-1][0] > _FACTOR_OVER_S:
            return None
        (begin, first_ns), (end, last_ns) = self._times[0], self._times[-1]
        return (last_ns - first_ns) * 1e-9 / (end - begin) if end - begin > 0.2 else None

    @property
    def begin_ns(self) -> int:
        """Stamp from which seconds count."""
        if self._begin_ns is not None:
            return self._begin_ns
        first = self.parameters.first
        try:
            mission = SimpleNamespace(
                epoch=first("mission.epoch") or "",
                epoch_spread_days=first("mission.epoch_spread_days") or 0.0,
                seed=first("mission.seed"),
                case=first("mission.case"),
            )
            return mission_epoch(mission) or self._first_ns  # type: ignore[arg-type]
        except ValueError:
            return self._first_ns

    def parameter(self, name: str) -> Any:
        """The value of a parameter that nodes share, or of the mission; None without."""
        value = self.parameters.first(name)
        return self._fallback.get(name) if value is None else value

    def _craft(self) -> Spacecraft:
        normal = self.parameter("spacecraft.array_normal")
        known = normal is not None and len(normal) == 3
        return Spacecraft(
            vector_of(np.array(normal, float)) if known else None, self.parameter("graph.estimator") or ""
        )

    # States of nodes

    def _note_diagnostics(self, message: DiagnosticArray) -> None:
        self._heard += 1
        for status in message.status:
            row = {
                "node": status.name,
                "level": _LEVELS.get(status.level, "?"),
                "message": status.message,
                "counters": {value.key: value.value for value in status.values},
            }
            self._diagnostics[status.name] = row
            if status.name == self.inventory.pace:
                self._moves = 0

    def _follow_states(self, nodes: tuple[str, ...]) -> None:
        for gone in set(self._watched_states) - set(nodes):
            self._node.destroy_subscription(self._watched_states.pop(gone))
            self._states.pop(gone, None)
        for fresh in sorted(set(nodes) - set(self._watched_states)):
            self._watched_states[fresh] = self._node.create_subscription(
                TransitionEvent,
                f"{fresh}/transition_event",
                partial(self._note_state, fresh),
                10,
            )
            self._ask_state(fresh)

    def _ask_state(self, node: str) -> None:
        def note(answer: Any) -> None:
            self._states[node] = answer.current_state.label

        self._requests.ask(f"{node}/get_state", GetState, GetState.Request(), note)

    def _note_state(self, node: str, event: TransitionEvent) -> None:
        self._heard += 1
        self._states[node] = event.goal_state.label

    def nodes(self) -> list[dict[str, Any]]:
        """Of each node: state of its lifecycle, health and counters."""
        present = sorted({*self.inventory.parameters, *self.inventory.lifecycle})
        rows = []
        for node in present:
            told = self._diagnostics.get(node, {"level": "ok", "message": "", "counters": {}})
            rows.append({**told, "node": node, "state": self._states.get(node, "")})
        return rows

    def pace(self) -> dict[str, Any]:
        """Whether time is held, and the rate, as the node that paces it tells; rate 0: as fast as it goes.

        What a node tells once a second may be older than what was just asked of it: time that goes on is not held.
        """
        node = self.inventory.pace
        rate = self.parameters.values.get(node, {}).get("rate")
        told = self._diagnostics.get(node, {}).get("message", "")
        limited = isinstance(rate, float) and math.isfinite(rate)
        return {
            "node": node,
            "paused": told == "paused" and self._moves < _MOVES,
            "rate": rate if limited else 0.0,
            "state": told,
        }

    def faults(self) -> list[str]:
        """Faults as nodes have them in their parameters; of a recording those that it tells."""
        if not self.inventory.faulty:
            return [] if self.frame is None else self.frame.shown["faults"]
        return [
            f"{node.lstrip('/')}: {line}"
            for node, values in sorted(self.parameters.values.items())
            for name in (FAULTS.name, LINK_FAULTS.name)
            for line in values.get(name, ())
        ]

    def director(self) -> dict[str, Any]:
        """What the node that flies again says of the flight."""
        told = self._diagnostics.get(self.inventory.director, {})
        return {"node": self.inventory.director, "message": told.get("message", ""), **told.get("counters", {})}

    # Orders

    @property
    def known(self) -> Known:
        """What calls are addressed to."""
        found = self.inventory
        return Known(found.pace, found.player, found.director, self.begin_ns, self.parameters.types)

    def perform(self, calls: list[Call], done: Callable[[Verdict], None]) -> None:
        """Makes calls one after the other, until one is refused; then tells what came of them."""
        if not calls:
            done((True, ""))
            return
        call, *others = calls

        def answered(answer: Any) -> None:
            good, text = call.verdict(answer)
            if good and others:
                self.perform(others, done)
                return
            self._note_pace(call, good)
            done((good, text))

        self._requests.ask(call.service, call.type, call.request, answered, lambda why: done((False, why)))

    def _note_pace(self, call: Call, good: bool) -> None:
        """What diagnostics would say within a second."""
        node, _, name = call.service.rpartition("/")
        if good and node == self.inventory.pace and name in ("pause", "resume"):
            row = self._diagnostics.setdefault(node, {"node": node, "level": "ok", "counters": {}})
            row["message"] = "paused" if name == "pause" else "playing"
            self._moves = 0

    def columns(self) -> list[list[float | None]]:
        """The strip charts so far: time and a column for each series, None where there is none."""
        return [
            [None if math.isnan(value) else float(value) for value in column]
            for column in np.round(self.history.columns(), 6)
        ]

    @property
    def series(self) -> list[dict[str, str]]:
        """Of the strip charts, in the order of rows and columns."""
        return [{"chart": chart, "name": name, "unit": unit} for chart, name, unit in self._series]
