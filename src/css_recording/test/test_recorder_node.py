# SPDX-License-Identifier: Apache-2.0
"""The recorder among live nodes, and as a process of its own."""

import json
import signal
import subprocess
import sys
from types import SimpleNamespace

import pytest
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import String

from css_common.qos import LOOP_PUBLISHER
from css_msgs.msg import CssVoltages
from css_recording.bag_reader import BagReader
from css_recording.errors import BagError
from css_recording.nodes import recorder as command
from css_recording.recorder import RecorderNode

BEST_EFFORT = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT, durability=DurabilityPolicy.VOLATILE)


def contents(folder):
    with BagReader(folder) as reader:
        return [(m.topic, m.stamp_ns, m.data) for m in reader.messages()]


def voltages_of(flight, steps):
    return [message for message in flight.messages(steps) if message[0] == "/css/voltages"]


def record(graph, folder, *topics, **options):
    return graph.add(RecorderNode(None, folder, topics, **options, **graph.options))


@pytest.mark.parametrize("qos", [LOOP_PUBLISHER, BEST_EFFORT, QoSProfile(depth=10)], ids=["loop", "best", "default"])
def test_every_message_of_a_publisher_is_recorded_whatever_it_offers(flight, tmp_path, graph, qos):
    recorder = record(graph, tmp_path / "bag", "css/voltages")
    publisher = graph.node("driver").create_publisher(CssVoltages, "css/voltages", qos)
    graph.spin_until(lambda: recorder.ready)
    for number, (_, _, data) in enumerate(voltages_of(flight, 300), start=1):
        publisher.publish(data)
        graph.spin_until(lambda number=number: recorder.message_count >= number)
    recorder.close()
    recorder.close()
    assert contents(tmp_path / "bag") == voltages_of(flight, 300)
    assert recorder.failure == ""
    with BagReader(tmp_path / "bag") as reader:
        offered = {entry.topic.name: entry.topic.qos for entry in reader.topics}["/css/voltages"]
    best_effort = qos.reliability == ReliabilityPolicy.BEST_EFFORT
    assert offered[0].reliability == ("best_effort" if best_effort else "reliable")


def test_what_was_published_before_the_recorder_came_is_still_had_from_the_loop(flight, tmp_path, graph):
    publisher = graph.node("driver").create_publisher(CssVoltages, "css/voltages", LOOP_PUBLISHER)
    for _, _, data in voltages_of(flight, 50):
        publisher.publish(data)
    recorder = record(graph, tmp_path / "bag", "css/voltages")
    graph.spin_until(lambda: recorder.message_count == 50)
    recorder.close()
    assert contents(tmp_path / "bag") == voltages_of(flight, 50)


def test_the_plant_is_heard_last_so_that_it_waits_for_the_recorder(tmp_path, graph):
    from css_common.mission import default_mission

    mission = default_mission()
    plant = graph.node("plant")
    plant_topics = {output.topic for output in mission.plant.outputs}
    of_the_plant = [
        plant.create_publisher(output.message_type, topic, LOOP_PUBLISHER)
        for topic, output in mission.outputs.items()
        if topic in plant_topics
    ]
    recorder = graph.add(RecorderNode(mission, tmp_path / "bag", **graph.options))
    others = [(topic, output) for topic, output in mission.outputs.items() if topic not in plant_topics]
    sensors = graph.node("sensors")
    heard = [sensors.create_publisher(output.message_type, topic, LOOP_PUBLISHER) for topic, output in others[:-1]]
    graph.spin_until(lambda: all(publisher.get_subscription_count() == 1 for publisher in heard))
    assert not recorder.ready
    assert [publisher.get_subscription_count() for publisher in of_the_plant] == [0] * len(of_the_plant)
    topic, output = others[-1]
    sensors.create_publisher(output.message_type, topic, LOOP_PUBLISHER)
    graph.spin_until(lambda: recorder.ready)
    graph.spin_until(lambda: all(publisher.get_subscription_count() == 1 for publisher in of_the_plant))
    recorder.close()
    with BagReader(tmp_path / "bag") as reader:
        assert [entry.topic.name for entry in reader.topics] == [
            *(f"/{topic}" for topic in mission.outputs),
            "/parameter_events",
        ]
        assert reader.mission_text == mission.text()
        assert reader.description["numba"]


