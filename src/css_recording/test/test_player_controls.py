# SPDX-License-Identifier: Apache-2.0
"""A playback that is held, stepped and made faster: by services, a parameter and keys."""

import json
import os
import pty
import signal
import subprocess
import sys
import termios
from types import SimpleNamespace
from typing import Any

import pytest
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_srvs.srv import Trigger

from css_common import pace_controls
from css_common.qos import LOOP_PUBLISHER, RECORDER_SUBSCRIPTION
from css_common.testing import DEADLINE, installed
from css_msgs.msg import CssVoltages, WheelTorqueCommand
from css_recording.bag_reader import BagReader
from css_recording.bag_writer import BagWriter
from css_recording.errors import BagError
from css_recording.nodes import player as command
from css_recording.playback import PlaybackError, PlaybackOptions
from css_recording.player import PlayerNode


class Hands:
    """Calls services of the player while it plays, one thing after the other."""

    def __init__(self, graph, node, steps):
        self._node = node
        self._clients = {}
        self._steps = iter(steps)
        self._waiting = None
        self.answers = []
        self.done = False

    def call(self, name):
        """Answer of a service, when it is there."""
        client = self._clients.setdefault(name, self._node.create_client(Trigger, f"player/{name}"))
        assert client.wait_for_service(10.0)
        return client.call_async(Trigger.Request())

    def listen(self):
        """Does the next thing when the last one is done: a service to call, or a condition to wait for."""
        if self._waiting is not None:
            finished = self._waiting() if callable(self._waiting) else self._waiting.done()
            if not finished:
                return
            if not callable(self._waiting):
                self.answers.append((self._waiting.result().success, self._waiting.result().message))
        step = next(self._steps, None)
        self.done = step is None
        self._waiting = self.call(step) if isinstance(step, str) else step or (lambda: True)


@pytest.fixture
def heard(graph):
    """What is heard of the voltages and the torques, in one list."""
    messages: list[Any] = []
    node = graph.node("listener")
    for kind, topic in ((CssVoltages, "css/voltages"), (WheelTorqueCommand, "wheels/torque_command")):
        node.create_subscription(kind, topic, messages.append, RECORDER_SUBSCRIPTION, raw=True)
    return messages


def play(graph, folder, options, steps):
    with BagReader(folder) as reader:
        player = graph.add(PlayerNode(reader, options, **graph.options))
        hands = Hands(graph, graph.node("hands"), steps)
        report = player.play(graph.executor, lambda: hands.done, hands.listen)
    return report, hands.answers


def test_held_from_the_start_and_stepped_by_message_and_by_stamp(flight, tmp_path, graph, heard):
    folder = flight.record(tmp_path / "bag", 50)
    expected = [data for topic, _, data in flight.messages(3) if topic != "/gyro/imu"]
    counts = []

    def exactly(number):
        """That so many are heard; what would come too much is seen in the end."""

        def reached():
            if len(heard) < number:
                return False
            counts.append(len(heard))
            return True

        return reached

    options = PlaybackOptions(rate=1e-6, paused=True, topics=("css/voltages", "wheels/torque_command"))
    steps = ["is_paused", "play_next", exactly(1), "play_next", exactly(2), "play_next", exactly(3)]
    # the third message was the first of its stamp: the rest of the stamp follows
    steps += ["play_next_stamp", exactly(4), "play_next_stamp", exactly(6), "is_paused"]
    steps += ["resume", "play_next", "is_paused"]
    report, answers = play(graph, folder, options, steps)
    assert heard == expected
    assert counts == [1, 2, 3, 4, 6]
    one, stamp = (True, "one message"), (True, "one stamp")
    refused = (False, "not paused: pause first")
    paused, playing = (True, "paused: True"), (True, "paused: False")
    assert answers == [paused, one, one, one, stamp, stamp, paused, (True, "playing"), refused, playing]
    assert report.published == {"/css/voltages": 3, "/wheels/torque_command": 3}


def test_paused_in_flight_it_stays_until_it_is_let_go(flight, tmp_path, graph, heard):
    folder = flight.record(tmp_path / "bag", 600)
    options = PlaybackOptions(rate=10.0, topics=("css/voltages",))
    steps = [lambda: len(heard) > 2, "toggle_paused", "is_paused"]
    report, answers = play(graph, folder, options, steps)
    assert answers == [(True, "paused"), (True, "paused: True")]
    assert report.stopped  # a playback that is held can be ended
    assert report.stamps < 600


