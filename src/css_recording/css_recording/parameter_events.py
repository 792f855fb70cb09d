# SPDX-License-Identifier: Apache-2.0
"""Parameters that somebody set in flight, as a recording of /parameter_events tells them."""

from collections.abc import Mapping
from typing import Any, NamedTuple

PARAMETER_EVENTS = "/parameter_events"
"""Topic on which nodes tell of their parameters."""


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
    # only recordings with such messages pay for rclpy
    from rcl_interfaces.msg import ParameterEvent
    from rclpy.parameter import parameter_value_to_python
    from rclpy.serialization import deserialize_message

    event = deserialize_message(data, ParameterEvent)
    values = {p.name: parameter_value_to_python(p.value) for p in event.changed_parameters}
    return RecordedSetting(stamp_ns, event.node.rsplit("/", 1)[-1], values)