def test_everything_that_appears_is_recorded(flight, tmp_path, graph):
    recorder = record(graph, tmp_path / "bag", everything=True)
    node = graph.node("late")
    voltages = node.create_publisher(CssVoltages, "css/voltages", LOOP_PUBLISHER)
    text = node.create_publisher(String, "text", LOOP_PUBLISHER)
    graph.spin_until(lambda: voltages.get_subscription_count() == text.get_subscription_count() == 1)
    voltages.publish(voltages_of(flight, 1)[0][2])
    graph.spin_until(lambda: recorder.message_count == 1)
    text.publish(String(data="hello"))
    graph.spin_until(lambda: recorder.message_count == 2)
    recorder.close()
    seen = contents(tmp_path / "bag")
    assert [(topic, stamp) for topic, stamp, _ in seen] == [
        ("/css/voltages", voltages_of(flight, 1)[0][1]),
        ("/text", voltages_of(flight, 1)[0][1]),
    ]
    with BagReader(tmp_path / "bag") as reader:
        assert {entry.topic.name for entry in reader.topics}.isdisjoint({"/rosout", "/clock"})


def test_parameter_changes_are_recorded_and_first_values_are_not(flight, tmp_path, graph):
    recorder = record(graph, tmp_path / "bag", "css/voltages")
    node = graph.node("tuned")
    publisher = node.create_publisher(CssVoltages, "css/voltages", LOOP_PUBLISHER)
    graph.spin_until(lambda: recorder.ready and node.count_subscribers("/parameter_events") > 0)
    publisher.publish(voltages_of(flight, 1)[0][2])
    graph.spin_until(lambda: recorder.message_count == 1)
    node.declare_parameter("gain", 1.0)
    node.set_parameters([Parameter("gain", value=2.0)])
    graph.spin_until(lambda: recorder.counts["/parameter_events"] == 1)
    recorder.close()
    (event,) = [message for message in contents(tmp_path / "bag") if message[0] == "/parameter_events"]
    assert event[1] == voltages_of(flight, 1)[0][1]
    assert b"gain" in event[2]


def test_a_recording_that_cannot_be_created_is_refused(flight, tmp_path, graph):
    flight.record(tmp_path / "bag", 3)
    with pytest.raises(BagError, match="not empty"):
        RecorderNode(None, tmp_path / "bag", ["css/voltages"], **graph.options)
    record(graph, tmp_path / "bag", "css/voltages", overwrite=True).close()


def test_a_failing_disk_ends_the_recording_and_not_the_process(flight, tmp_path, graph, monkeypatch):
    recorder = record(graph, tmp_path / "bag", "css/voltages")
    publisher = graph.node("driver").create_publisher(CssVoltages, "css/voltages", LOOP_PUBLISHER)
    graph.spin_until(lambda: recorder.ready)

    def refuse(*arguments):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("css_recording.mcap_output.McapOutput.write_chunk", refuse)
    for _, _, data in voltages_of(flight, 30):
        publisher.publish(data)
    graph.spin_until(lambda: bool(recorder.failure))
    recorder.close()
    assert "No space left on device" in recorder.failure


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_recorder_process_finishes_its_recording_when_told_to_end(flight, tmp_path, graph, number, doctor):
    folder, figures = tmp_path / "bag", tmp_path / "figures.json"
    arguments = ["--topic", "css/voltages", "-o", str(folder), "--summary", str(figures)]
    process = subprocess.Popen([sys.executable, "-m", "css_recording.nodes.recorder", *arguments])
    try:
        publisher = graph.node("driver").create_publisher(CssVoltages, "css/voltages", LOOP_PUBLISHER)
        graph.spin_until(lambda: publisher.get_subscription_count() == 1)
        for _, _, data in voltages_of(flight, 80):
            publisher.publish(data)
        # no waiting: what is on its way when the signal comes is taken
        process.send_signal(number)
        process.send_signal(number)
        assert process.wait(30) == 0
    finally:
        process.kill()
    assert contents(folder) == voltages_of(flight, 80)
    doctor(folder / "bag_0.mcap")
    assert json.loads(figures.read_text())["recorded"]["/css/voltages"] == 80


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["-o", "bag"], 1, "not empty"),
        (["--mission", "nowhere.yaml"], 2, "no such mission"),
        (["--nonsense"], 2, "usage"),
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