def test_the_rate_is_a_parameter(flight, tmp_path, graph, heard):
    folder = flight.record(tmp_path / "bag", 500)
    with BagReader(folder) as reader:
        options = PlaybackOptions(rate=1e-6, topics=("css/voltages",))
        player = graph.add(PlayerNode(reader, options, **graph.options))
        results: list[Any] = []

        def hurry():
            if len(heard) == 1 and not results:
                for rate in (0.0, -1.0, float("nan"), float("inf")):
                    results.extend(player.set_parameters([Parameter("rate", value=rate)]))

        player.play(graph.executor, listen=hurry)
        assert [r.successful for r in results] == [False, False, False, True]
        assert results[0].reason == "rate: 0.0 given, expected a number above 0"
        assert player.get_parameter("rate").value == float("inf")
    graph.spin_until(lambda: len(heard) == 500)


def test_keys_change_the_rate_by_a_tenth(flight, tmp_path, graph):
    with BagReader(flight.record(tmp_path / "bag", 2)) as reader:
        player = graph.add(PlayerNode(reader, PlaybackOptions(rate=2.0), **graph.options))
        for key in ("up", "down", "down", "x"):
            player.controls.press(key)
        assert player.get_parameter("rate").value == pytest.approx(2.0 / 1.1)


def test_types_of_rosbag2_are_used_where_they_are_installed(flight, tmp_path, graph, monkeypatch):
    # the services are made with these types, so what answers must fill their fields
    class Response(SimpleNamespace):
        def get_fields_and_field_types(self):
            return dict.fromkeys(vars(self))

    made = {}
    with BagReader(flight.record(tmp_path / "bag", 2)) as reader:
        player = graph.add(PlayerNode(reader, PlaybackOptions(), **graph.options))
        monkeypatch.setattr(pace_controls, "rosbag2_service", lambda name: name)
        node: Any = SimpleNamespace(
            create_service=lambda kind, name, serve: made.update({name: (kind, serve)}),
            declare_parameter=lambda name, value, _: SimpleNamespace(value=value),
            add_on_set_parameters_callback=lambda _: None,
            set_parameters=player.set_parameters,
        )
        pace_controls.PaceControls(node, player.pace, player.pace.grant_message)
    kinds = {name: kind for name, (kind, _) in made.items()}
    assert kinds["~/pause"] == "Pause" and kinds["~/set_rate"] == "SetRate"
    assert made["~/pause"][1](None, Response()) == Response()
    assert made["~/is_paused"][1](None, Response(paused=False)).paused
    assert made["~/play_next"][1](None, Response(success=False)).success
    assert made["~/set_rate"][1](SimpleNamespace(rate=3.0), Response(success=False)).success
    assert made["~/get_rate"][1](None, Response(rate=0.0)).rate == 3.0
    assert not made["~/set_rate"][1](SimpleNamespace(rate=-3.0), Response(success=True)).success


def test_quality_of_service_is_what_the_user_says(flight, tmp_path, graph):
    folder = flight.record(tmp_path / "bag", 3)
    weak = QoSProfile(depth=3, reliability=ReliabilityPolicy.BEST_EFFORT, durability=DurabilityPolicy.VOLATILE)
    offered = []

    def look():
        offered.extend(graph.nodes[-1].get_publishers_info_by_topic("/css/voltages"))

    with BagReader(folder) as reader:
        options = PlaybackOptions(rate=100.0, qos={"/css/voltages": weak})
        graph.add(PlayerNode(reader, options, **graph.options)).play(graph.executor, listen=look)
    assert offered[-1].qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT
    assert offered[-1].qos_profile.durability == DurabilityPolicy.VOLATILE


