# SPDX-License-Identifier: Apache-2.0
"""A playback that goes to another instant: forward, back, held, and from its end."""

from typing import Any

import pytest
from rclpy.parameter import Parameter

from css_common.codec import stamp_of
from css_common.qos import RECORDER_SUBSCRIPTION
from css_msgs.msg import CssVoltages
from css_msgs.srv import Seek
from css_recording.bag_reader import BagReader
from css_recording.playback import PlaybackOptions
from css_recording.player import PlayerNode


@pytest.fixture
def heard(graph):
    """Stamps of the voltages that are heard."""
    stamps: list[int] = []
    node = graph.node("listener")
    node.create_subscription(
        CssVoltages, "css/voltages", lambda data: stamps.append(stamp_of(data)), RECORDER_SUBSCRIPTION, raw=True
    )
    return stamps


class Playing:
    """Plays, and does one thing after the other meanwhile."""

    def __init__(self, graph, folder, **options):
        self._graph, self._folder = graph, folder
        self._options = PlaybackOptions(topics=("css/voltages",), stay=True, **options)
        self._client = graph.node("hands").create_client(Seek, "player/seek")
        self._pending = None
        self.answers = []
        self.player: Any = None

    def seek(self, stamp_ns):
        """Asks; the answer is appended when it is there."""
        assert self._client.wait_for_service(10.0)
        request = Seek.Request()
        request.time.sec, request.time.nanosec = divmod(stamp_ns, 1_000_000_000)
        future = self._client.call_async(request)

        def answered():
            if future.done():
                self.answers.append((future.result().success, future.result().message))
            return future.done()

        return answered

    def run(self, *steps):
        """Steps: what to do, which gives a condition to wait for, or None."""
        waiting: list[Any] = []
        left = list(steps)

        def listen():
            if waiting and not waiting[0]():
                return
            waiting.clear()
            if left:
                condition = left.pop(0)()
                waiting.append(condition or (lambda: True))

        with BagReader(self._folder) as reader:
            self.player = self._graph.add(PlayerNode(reader, self._options, **self._graph.options))
            return self.player.play(self._graph.executor, lambda: not left and not waiting, listen)


def test_forward_back_and_from_the_end(flight, tmp_path, graph, heard):
    folder = flight.record(tmp_path / "bag", 100)
    stamps = [stamp for topic, stamp, _ in flight.messages(100) if topic == "/css/voltages"]
    playing = Playing(graph, folder, rate=1e-6)
    playing.run(
        lambda: lambda: len(heard) == 1,
        lambda: playing.seek(stamps[90]),
        lambda: lambda: len(heard) == 2,
        lambda: playing.seek(stamps[10]),
        lambda: lambda: len(heard) == 3,
        lambda: playing.player.set_parameters([Parameter("rate", value=float("inf"))]) and None,
        lambda: lambda: heard[-1] == stamps[-1],
        lambda: playing.seek(stamps[97]),
        lambda: lambda: heard[-4:] == [stamps[-1], *stamps[97:]],
    )
    assert heard == [stamps[0], stamps[90], *stamps[10:], *stamps[97:]]
    assert playing.answers == 3 * [(True, "")]


def test_held_it_shows_the_instant_and_stands(flight, tmp_path, graph, heard):
    folder = flight.record(tmp_path / "bag", 100)
    stamps = [stamp for topic, stamp, _ in flight.messages(100) if topic == "/css/voltages"]
    playing = Playing(graph, folder, rate=float("inf"), paused=True)
    playing.run(
        lambda: playing.seek(stamps[50]),
        lambda: lambda: len(heard) == 1,
        lambda: playing.seek(stamps[20] - 1),
        lambda: lambda: len(heard) == 2,
        lambda: playing.player.pace.resume(),
        lambda: lambda: heard[-1] == stamps[-1],
    )
    assert heard == [stamps[50], stamps[20], *stamps[21:]]


def test_what_is_not_in_the_recording_is_refused_with_what_is(flight, tmp_path, graph, heard):
    folder = flight.record(tmp_path / "bag", 10)
    with BagReader(folder) as reader:
        first, last = reader.start_ns, reader.end_ns
    playing = Playing(graph, folder, rate=1e-6)
    playing.run(lambda: playing.seek(first - 1), lambda: playing.seek(last + 1), lambda: playing.seek(last))
    expected = f"expected a stamp from {first} to {last} ns"
    assert playing.answers == [
        (False, f"time: {first - 1} ns given, {expected}"),
        (False, f"time: {last + 1} ns given, {expected}"),
        (True, ""),
    ]
