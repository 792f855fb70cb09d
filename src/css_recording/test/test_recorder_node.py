# SPDX-License-Identifier: Apache-2.0
"""The recorder among live nodes, and as a process of its own."""

import json
import signal
import subprocess
from types import SimpleNamespace

import pytest
from presence import present
from rclpy.context import Context
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import String

from css_common.qos import LOOP_PUBLISHER
from css_common.testing import DEADLINE, installed
from css_msgs.msg import CssVoltages
from css_recording.bag_reader import BagReader
from css_recording.errors import BagError
from css_recording.nodes import recorder as command
from css_recording.recorder import RecorderNode
from css_recording.recording_choice import Excluded, RecordingChoice

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
    from css_common.mission import load_mission

    mission = load_mission("okeefe_2013")
    plant = graph.node("plant")
    plant_topics = {output.topic for output in present(mission.plant).outputs}
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


@pytest.mark.parametrize(
    ("options", "name"),
    [({}, "/craft/logger"), ({"use_global_arguments": False}, "/recorder")],
    ids=["alone", "composed"],
)
def test_names_of_the_command_line_are_those_of_a_recorder_with_a_process_of_its_own(tmp_path, options, name):
    context = Context()
    context.init(args=["--ros-args", "-r", "__ns:=/craft", "-r", "__node:=logger"])
    recorder = RecorderNode(None, tmp_path / "bag", ["css/voltages"], context=context, **options)
    assert recorder.get_fully_qualified_name() == name
    recorder.close()
    recorder.destroy_node()
    context.try_shutdown()


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
    process = subprocess.Popen([installed("css_recording", "recorder"), *arguments])
    try:
        publisher = graph.node("driver").create_publisher(CssVoltages, "css/voltages", LOOP_PUBLISHER)
        graph.spin_until(lambda: publisher.get_subscription_count() == 1)
        for _, _, data in voltages_of(flight, 80):
            publisher.publish(data)
        # no waiting: what is on its way when the signal comes is taken
        process.send_signal(number)
        process.send_signal(number)
        assert process.wait(DEADLINE) == 0
    finally:
        process.kill()
    assert contents(folder) == voltages_of(flight, 80)
    doctor(folder / "bag_0.mcap")
    assert json.loads(figures.read_text())["recorded"]["/css/voltages"] == 80


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["-o", "bag"], 2, "not empty"),
        (["--mission", "nowhere.yaml"], 2, "no such mission"),
        (["--nonsense"], 2, "unrecognized arguments: --nonsense"),
        (["-o", "b", "--exclude", "("], 2, "--exclude (: is neither a topic nor a regular expression"),
        (["-o", "b", "--topic", "a", "--exclude", "^/a"], 2, "--topic a: is excluded by --exclude"),
        (["-o", "b", "--max-bag-size", "0"], 2, "--max-bag-size: 0 given, expected bytes from 1 on"),
        (["-o", "b", "--max-bag-duration", "nan"], 2, "--max-bag-duration: nan given, expected a number above 0"),
        (["-o", "b", "--qos-profile-overrides-path", "q.yaml"], 2, "q.yaml: cannot be read"),
        (["-o", "b", "--topic", "nobody"], 1, "/nobody was named with --topic and never appeared"),
    ],
)
def test_command_says_what_is_wrong(flight, tmp_path, monkeypatch, capfd, arguments, code, words):
    flight.record(tmp_path / "bag", 1)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(command, "StopSignal", lambda: SimpleNamespace(came=True))
    try:
        assert command.main(arguments) == code
    except SystemExit as exit_info:
        assert exit_info.code == code
    said = capfd.readouterr().err
    assert words in said
    assert said.count("recorder: error: ") == 1


def test_what_is_excluded_is_left_out(flight, tmp_path, graph):
    choice = RecordingChoice(Excluded(["gyro/imu", "^/debug/"]))
    recorder = record(graph, tmp_path / "bag", everything=True, choice=choice)
    node = graph.node("driver")
    names = ("css/voltages", "gyro/imu", "gyro/imu_raw", "debug/voltages", "own/debug/voltages")
    publishers = {name: node.create_publisher(CssVoltages, name, LOOP_PUBLISHER) for name in names}
    wanted = {"css/voltages", "gyro/imu_raw", "own/debug/voltages"}
    graph.spin_until(lambda: all(publishers[name].get_subscription_count() for name in wanted))
    for publisher in publishers.values():
        publisher.publish(voltages_of(flight, 1)[0][2])
    graph.spin_until(lambda: recorder.message_count == 3)
    recorder.close()
    assert {topic for topic, _, _ in contents(tmp_path / "bag")} == {f"/{name}" for name in wanted}


def test_a_mission_is_recorded_without_what_is_excluded(tmp_path, graph):
    from css_common.mission import load_mission

    mission = load_mission("okeefe_2013")
    recorder = graph.add(
        RecorderNode(mission, tmp_path / "bag", choice=RecordingChoice(Excluded(["truth"])), **graph.options)
    )
    recorder.close()
    assert sorted(recorder.never_appeared) == sorted(f"/{topic}" for topic in mission.outputs if topic != "truth")
    with BagReader(tmp_path / "bag") as reader:
        assert "/truth" not in {entry.topic.name for entry in reader.topics}


def test_quality_of_service_is_what_the_user_says(tmp_path, graph):
    # what is offered is reliable; the recorder asks for less
    recorder = record(
        graph, tmp_path / "bag", "css/voltages", choice=RecordingChoice(qos={"/css/voltages": BEST_EFFORT})
    )
    node = graph.node("driver")
    node.create_publisher(CssVoltages, "css/voltages", LOOP_PUBLISHER)
    graph.spin_until(lambda: recorder.ready and bool(node.get_subscriptions_info_by_topic("/css/voltages")))
    (endpoint,) = node.get_subscriptions_info_by_topic("/css/voltages")
    assert endpoint.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT
    recorder.close()


def test_command_splits_and_says_what_never_came(flight, tmp_path, graph):
    folder = tmp_path / "bag"
    arguments = ["--topic", "css/voltages", "--topic", "nobody", "-o", str(folder), "--max-bag-duration", "3", "--json"]
    process = subprocess.Popen(
        [installed("css_recording", "recorder"), *arguments],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        publisher = graph.node("driver").create_publisher(CssVoltages, "css/voltages", LOOP_PUBLISHER)
        graph.spin_until(lambda: publisher.get_subscription_count() == 1)
        for _, _, data in voltages_of(flight, 80):
            publisher.publish(data)
        process.send_signal(signal.SIGINT)
        output, errors = process.communicate(timeout=DEADLINE)
    finally:
        process.kill()
    assert process.returncode == 1
    assert errors.splitlines()[-1] == "recorder: error: /nobody was named with --topic and never appeared"
    result = json.loads(output.splitlines()[-1])
    assert result["never_appeared"] == ["/nobody"]
    assert result["recorded"]["/css/voltages"] == 80
    assert sorted(path.name for path in folder.glob("*.mcap")) == ["bag_0.mcap", "bag_1.mcap", "bag_2.mcap"]
    assert contents(folder) == voltages_of(flight, 80)


def test_a_recording_of_nothing_says_so(tmp_path, monkeypatch, capfd):
    monkeypatch.setattr(command, "StopSignal", lambda: SimpleNamespace(came=True))
    assert command.main(["-o", str(tmp_path / "bag"), "--exclude", "."]) == 0
    assert f"{tmp_path}/bag: no messages" in capfd.readouterr().out
