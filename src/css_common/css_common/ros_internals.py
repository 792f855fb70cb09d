# SPDX-License-Identifier: Apache-2.0
"""What of rclpy is not public, taken here and nowhere else: a release that moves something breaks this file alone."""

from collections.abc import Mapping
from typing import Any

from rclpy._rclpy_pybind11 import InvalidHandle, RCLError, RCLInvalidROSArgsError, UnknownROSArgsError
from rclpy.event_handler import EventHandler
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription
from rclpy.type_support import check_for_type_support

__all__ = ["InvalidHandle", "RCLError", "RCLInvalidROSArgsError", "UnknownROSArgsError"]


def subscriptions_of(node: Node) -> list[Subscription]:
    """The list in which executors find the subscriptions of a node; may be changed."""
    return node._subscriptions


def wake_executor_of(node: Node) -> None:
    """Has the executor of a node look at its subscriptions anew."""
    node._wake_executor()


def overrides_of(node: Node) -> Mapping[str, Any]:
    """Parameters that were given to a node from outside, declared or not."""
    return node._parameter_overrides


def event_of(handler: EventHandler) -> Any:
    """The middleware's event behind a handler."""
    return handler._EventHandler__event  # type: ignore[attr-defined]


def bare_subscription(node: Node, message_type: type, topic: str, qos: QoSProfile) -> Any:
    """A subscription of the middleware without rclpy's object around it."""
    check_for_type_support(message_type)
    with node.handle:
        return rclpy_implementation.Subscription(node.handle, message_type, topic, qos.get_c_qos_profile())


def show_executor(subscription: Subscription, handle: Any) -> None:
    """Puts another handle into a subscription, from which the executor takes then."""
    subscription._Subscription__subscription = handle  # type: ignore[attr-defined]
