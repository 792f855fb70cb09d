# SPDX-License-Identifier: Apache-2.0
"""Short flights that several tests share."""

from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from rclpy.node import Node

from css_bringup.composed import ComposedFlight
from css_bringup.flight_result import FlightResult
from css_common.codec import Sample, codec_of
from css_common.executor import retire
from css_common.mission import Mission, load_mission
from css_common.qos import LOOP_SUBSCRIPTION
from css_msgs.msg import SpacecraftState
from css_recording.bag_reader import BagReader

MISSION = "okeefe_2013"


def short_mission(duration: float, *overrides: str) -> Mission:
    """The O'Keefe mission, cut to `duration` seconds."""
    return load_mission(MISSION, [f"mission.duration={duration}", *overrides])


def fly_composed(mission: Mission, bag: Path | None) -> FlightResult:
    """Flies a mission in this process."""
    with ComposedFlight(mission, bag) as flight:
        return flight.fly()


@contextmanager
def operator_of(flight: ComposedFlight, act: Callable[[], None]) -> Iterator[Node]:
    """Has a node beside a flight that acts at each of its steps.

    A flight as fast as it goes is over before one who looks at it from time to time has seen much of it.
    """
    operator = Node("operator", context=flight.context, use_global_arguments=False)
    flight.executor.add_node(operator)
    operator.create_subscription(SpacecraftState, "truth", lambda _: act(), LOOP_SUBSCRIPTION, raw=True)
    yield operator
    retire(flight.executor, operator)


def stamped_topics(mission) -> list[str]:
    """Topics of a mission that have a message for each stamp; on the others messages tell of events."""
    return [topic for topic, output in mission.outputs.items() if not output.events]


def messages_by_topic(bag: Path) -> dict[str, list[tuple[int, bytes]]]:
    """Stamps and bytes of every topic of a recording."""
    messages: dict[str, list[tuple[int, bytes]]] = defaultdict(list)
    with BagReader(bag) as reader:
        for message in reader.messages():
            messages[message.topic].append((message.stamp_ns, message.data))
    return dict(messages)


def samples(bag: Path, topic: str, message_type: type) -> list[Sample]:
    """Decoded messages of one topic."""
    codec = codec_of(message_type)
    with BagReader(bag) as reader:
        return [codec.decode(message.data) for message in reader.messages([topic])]
