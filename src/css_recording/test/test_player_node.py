# SPDX-License-Identifier: Apache-2.0
"""The player among live nodes, and as a process of its own."""

import signal
import subprocess
from types import SimpleNamespace
from typing import Any

import pytest
from presence import present
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu

from css_common.codec import codec_of, stamp_of
from css_common.qos import LOOP_PUBLISHER, LOOP_SUBSCRIPTION, RECORDER_SUBSCRIPTION
from css_common.testing import DEADLINE, installed
from css_msgs.msg import CssVoltages, SunEstimate
from css_recording.bag_reader import BagReader
from css_recording.errors import BagError
from css_recording.nodes import player as command
from css_recording.playback import PlaybackError, PlaybackOptions
from css_recording.player import PlayerNode


def voltages_of(flight, steps):
    return [message for message in flight.messages(steps) if message[0] == "/css/voltages"]


class Listener:
    """Keeps all that it hears on a topic."""

    def __init__(self, node, message_type, topic):
        self.heard: list[Any] = []
        node.create_subscription(message_type, topic, self.heard.append, RECORDER_SUBSCRIPTION, raw=True)


def play(graph, folder, options, remap=None, stopped=lambda: False):
    with BagReader(folder, remap) as reader:
        player = graph.add(PlayerNode(reader, options, **graph.options))
        return player.play(graph.executor, stopped)


def test_what_is_played_are_the_bytes_that_were_recorded(flight, tmp_path, graph):
    folder = flight.record(tmp_path / "bag", 40)
    node = graph.node("listener")
    voltages, imu = Listener(node, CssVoltages, "css/voltages"), Listener(node, Imu, "gyro/imu")
    report = play(graph, folder, PlaybackOptions(rate=200.0))
    graph.spin_until(lambda: len(voltages.heard) == len(imu.heard) == 40)
    assert voltages.heard == [data for _, _, data in voltages_of(flight, 40)]
    assert report.published == {"/css/voltages": 40, "/gyro/imu": 40, "/wheels/torque_command": 40}
    assert report.stamps == 40


def test_the_rate_holds_back(flight, tmp_path, graph):
    # by a wall clock that advances a tenth of a second each time it is looked at
    readings: list[Any] = []

    def now():
        readings.append(0.1 * len(readings))
        return readings[-1]

    folder = flight.record(tmp_path / "bag", 11)
    played_at = []

    class Noted(PlayerNode):
        def _publish_group(self, stamp_ns, messages):
            played_at.append(readings[-1])
            return super()._publish_group(stamp_ns, messages)

    with BagReader(folder) as reader:
        graph.add(Noted(reader, PlaybackOptions(rate=0.25), now=now, **graph.options)).play(graph.executor)
    # ten steps of 0.1 s at a quarter of the pace, each at most a few looks late
    for step, at in enumerate(played_at):
        assert 0.4 * step <= at <= 0.4 * step + 0.8


def test_what_a_live_node_publishes_is_left_to_it(flight, tmp_path, graph):
    folder = flight.record(tmp_path / "bag", 5)
    node = graph.node("driver")
    node.create_publisher(Imu, "gyro/imu", LOOP_PUBLISHER)
    voltages, imu = Listener(node, CssVoltages, "css/voltages"), Listener(node, Imu, "gyro/imu")
    report = play(graph, folder, PlaybackOptions(rate=1000.0))
    graph.spin_until(lambda: len(voltages.heard) == 5)
    assert report.left_to_live_nodes == ["/gyro/imu"]
    assert report.published["/css/voltages"] == 5
    assert imu.heard == []


def estimator(graph, late_every=0):
    """A node that answers each voltages message with an estimate of the same stamp, now and then late."""
    node = graph.node("estimator")
    codec = codec_of(SunEstimate)
    publisher = node.create_publisher(SunEstimate, "live/sun_estimate", LOOP_PUBLISHER)
    seen: list[Any] = []
    late: list[Any] = []

    def answer():
        publisher.publish(codec.encode(codec.sample(seen[-1], "bus")))

    def take(data):
        seen.append(stamp_of(data))
        if late_every and len(seen) % late_every == 0:
            late.append(seen[-1])
        else:
            answer()

    def answer_late():
        if late:
            late.clear()
            answer()

    node.create_subscription(CssVoltages, "css/voltages", take, LOOP_SUBSCRIPTION, raw=True)
    node.create_timer(0.02, answer_late)
    return seen


