# SPDX-License-Identifier: Apache-2.0
"""A flight in the process of its watcher is read, not heard: each message once, and nothing more is sent for it."""

import pytest
import rclpy
from rclpy.node import Node
from rclpy.qos_overriding_options import QoSOverridingOptions

from css_common.codec import codec_of
from css_common.component import Output
from css_common.output_port import RECENT, OutputPort
from css_console.taps import ReadTap, Taps
from css_msgs.msg import ControlStatus

PERIOD_NS = 100_000_000
TOPIC = "/control/status"


def message(step: int) -> bytes:
    codec = codec_of(ControlStatus)
    return codec.encode(codec.sample(step * PERIOD_NS, "bus"))


def port_of(node: Node) -> OutputPort:
    return OutputPort(node, Output("status", "control/status", ControlStatus), QoSOverridingOptions(()))


@pytest.fixture
def node():
    context = rclpy.Context()
    context.init()
    node = Node("somebody", context=context, use_global_arguments=False)
    yield node
    node.destroy_node()
    context.try_shutdown()


@pytest.fixture
def port(node):
    return port_of(node)


def test_each_message_is_taken_once_and_in_order(port):
    tap = ReadTap(port, ControlStatus)
    for step in (1, 2, 3):
        port.publish(message(step))
    assert not tap.take()
    assert tap.stamps == [1 * PERIOD_NS, 2 * PERIOD_NS, 3 * PERIOD_NS]
    assert not tap.take()
    port.publish(message(4))
    tap.take()
    assert tap.stamps == [step * PERIOD_NS for step in (1, 2, 3, 4)] and tap.taken == 4
    sample = tap.at(2 * PERIOD_NS)
    assert sample is not None and sample.stamp_ns == 2 * PERIOD_NS


def test_of_a_fast_topic_the_last_messages_are_read(port):
    tap = ReadTap(port, ControlStatus)
    for step in range(1, 4 * RECENT + 1):
        port.publish(message(step))
    tap.take()
    assert tap.stamps == [step * PERIOD_NS for step in range(3 * RECENT + 1, 4 * RECENT + 1)]


def test_equal_messages_are_as_many_as_were_published(port):
    tap = ReadTap(port, ControlStatus)
    for _ in range(2):
        port.publish(message(1))
        tap.take()
    assert tap.taken == 2


def test_time_that_goes_back_begins_anew_and_damage_is_counted(port):
    tap = ReadTap(port, ControlStatus)
    port.publish(message(9))
    tap.take()
    port.recent.append(b"\x00\x01")
    port.publish(message(1))
    assert tap.take()
    assert tap.stamps == [PERIOD_NS] and tap.malformed == 1


def test_a_topic_of_this_process_has_no_listener_for_the_watcher(node, port):
    taps = Taps()
    taps.follow(node, [(TOPIC, ControlStatus)], {TOPIC: port})
    port.publish(message(1))
    taps.take()
    assert taps.common_stamp() == PERIOD_NS
    assert port.publisher.get_subscription_count() == 0


@pytest.mark.timeout(60)
def test_another_flight_of_this_process_and_one_of_another_are_followed(node, port):
    taps = Taps()
    taps.follow(node, [(TOPIC, ControlStatus)], {TOPIC: port})
    port.publish(message(9))
    taps.take()
    other = port_of(node)
    other.publish(message(1))
    taps.follow(node, [(TOPIC, ControlStatus)], {TOPIC: other})
    taps.take()
    assert [tap.stamps for tap in taps] == [[PERIOD_NS]]
    taps.follow(node, [(TOPIC, ControlStatus)], {})
    while port.publisher.get_subscription_count() == 0:
        pass  # discovery
    for tap in taps:
        tap.close()
