# SPDX-License-Identifier: Apache-2.0
"""Parameters that somebody set in flight, as a recording of /parameter_events tells them."""

from collections.abc import Mapping
from functools import cache
from typing import Any, NamedTuple

from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

PARAMETER_EVENTS = "/parameter_events"
"""Topic on which nodes tell of their parameters."""

_EVENT = "rcl_interfaces/msg/ParameterEvent"
_ARRAYS = ("byte_array", "bool_array", "integer_array", "double_array", "string_array")
_VALUES = ("bool", "integer", "double", "string", *_ARRAYS)
"""Fields of rcl_interfaces/msg/ParameterValue in the order of its types, which begin with 1."""


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
    event = _read(data)
    values = {parameter.name: _value(parameter.value) for parameter in event.changed_parameters}
    return RecordedSetting(stamp_ns, event.node.rsplit("/", 1)[-1], values)


def _read(data: bytes) -> Any:
    types = _types()
    definition = types.get_msgdef(_EVENT)
    # not by `deserialize_cdr`: it refuses more than three bytes behind the end, where rclpy leaves up to eight
    event, _ = definition.deserialize_cdr_le(data[4:], 0, definition.cls, types)
    return event


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
