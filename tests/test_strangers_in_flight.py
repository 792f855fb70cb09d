# SPDX-License-Identifier: Apache-2.0
"""Other nodes on the topics of a flight: it is the flight without them, and says at its end that they were there."""

import json
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager

import numpy as np
import pytest
from flights import fly_composed, messages_by_topic, short_mission
from rclpy.node import Node

from css_bringup.composed import ComposedFlight
from css_bringup.verbs.fly import conclude
from css_common.codec import codec_of
from css_common.command import FAILED
from css_common.executor import retire
from css_common.qos import LOOP_PUBLISHER, RECORDER_SUBSCRIPTION
from css_common.sole_subscription import SoleSubscription
from css_recording.bag_reader import BagReader

SECONDS = 30.0


@pytest.fixture(scope="module")
def clean(tmp_path_factory) -> dict:
    """The flight that nobody disturbs."""
    bag = tmp_path_factory.mktemp("clean") / "bag"
    result = fly_composed(short_mission(SECONDS), bag)
    assert (result.failure, result.notes) == ("", [])
    return messages_by_topic(bag)


class Stranger:
    """A node that answers messages of one topic of the flight by others of its own."""

    def __init__(self, flight: ComposedFlight, name: str = "stranger") -> None:
        self.node = Node(name, context=flight.context, use_global_arguments=False)
        self.sent = 0
        self._flight = flight
        self._publishers: dict = {}
        flight.executor.add_node(self.node)

    def speak(self, topic: str, data: bytes) -> None:
        """Publishes on a topic of the flight."""
        if topic not in self._publishers:
            self._publishers[topic] = self.node.create_publisher(
                self._flight.mission.topics[topic], topic, LOOP_PUBLISHER
            )
        self._publishers[topic].publish(data)
        self.sent += 1

    def hear(self, topic: str, callback: Callable[[bytes], None]) -> None:
        """Listens to a topic of the flight."""
        kind = self._flight.mission.topics[topic]
        self.node.create_subscription(kind, topic, callback, RECORDER_SUBSCRIPTION, raw=True)


def _altered(flight: ComposedFlight, topic: str, field: str, factor: float) -> Callable[[bytes], bytes]:
    codec = codec_of(flight.mission.topics[topic])

    def alter(data: bytes) -> bytes:
        sample = codec.decode(data)
        setattr(sample, field, np.array(getattr(sample, field)) * factor)
        return codec.encode(sample)

    return alter


def _false(topic: str, field: str, factor: float, ahead_steps: int = 0):
    """Sends a false message for each of the flight, with its stamp or one ahead of it."""

    def disturb(stranger: Stranger, flight: ComposedFlight) -> None:
        alter, codec = _altered(flight, topic, field, factor), codec_of(flight.mission.topics[topic])
        lead = ahead_steps * flight.mission.period_ns

        def answer(data: bytes) -> None:
            if data in false:
                return  # its own
            sample = codec.decode(alter(data))
            sample.stamp_ns += lead
            false.add(codec.encode(sample))
            stranger.speak(topic, codec.encode(sample))

        false: set[bytes] = set()
        stranger.hear(topic, answer)

    return disturb


def _play(stranger: Stranger, flight: ComposedFlight) -> None:
    """Plays a whole recording of voltages, with the stamps of this flight, before it begins."""
    mission, codec = flight.mission, codec_of(flight.mission.topics["css/voltages"])
    for step in range(mission.steps):
        sample = codec.sample(mission.epoch_ns + step * mission.period_ns, "bus", voltages=np.full(8, 0.7))
        stranger.speak("css/voltages", codec.encode(sample))


KINDS = {
    "false_voltages": (_false("css/voltages", "voltages", 0.5), "css/voltages"),
    "false_truth": (_false("truth", "sun_n", -1.0), "truth"),
    "false_estimates": (_false("ekf/sun_estimate", "sun_b", -1.0), "ekf/sun_estimate"),
    "commands_ahead": (_false("wheels/torque_command", "torque", 5.0, ahead_steps=1), "wheels/torque_command"),
    "whole_recording": (_play, "css/voltages"),
}


@contextmanager
def _disturbed(flight: ComposedFlight, disturb) -> Iterator[Stranger]:
    stranger = Stranger(flight)
    disturb(stranger, flight)
    try:
        yield stranger
    finally:
        retire(flight.executor, stranger.node)


@pytest.mark.parametrize("kind", KINDS)
def test_flight_among_strangers_is_the_flight_alone_and_names_them(kind, clean, tmp_path, capfd):
    disturb, topic = KINDS[kind]
    mission = short_mission(SECONDS)
    with ExitStack() as stack:
        flight = stack.enter_context(ComposedFlight(mission, tmp_path / "bag"))
        stranger = stack.enter_context(_disturbed(flight, disturb))
        result = flight.fly()
    assert result.failure == ""
    assert messages_by_topic(tmp_path / "bag") == clean
    assert stranger.sent > 100
    left_out = [note for note in result.notes if "/stranger" in note and f"/{topic}" in note]
    assert len(left_out) >= 2, "a node that listens and the recorder"
    assert result.messages_lost == 0
    assert conclude(mission, result, as_json=True) == FAILED
    printed = capfd.readouterr()
    assert json.loads(printed.out.splitlines()[-1])["incidents"] == result.notes
    assert printed.err.count("not as it should be:") == len(result.notes)
    with BagReader(tmp_path / "bag") as reader:
        assert "/stranger" in reader.description["incidents"]


def test_second_flight_in_the_same_domain_ends_before_it_begins(tmp_path):
    mission = short_mission(SECONDS)
    with ComposedFlight(mission, tmp_path / "first") as first, ComposedFlight(mission) as second:
        for node in first.nodes.values():
            assert node.start()
        while second.plant.count_publishers("truth") == 0:  # it knows of the first as soon as the middleware tells
            first.executor.spin_once(timeout_sec=0.01)
        result = second.fly()
    assert "two flights in one ROS_DOMAIN_ID" in result.failure


def test_every_topic_of_the_graph_has_one_writer_that_may_speak():
    with ComposedFlight(short_mission(SECONDS)) as flight:
        for node in flight.nodes.values():
            assert node.start()
        subscriptions = [s for node in flight.nodes.values() for s in node.subscriptions_made]
        assert {s.topic for s in subscriptions} >= {"/truth", "/css/voltages", "/gyro/imu", "/ekf/sun_estimate"}
        assert all(isinstance(s, SoleSubscription) for s in subscriptions)
        for subscription in subscriptions:
            expected = f"/{flight.mission.publishers[subscription.topic.lstrip('/')]}"
            assert not subscription._choice.admits("/somebody")
            assert subscription._choice.admits(expected)
