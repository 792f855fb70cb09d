# SPDX-License-Identifier: Apache-2.0
"""What a browser may ask for: a fixed set of orders, each with its fields, and nothing else."""

import json
import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from css_common.schema import shown
from css_console.errors import OrderError

LONGEST = 64 << 10
"""Bytes of a message."""
_LONGEST_TEXT = 4096
_MOST_ITEMS = 256
_TRANSITIONS = ("configure", "activate", "deactivate", "cleanup")


class Order(NamedTuple):
    """One order.

    Attributes:
        number: by which the browser knows the answer.
        do: what.
        fields: its fields, checked.
        dry: only say by which commands it would be done.
    """

    number: int
    do: str
    fields: dict[str, Any]
    dry: bool


class _Kind(NamedTuple):
    expected: str
    accepts: Callable[[Any], bool]
    default: Any = None  # None: it must be given


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _is_text(value: Any) -> bool:
    return isinstance(value, str) and len(value) <= _LONGEST_TEXT and "\0" not in value


def _is_list(of: Callable[[Any], bool]) -> Callable[[Any], bool]:
    return lambda value: isinstance(value, list) and len(value) <= _MOST_ITEMS and all(map(of, value))


def _is_value(value: Any) -> bool:
    return isinstance(value, bool) or any(check(value) for check in (_is_number, _is_text, _ITEMS))


_ITEMS = _is_list(lambda item: _is_number(item) or _is_text(item))
_TEXT = _Kind("a text", _is_text)
_FLAG = _Kind("true or false", lambda value: isinstance(value, bool), False)
_SECONDS = _Kind("seconds from 0 on", lambda value: _is_number(value) and value >= 0.0)
_RATE = _Kind("a number above 0, or 0: as fast as it goes", lambda value: _is_number(value) and value >= 0.0)
_FIELDS: Mapping[str, Mapping[str, _Kind]] = {
    "pause": {},
    "resume": {},
    "step": {},
    "rate": {"rate": _RATE},
    "seek": {"time": _SECONDS},
    "set": {"node": _TEXT, "name": _TEXT, "value": _Kind("a value", _is_value)},
    "lifecycle": {"node": _TEXT, "transition": _Kind(" or ".join(_TRANSITIONS), lambda v: v in _TRANSITIONS)},
    "inject": {
        "node": _TEXT,
        "target": _TEXT,
        "kind": _TEXT,
        "values": _Kind("a list of numbers", _is_list(_is_number), []),
        "duration": _SECONDS._replace(default=0.0),
    },
    "clear": {"node": _TEXT, "fault": _TEXT._replace(default="")},
    "reset": {
        "mission": _TEXT._replace(default=""),
        "case": _Kind("a whole number from 0 on, or -1", lambda v: type(v) is int and -1 <= v < 1 << 62, -1),
        "estimator": _TEXT._replace(default=""),
        "overrides": _Kind("a list of KEY=VALUE", _is_list(_is_text), []),
        "keep": _FLAG,
        "paused": _FLAG,
    },
    "history": {},
}


def order_of(text: str) -> Order:
    """The order in a message of a browser.

    Raises:
        OrderError: it is none.
    """
    try:
        given = json.loads(text)
    except (ValueError, RecursionError):
        raise OrderError(f"{shown(text[:80])} given, expected an order in JSON") from None
    if not isinstance(given, dict):
        raise OrderError(f"{shown(text[:80])} given, expected an object")
    number, do, dry = given.pop("id", 0), given.pop("do", ""), given.pop("dry", False)
    if type(number) is not int or not 0 <= number < 1 << 53:
        raise OrderError(f"id: {shown(number)} given, expected a whole number from 0 on")
    if not isinstance(do, str) or do not in _FIELDS:
        raise OrderError(f"do: {shown(do)} given, expected {', '.join(_FIELDS)}")
    if not isinstance(dry, bool):
        raise OrderError(f"dry: {shown(dry)} given, expected true or false")
    return Order(number, do, _checked(do, given), dry)


def _checked(do: str, given: dict[str, Any]) -> dict[str, Any]:
    kinds = _FIELDS[do]
    for name in given:
        if name not in kinds:
            raise OrderError(f"{do}: {shown(name)} given, expected {', '.join(kinds) or 'no field'}")
    fields = {}
    for name, kind in kinds.items():
        value = given.get(name, kind.default)
        if value is None or not kind.accepts(value):
            raise OrderError(f"{do}: {name}: {shown(value)} given, expected {kind.expected}")
        fields[name] = value
    return fields
