# SPDX-License-Identifier: Apache-2.0
"""Topics of the live graph in the words of a recording, and back."""

import importlib

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo

from css_recording.bag_metadata import QosProfile
from css_recording.errors import BagError
from css_recording.schemas import split_type_name

_RELIABILITY = {ReliabilityPolicy.RELIABLE: "reliable", ReliabilityPolicy.BEST_EFFORT: "best_effort"}
_DURABILITY = {DurabilityPolicy.TRANSIENT_LOCAL: "transient_local", DurabilityPolicy.VOLATILE: "volatile"}
_HISTORY = {HistoryPolicy.KEEP_LAST: "keep_last", HistoryPolicy.KEEP_ALL: "keep_all"}


def message_class_of(type_name: str) -> type:
    """Message class of a full type name.

    Raises:
        BagError: the type is not installed.
    """
    package, name = split_type_name(type_name)
    try:
        found = getattr(importlib.import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError) as error:
        raise BagError(f"message type {type_name} is not installed") from error
    assert isinstance(found, type)
    return found


def recorded_qos(profile: QoSProfile) -> QosProfile:
    """A quality of service as a recording says it."""
    return QosProfile(
        _RELIABILITY.get(profile.reliability, "unknown"),
        _DURABILITY.get(profile.durability, "unknown"),
        _HISTORY.get(profile.history, "unknown"),
        profile.depth,
    )


def publishers_of_others(node: Node, topic: str) -> list[TopicEndpointInfo]:
    """Publishers of a topic that belong to other nodes."""
    return [
        publisher
        for publisher in node.get_publishers_info_by_topic(topic)
        if (publisher.node_name, publisher.node_namespace) != (node.get_name(), node.get_namespace())
    ]
