# SPDX-License-Identifier: Apache-2.0
"""What the browsers are told, and what becomes of their orders."""

import json
import time
from collections import deque
from typing import Any, NamedTuple

from css_common.health_words import KIND_WORDS
from css_common.schema import shown
from css_console.audience import Audience, Spectator
from css_console.calls import calls_of
from css_console.errors import OrderError
from css_console.orders import Order, order_of
from css_console.watcher import Watcher
from css_msgs.msg import Health

_LOG = 12
_NODES_EVERY_S = 0.5
_MOST_WAITING = 16


class Subject(NamedTuple):
    """What the page is about.

    Attributes:
        title: mission or recording.
        kind: `flight`, `recording` or `attached`.
        length_s: of a recording [s]; 0: unknown.
        missions: that can be flown instead.
        estimators: Sun estimators that can be chosen.
    """

    title: str
    kind: str
    length_s: float = 0.0
    missions: tuple[str, ...] = ()
    estimators: tuple[str, ...] = ()


class Stage:
    """Between the watcher and the audience.

    Attributes:
        audience: the browsers.
        refused: messages of browsers that were no orders.
    """

    def __init__(self, watcher: Watcher, subject: Subject, *, begins: bool = False) -> None:
        """Nobody watches yet.

        Args:
            watcher: of the graph.
            subject: what the page is about.
            begins: let time go on, which is held at the beginning, when the first browser is there.
        """
        self.audience = Audience()
        self.refused = 0
        self._watcher, self._subject = watcher, subject
        self._versions: tuple[int, int] = (-1, -1)
        self._flights = 0
        self._frames = 0
        self._told_nodes = 0.0
        self._log: deque[dict[str, Any]] = deque(maxlen=_LOG)
        self._waiting = 0
        self._begins = begins

    def look(self) -> None:
        """Looks at the graph once, and shows what has changed."""
        watcher = self._watcher
        fresh = watcher.look()
        if self._begins and self.audience and self._is_ready:
            self._begins = False
            watcher.perform(calls_of(order_of('{"do": "resume"}'), watcher.known), lambda verdict: None)
        versions = (watcher.version, watcher.parameters.version)
        if versions != self._versions:
            self._versions = versions
            self.audience.show("scene", self._scene)
        if watcher.flights != self._flights:
            self._flights = watcher.flights
            self.audience.show("history", self._history)
        if fresh:
            self._frames += 1
        now = time.monotonic()
        if fresh or now - self._told_nodes > _NODES_EVERY_S:
            self.audience.show("frame", self._frame)
        if now - self._told_nodes > _NODES_EVERY_S:
            self._told_nodes = now
            self.audience.show("nodes", self._nodes)

    @property
    def _is_ready(self) -> bool:
        """What is held at the beginning is there: a flight at its epoch, a recording before its first message."""
        found = self._watcher.inventory
        return bool(found.pace and found.topics and (self._watcher.frame is not None or found.player))

    def welcome(self, spectator: Spectator) -> None:
        """Shows the state as it is to one who comes."""
        made = {
            "scene": self._scene,
            "history": self._history,
            "frame": self._frame,
            "nodes": self._nodes,
            "log": self._shown_log,
        }
        self.audience.enter(spectator, ((kind, text()) for kind, text in made.items()))

    def take(self, spectator: Spectator, text: str) -> None:
        """Does what a browser orders, and answers it."""
        number = 0
        try:
            order = order_of(text)
            number = order.number
            if order.do == "history":
                spectator.give("history", self._history())
                return
            calls = calls_of(order, self._watcher.known)
        except OrderError as error:
            self.refused += 1
            spectator.answer(_answer(number, False, str(error), []))
            return
        commands = [call.command for call in calls]
        if order.dry:
            spectator.answer(_answer(number, True, "", commands))
        elif self._waiting >= _MOST_WAITING:
            spectator.answer(_answer(number, False, f"{_MOST_WAITING} orders wait for their answers already", commands))
        else:
            self._waiting += 1
            self._watcher.perform(calls, lambda verdict: self._done(spectator, order, commands, *verdict))

    def _done(self, spectator: Spectator, order: Order, commands: list[str], good: bool, text: str) -> None:
        self._waiting -= 1
        spectator.answer(_answer(order.number, good, text, commands))
        self._log.append({"commands": commands, "good": good, "message": text})
        self.audience.show("log", self._shown_log)

    def _frame(self) -> str:
        frame, watcher = self._watcher.frame, self._watcher
        told: dict[str, Any] = {
            "number": self._frames,
            "factor": watcher.factor(),
            "pace": watcher.pace(),
            "faults": watcher.faults(),
        }
        if frame is not None:
            told |= {"now": frame.shown, "row": [None if value != value else value for value in frame.row]}
        return _message("frame", told)

    def _nodes(self) -> str:
        watcher = self._watcher
        told = {"nodes": watcher.nodes(), "director": watcher.director(), "browsers": len(self.audience)}
        return _message("nodes", told)

    def _history(self) -> str:
        return _message("history", {"series": self._watcher.series, "columns": self._watcher.columns()})

    def _shown_log(self) -> str:
        return _message("log", {"log": list(self._log)})

    def _scene(self) -> str:
        watcher, subject = self._watcher, self._subject
        found, parameter = watcher.inventory, watcher.parameter
        told = {
            "subject": subject._asdict(),
            "series": watcher.series,
            "pace": found.pace,
            "player": found.player,
            "director": found.director,
            "faulty": found.faulty,
            "lifecycle": found.lifecycle,
            "rivals": found.rivals,
            "topics": dict(found.topics),
            "kinds": [word for number, word in KIND_WORDS.items() if number != Health.KIND_UNKNOWN],
            "parameters": watcher.parameters.table(),
            "craft": {name: parameter(key) for name, key in _CRAFT.items()},
        }
        return _message("scene", told)


_CRAFT = {
    "mission": "mission.name",
    "case": "mission.case",
    "duration": "mission.duration",
    "normals": "cells.normals",
    "field_of_view_deg": "cells.field_of_view_deg",
    "fields_of_view_deg": "cells.fields_of_view_deg",
    "array_normal": "spacecraft.array_normal",
    "inertia": "spacecraft.inertia",
    "wheel_axes": "wheels.axes",
    "wheels_fitted": "wheels.fitted",
    "rod_axes": "rods.axes",
    "rods_fitted": "rods.fitted",
    "estimator": "graph.estimator",
}
"""Parameters by which the spacecraft is drawn."""


def _message(kind: str, told: dict[str, Any]) -> str:
    return json.dumps({"type": kind, **told}, separators=(",", ":"), allow_nan=False, default=shown)


def _answer(number: int, good: bool, text: str, commands: list[str]) -> str:
    return _message("answer", {"id": number, "good": good, "message": text, "commands": commands})
