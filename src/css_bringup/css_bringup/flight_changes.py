# SPDX-License-Identifier: Apache-2.0
"""What changed at an estimator in flight, as far as a recording tells: scripted events, parameters set by others.

An event of the mission has its time. A parameter that somebody set in flight is on /parameter_events, but the step at
which the node took it is not recorded: only that the latest stamp was such and such when the recorder heard of it.
"""

from collections.abc import Iterable, Mapping
from functools import cache
from typing import Any, NamedTuple

from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from css_common.mission import Event
from css_common.schema import ParameterError, Table

PARAMETER_EVENTS = "/parameter_events"

# fields of rcl_interfaces/msg/ParameterValue in the order of its types, which begin with 1
_VALUES = (
    "bool",
    "integer",
    "double",
    "string",
    "byte_array",
    "bool_array",
    "integer_array",
    "double_array",
    "string_array",
)


class ParameterChange(NamedTuple):
    """Parameters of a node that were set in flight."""

    stamp_ns: int  # latest stamp when it was recorded: about when it took effect
    values: Mapping[str, Any]

    def text(self) -> str:
        """The values as KEY=VALUE."""
        return ", ".join(f"{key}={value}" for key, value in self.values.items())


class RecordedSetting(NamedTuple):
    """A message of /parameter_events."""

    stamp_ns: int
    node: str
    values: Mapping[str, Any]


def read_setting(data: bytes, stamp_ns: int) -> RecordedSetting:
    """The parameters that a message of /parameter_events says have changed.

    Args:
        data: the serialised message.
        stamp_ns: latest stamp of the flight when it was recorded.
    """
    event: Any = _types().deserialize_cdr(data, "rcl_interfaces/msg/ParameterEvent")
    values = {parameter.name: _value(parameter.value) for parameter in event.changed_parameters}
    return RecordedSetting(stamp_ns, event.node.rsplit("/", 1)[-1], values)


@cache
def _types() -> Typestore:
    # only recordings with such messages pay for all the types of ROS
    return get_typestore(Stores.ROS2_JAZZY)


def _value(told: Any) -> Any:
    """What a ParameterValue holds; None when that is nothing."""
    if not 1 <= told.type <= len(_VALUES):
        return None
    value = getattr(told, f"{_VALUES[told.type - 1]}_value")
    return value.tolist() if hasattr(value, "tolist") else value


def settings_in_flight(
    settings: Iterable[RecordedSetting], node: str, table: Table, scripted: Iterable[Event]
) -> list[ParameterChange]:
    """What was set at a node and is not the doing of its scripted events, which set parameters in the same way.

    Args:
        settings: messages of all nodes, in their order.
        node: name of the node.
        table: its parameters; others and values that they refuse are left out, as the node did.
        scripted: events of the mission.
    """
    specifications = {p.name: p for p in table}
    waiting = [(e.parameter, e.value) for e in scripted if e.node == node and e.action == "set"]
    changes = []
    for setting in settings:
        if setting.node != node:
            continue
        values = {}
        for name, value in setting.values.items():
            try:
                values[name] = specifications[name].check(list(value) if specifications[name].is_array else value)
            except (KeyError, ParameterError, TypeError):
                continue
        if len(values) == 1 and next(iter(values.items())) in waiting:
            waiting.remove(next(iter(values.items())))
        elif values:
            changes.append(ParameterChange(setting.stamp_ns, values))
    return changes
