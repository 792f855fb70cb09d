# SPDX-License-Identifier: Apache-2.0
"""What a mission scripts for its flight (`events`) and asks of it (`criteria`)."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from css_common.mission_file import MissionError
from css_common.schema import ParameterError, Table, real, shown, unknown_name

EVENT_KEYS = {"time", "node", "action", "parameter", "value"}
ACTIONS = ("activate", "deactivate", "set")
"""What an event may do, and the keys that it is written with."""


@dataclass(frozen=True)
class Event:
    """A scripted change at a simulated time."""

    name: str
    time: float
    node: str
    action: str
    parameter: str = ""
    value: Any = None


def events_of(raw: Mapping[str, Any], tables: Mapping[str, Table], origin: str) -> tuple[Event, ...]:
    """The events of a mission in the order in which they come.

    Args:
        raw: flat parameters below `events`.
        tables: parameters of each node of the graph.
        origin: file and section for messages.

    Raises:
        MissionError: an event is wrong.
    """
    events = [_event(name, fields, tables, f"{origin}: events.{name}") for name, fields in _grouped(raw)]
    return tuple(sorted(events, key=lambda event: (event.time, event.name)))


def _event(name: str, fields: Mapping[str, Any], tables: Mapping[str, Table], where: str) -> Event:
    if not name.isprintable():
        raise MissionError(f"{where}: expected a name of printable characters")
    for key in fields:
        if key not in EVENT_KEYS:
            raise MissionError(f"{where}.{unknown_name(key, EVENT_KEYS)}")
    time, node, action = fields.get("time"), fields.get("node"), fields.get("action")
    if not isinstance(time, float) or not time >= 0.0 or time == float("inf"):
        raise MissionError(f"{where}.time: {shown(time)} given, expected seconds from the epoch, such as 600.0")
    if action not in ACTIONS:
        raise MissionError(f"{where}.action: {shown(action)} given, expected one of {', '.join(ACTIONS)}")
    if not isinstance(node, str) or node not in tables:
        raise MissionError(f"{where}.node: {unknown_name(str(node), tables)}")
    event = Event(name, time, node, action, str(fields.get("parameter", "")), fields.get("value"))
    if action == "set":
        _check_set(event, tables[node], where)
    return event


def _check_set(event: Event, table: Table, where: str) -> None:
    known = {p.name: p for p in table}
    if event.parameter not in known:
        raise MissionError(f"{where}.parameter: {unknown_name(event.parameter, known)}")
    if not known[event.parameter].tunable:
        raise MissionError(f"{where}.parameter: {event.parameter} cannot change in flight")
    try:
        known[event.parameter].check(event.value)
    except ParameterError as error:
        raise MissionError(f"{where}.value: {error}") from error


def criteria_of(raw: Mapping[str, Any], origin: str) -> dict[str, dict[str, float]]:
    """Quantity to its limits, `min` and `max`.

    Args:
        raw: flat parameters below `criteria`.
        origin: file and section for messages.

    Raises:
        MissionError: a limit is wrong, or no value is within both.
    """
    criteria = dict(_grouped(raw))
    for quantity, limits in criteria.items():
        where = f"{origin}: criteria.{quantity}"
        for key, value in limits.items():
            if key not in ("min", "max"):
                raise MissionError(f"{where}{'.' if key else ''}{key}: unknown, expected min or max")
            try:
                real(key, 0.0, "-", "").check(value)
            except ParameterError as error:
                raise MissionError(f"{where}.{error}") from error
        if limits.get("min", -float("inf")) > limits.get("max", float("inf")):
            raise MissionError(f"{where}.min: {limits['min']} given, expected at most the max of {limits['max']}")
    return criteria


def _grouped(flat: Mapping[str, Any]) -> Iterable[tuple[str, dict[str, Any]]]:
    groups: dict[str, dict[str, Any]] = {}
    for name, value in flat.items():
        group, _, key = name.partition(".")
        groups.setdefault(group, {})[key] = value
    return groups.items()