def test_a_loop_with_nothing_left_to_play_ends(flight, tmp_path, graph):
    folder = flight.record(tmp_path / "bag", 3)
    graph.node("driver").create_publisher(CssVoltages, "css/voltages", LOOP_PUBLISHER)
    options = PlaybackOptions(rate=100.0, loop=True, topics=("css/voltages",))
    with BagReader(folder) as reader:
        player = graph.add(PlayerNode(reader, options, **graph.options))
        with pytest.raises(PlaybackError, match="nothing to play: /css/voltages left to the nodes that publish"):
            player.play(graph.executor)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (PlaybackOptions(start=3.0), r"the start, 3 s, is past the end, 2\.9 s"),
        (PlaybackOptions(start=2.0, end=1.0), "the end, 1 s, is not after the start, 2 s"),
        (PlaybackOptions(start=2.91), "past the end"),
        (PlaybackOptions(topics=("late",), end=1.0), "no message of /late in the span"),
        (PlaybackOptions(topics=("css/voltage",)), "no topic /css/voltage; there are messages of /css/voltages, /late"),
    ],
)
def test_what_would_play_nothing_is_refused(flight, tmp_path, graph, options, words):
    voltages = flight.topics[0]
    with BagWriter(tmp_path / "bag", [voltages, voltages._replace(name="/late")]) as writer:
        for _, stamp_ns, data in [m for m in flight.messages(30) if m[0] == voltages.name]:
            writer.write(voltages.name, stamp_ns, data)
        writer.write("/late", stamp_ns, data)
    with BagReader(tmp_path / "bag") as reader, pytest.raises(BagError, match=words):
        PlayerNode(reader, options, **graph.options)


def test_an_empty_recording_is_refused(flight, tmp_path, graph):
    with BagReader(flight.record(tmp_path / "bag", 0)) as reader, pytest.raises(BagError, match="holds no messages"):
        PlayerNode(reader, PlaybackOptions(loop=True), **graph.options)


@pytest.mark.parametrize(
    "arguments",
    [
        ["--rate", "0"],
        ["--rate", "-1"],
        ["--rate", "-inf"],
        ["--rate", "nan"],
        ["--start", "nan"],
        ["--start", "-1"],
        ["--start", "inf"],
        ["--end", "nan"],
        ["--end", "-2"],
        ["--start", "2", "--end", "1"],
        ["--start", "50"],
        ["--loop", "--topic", "nonesuch"],
        ["--patience", "inf"],
        ["--qos-profile-overrides-path", "nowhere.yaml"],
        ["--ros-args", "-p", "rate:=-1.0"],
        ["--ros-args", "-p", "foo"],
    ],
)
def test_command_refuses_in_one_line(flight, tmp_path, monkeypatch, capsys, arguments):
    flight.record(tmp_path / "bag", 11)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(command, "StopSignal", lambda: SimpleNamespace(came=True))
    code: object
    try:
        code = command.main(["bag", *arguments])
    except SystemExit as exit_info:
        code = exit_info.code
    said = [line for line in capsys.readouterr().err.splitlines() if "] [rcl" not in line]
    assert code == 2
    assert len(said) == 1 and said[0].startswith("player: error: ")


def test_keys_on_a_terminal_hold_and_let_go(flight, tmp_path, graph, heard):
    folder = flight.record(tmp_path / "bag", 11)
    typist, terminal = pty.openpty()
    before = termios.tcgetattr(terminal)
    arguments = [str(folder), "--topic", "css/voltages", "--rate", "100", "--start-paused", "--json"]
    # the terminal is its own, as it is that of a program that a shell has started
    program = (
        "import fcntl, os, sys, termios; fcntl.ioctl(0, termios.TIOCSCTTY, 0); os.execv(sys.argv[1], sys.argv[1:])"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", program, installed("css_recording", "player"), *arguments],
        stdin=terminal, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip
    try:
        os.write(typist, b"\x1b[C")  # one message
        graph.spin_until(lambda: len(heard) == 1)
        os.write(typist, b"s")
        graph.spin_until(lambda: len(heard) == 2)
        os.write(typist, b" ")
        output, errors = process.communicate(timeout=DEADLINE)
        graph.spin_until(lambda: len(heard) == 11)
        assert process.returncode == 0, errors
        result = json.loads(output.splitlines()[-1])
        assert result["published"] == {"/css/voltages": 11}
        assert result["left_to_live_nodes"] == [] and not result["stopped"]
        assert termios.tcgetattr(terminal) == before
    finally:
        process.kill()
        os.close(typist)
        os.close(terminal)


def test_an_interrupt_ends_a_held_playback_cleanly(flight, tmp_path, graph, heard):
    folder = flight.record(tmp_path / "bag", 11)
    arguments = [str(installed("css_recording", "player")), str(folder), "--start-paused"]
    process = subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        node = graph.nodes[0]
        graph.spin_until(lambda: node.get_publishers_info_by_topic("/css/voltages"))
        process.send_signal(signal.SIGINT)
        output, errors = process.communicate(timeout=DEADLINE)
        assert process.returncode == 0, errors
        assert "0 messages of 0 stamps" in output
        assert "Traceback" not in errors
    finally:
        process.kill()