def test_lockstep_loses_nothing_however_slow_the_answers(flight, tmp_path, graph):
    # 500 stamps through queues of 10 messages: without waiting most would be lost
    folder = flight.record(tmp_path / "bag", 500)
    seen = estimator(graph, late_every=50)
    options = PlaybackOptions(rate=float("inf"), wait_for=("live/sun_estimate",))
    report = play(graph, folder, options)
    assert report.stamps == 500
    assert seen == [stamp for _, stamp, _ in voltages_of(flight, 500)]


def test_lockstep_names_who_is_absent_or_silent(flight, tmp_path, graph):
    folder = flight.record(tmp_path / "bag", 5)
    impatient = PlaybackOptions(rate=float("inf"), wait_for=("live/sun_estimate",), patience=0.5)
    with pytest.raises(PlaybackError, match=r"no live node publishes /live/sun_estimate after 0\.5 s"):
        play(graph, folder, impatient)
    silent = graph.node("silent")
    silent.create_publisher(SunEstimate, "live/sun_estimate", LOOP_PUBLISHER)
    Listener(silent, CssVoltages, "css/voltages")
    with pytest.raises(PlaybackError, match=r"no answer to stamp .* on /live/sun_estimate after 0\.5 s"):
        play(graph, folder, impatient)


def test_span_topics_renaming_and_clock(flight, tmp_path, graph):
    folder = flight.record(tmp_path / "bag", 30)
    node = graph.node("listener")
    voltages = Listener(node, CssVoltages, "cells")
    clock = []
    node.create_subscription(Clock, "/clock", lambda m: clock.append(m.clock.sec * 10**9 + m.clock.nanosec), 100)
    options = PlaybackOptions(rate=100.0, start=1.0, end=2.0, topics=("cells",), clock=True)
    report = play(graph, folder, options, remap={"css/voltages": "cells"})
    graph.spin_until(lambda: len(voltages.heard) == 10 and len(clock) == 10)
    expected = voltages_of(flight, 30)[10:20]
    assert voltages.heard == [data for _, _, data in expected]
    assert clock == [stamp for _, stamp, _ in expected]
    assert report.published == {"/cells": 10}


def test_playback_stops_when_asked(flight, tmp_path, graph):
    folder = flight.record(tmp_path / "bag", 600)
    voltages = Listener(graph.node("listener"), CssVoltages, "css/voltages")
    report = play(graph, folder, PlaybackOptions(rate=10.0), stopped=lambda: len(voltages.heard) >= 5)
    assert 5 <= report.stamps < 600


def test_unknown_topics_are_refused(flight, tmp_path, graph):
    folder = flight.record(tmp_path / "bag", 3)
    for options in (PlaybackOptions(topics=("nonesuch",)), PlaybackOptions(pace="nonesuch")):
        with pytest.raises(BagError, match="no topic /nonesuch"):
            play(graph, folder, options)


def test_player_process_loops_until_told_to_end(flight, tmp_path, graph):
    folder = flight.record(tmp_path / "bag", 10)
    voltages = Listener(graph.node("listener"), CssVoltages, "css/voltages")
    arguments = [str(folder), "--rate", "20", "--loop"]
    process = subprocess.Popen([installed("css_recording", "player"), *arguments], stdout=subprocess.PIPE, text=True)
    try:
        graph.spin_until(lambda: len(voltages.heard) > 25)
        process.send_signal(signal.SIGINT)
        assert process.wait(DEADLINE) == 0
    finally:
        process.kill()
    assert "messages of" in present(process.stdout).read()
    # wherever it was when the listener was found, from there on nothing is missing
    once = [data for _, _, data in voltages_of(flight, 10)]
    first = once.index(voltages.heard[0])
    assert voltages.heard == [once[(first + number) % 10] for number in range(len(voltages.heard))]


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["nowhere"], 2, "no such recording"),
        (["bag", "--remap", "a"], 2, "expected OLD:=NEW"),
        (["bag", "--remap", "a:=b"], 2, "no topic /a to rename"),
        (["bag", "--rate", "-1"], 2, "--rate"),
        ([], 2, "required: recording"),
    ],
)
def test_command_says_what_is_wrong(flight, tmp_path, monkeypatch, capsys, arguments, code, words):
    flight.record(tmp_path / "bag", 1)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(command, "StopSignal", lambda: SimpleNamespace(came=True))
    try:
        assert command.main(arguments) == code
    except SystemExit as exit_info:
        assert exit_info.code == code
    assert words in capsys.readouterr().err
