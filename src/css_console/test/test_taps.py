# SPDX-License-Identifier: Apache-2.0
"""A topic looked at now and then: fast, silent, begun anew; nothing is taken twice or for another flight."""

import pytest
import rclpy
from rclpy.node import Node
from rclpy.serialization import deserialize_message

from css_common.codec import codec_of
from css_common.qos import LOOP_PUBLISHER
from css_console.taps import KEPT, HeardTap
from css_msgs.msg import ControlStatus

PERIOD_NS = 100_000_000


class Topic:
    """Somebody who publishes, and one who looks."""

    def __init__(self, node: Node) -> None:
        self._publisher = node.create_publisher(ControlStatus, "/control/status", LOOP_PUBLISHER)
        self._codec = codec_of(ControlStatus)
        self.step = 0
        self.tap = HeardTap(node, "/control/status", ControlStatus)

    def publish(self, count: int) -> None:
        for _ in range(count):
            self.step += 1
            data = self._codec.encode(self._codec.sample(self.step * PERIOD_NS, "bus"))
            self._publisher.publish(deserialize_message(data, ControlStatus))

    def look_until(self, step: int) -> bool:
        """Looks until a step is there; whether time went back."""
        went_back = False
        while not self.tap.stamps or self.tap.stamps[-1] != step * PERIOD_NS:
            went_back |= self.tap.take()
        return went_back

    def until_heard(self) -> None:
        """Publishes until something of it comes to the one who looks."""
        before = self.tap.taken
        while self.tap.taken == before:
            self.publish(1)
            self.tap.take()


@pytest.fixture
def topic():
    context = rclpy.Context()
    context.init()
    node = Node("somebody", context=context, use_global_arguments=False)
    yield Topic(node)
    node.destroy_node()
    context.try_shutdown()


def hurry(topic: Topic) -> None:
    """Publishes more than is kept from look to look, until it is heard in another way."""
    while not topic.tap.hurries:
        topic.publish(2 * KEPT)
        topic.tap.take()


@pytest.mark.timeout(120)
def test_what_is_fast_and_falls_silent_is_known_to_its_last_message(topic):
    topic.until_heard()
    hurry(topic)
    topic.publish(5)  # which nobody may hear: the new way is not known to the publisher yet
    while topic.tap.hurries:
        assert not topic.tap.take()
    assert not topic.look_until(topic.step)
    taken = topic.tap.taken
    for _ in range(50):
        assert not topic.tap.take()
    assert topic.tap.taken == taken and not topic.tap.hurries  # what is latched comes once


@pytest.mark.timeout(120)
def test_another_flight_is_seen_though_the_last_one_was_fast(topic):
    topic.until_heard()
    hurry(topic)
    topic.step = 0
    topic.publish(1)
    went_back = topic.look_until(1)
    assert went_back and topic.tap.stamps == [PERIOD_NS]
