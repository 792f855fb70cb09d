# SPDX-License-Identifier: Apache-2.0
"""What `ros_internals` takes from rclpy is still there and still does what is expected of it."""

import pytest
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSProfile
from std_msgs.msg import Header

from css_common import ros_internals
from css_common.testing import Bench


@pytest.fixture
def node():
    """A node with one subscription."""
    with Bench() as bench:
        made = Node("probe", context=bench.context, use_global_arguments=False)
        made.create_subscription(
            Header, "heard", lambda message: None, 10, event_callbacks=SubscriptionEventCallbacks(matched=print)
        )
        yield made
        made.destroy_node()


def test_the_executor_finds_subscriptions_in_the_list_that_we_change(node):
    (subscription,) = ros_internals.subscriptions_of(node)
    assert list(node.subscriptions) == [subscription], "rclpy keeps subscriptions elsewhere: see ros_internals"
    ros_internals.subscriptions_of(node).remove(subscription)
    assert list(node.subscriptions) == [], "rclpy hands out a copy of its list: see ros_internals"
    ros_internals.subscriptions_of(node).append(subscription)
    ros_internals.wake_executor_of(node)


def test_the_handle_that_is_shown_is_the_one_that_is_taken_from(node):
    (subscription,) = node.subscriptions
    true = subscription.handle
    other = ros_internals.bare_subscription(node, Header, "/nobody", QoSProfile(depth=1))
    ros_internals.show_executor(subscription, other)
    assert subscription.handle is other, "rclpy keeps the handle elsewhere: see ros_internals"
    ros_internals.show_executor(subscription, true)
    assert subscription.handle is true


def test_events_and_overrides_are_where_they_were(node):
    handlers = next(iter(node.subscriptions)).event_handlers
    assert handlers and all(ros_internals.event_of(handler) is not None for handler in handlers)
    assert ros_internals.overrides_of(node) == {}
