# SPDX-License-Identifier: Apache-2.0
"""The process of a node, started as `ros2 run` starts it: help, bad command lines, signals, ends."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from rclpy.qos import qos_profile_sensor_data

from css_common import node_process
from css_common.codec import codec_of
from css_common.mission import find_component, mission_from_text
from css_common.node_arguments import USUAL_GRAPH
from css_common.node_process import mission_of_arguments
from css_common.stop_signal import StopSignal
from css_common.testing import DEADLINE, Bench
from css_msgs.msg import CssVoltages, SunEstimate

PROGRAM = (
    "import sys; from css_common import node_process; from css_common.mission import find_component;"
    "sys.exit(node_process.main(find_component('testbed', sys.argv[1]), sys.argv[2:]))"
)
WORKSPACE = Path(__file__).parent / "workspace"


class Process:
    """A node in a process of its own."""

    def __init__(self, name: str, *arguments: str, executor: str = "events") -> None:
        paths = f"{WORKSPACE}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"
        self.popen = subprocess.Popen(
            [sys.executable, "-c", PROGRAM, name, *arguments],
            env=os.environ | {"PYTHONPATH": paths, "SUNPOINT_EXECUTOR": executor},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def end(self) -> tuple[int, str, str]:
        """Exit code, output and error output, once it has ended."""
        out, err = self.popen.communicate(timeout=DEADLINE)
        return self.popen.returncode, out, err


@pytest.fixture
def start():
    """Starts processes and leaves none behind."""
    started: list[Process] = []

    def start(name: str, *arguments: str, **options) -> Process:
        started.append(Process(name, *arguments, **options))
        return started[-1]

    yield start
    for process in started:
        if process.popen.poll() is None:
            process.popen.kill()
            process.popen.communicate()


@pytest.fixture
def mission_file(tmp_path, mission_text):
    """The small mission as a file."""
    file = tmp_path / "bench.yaml"
    file.write_text(mission_text.replace("testbed/gyro, ", ""), encoding="utf-8")
    return str(file)


@pytest.fixture
def bench():
    """One bench is enough here."""
    with Bench() as bench:
        yield bench


def test_help_names_topics_and_parameters_and_starts_nothing(capsys):
    assert node_process.main(find_component("testbed", "estimator"), ["--help"]) == 0
    out = capsys.readouterr().out
    for line in (
        "ros2 run testbed estimator [--ros-args --params-file MISSION.yaml ...]",
        "Puts gain times the first voltage into the age of its estimate",
        "  voltages  css_msgs/msg/CssVoltages",
        "      frame_id: bus (io.body_frame; further ones: io.accepted_frames)",
        "      qos_overrides./voltages.subscription.{history,depth,reliability,durability}",
        "      qos_overrides./estimator/sun_estimate.publisher.{history,depth,reliability,durability}",
        "Exit code: 0 told to end, or the flight is over; 1 it failed; 2 something given is wrong",
        "  gyro/imu  sensor_msgs/msg/Imu  (optional)",
        "  estimator/sun_estimate  css_msgs/msg/SunEstimate",
        "  *gain = 1.0",
        "factor of the voltage; a number written with a point, at least 0 and at most 10",
        "   window = 4",
    ):
        assert line in out


BAD = {
    "value": (["-p", "gain:=11.0"], "estimator: error: gain: 11.0 given, expected at least 0 and at most 10"),
}


@pytest.mark.parametrize("bad", BAD)
def test_bad_command_lines_end_at_once_with_code_2(start, bad):
    arguments, reason = BAD[bad]
    code, out, err = start("estimator", "--ros-args", *arguments).end()
    assert code == 2
    assert reason in err
    assert "Traceback" not in err
    assert out == ""


LONG = "n" * 300
BAD_BEFORE_ROS = {
    "no assignment": (["-p", "gain"], "-p gain: expected KEY:=VALUE\n"),
    "no remapping": (["-r", "bad"], "-r bad: expected -r FROM:=TO, both names of topics, or -r __node"),
    "no name of a topic": (["-r", "voltages:=1x"], "-r voltages:=1x: expected -r FROM:=TO, both names of "),
    "no name of a node": (["-r", "__node:=a-b"], "-r __node:='a-b': expected at most 100 letters, digits"),
    "a long name": (["-r", f"__node:={LONG}"], "-r __node:='nnn"),
    "no namespace": (["-r", "__ns:=x"], "-r __ns:='x': expected at most 100 letters, digits and _"),
    "a long namespace": (["-r", f"__ns:=/{LONG}"], "-r __ns:='/nnn"),
    "unknown to ROS": (["-x"], "-x: unknown after --ros-args\n"),
    "nothing after a flag": (["--params-file"], "Couldn't parse trailing --params-file flag"),
    "unknown to the node": (["--", "--flag"], "'--flag': unknown, expected --help, --summary FILE or --ros"),
    "level of the log": (["--log-level", "bogus"], "Couldn't parse log level: '--log-level bogus'. Error: "),
    "mixed list": (["-p", "weights:=[1, 2.0]"], "-p weights:=[1, 2.0]: expected -p KEY:=VALUE, with the "),
    "wrong type": (["-p", "gain:=3"], "gain: 3 given, expected a number written with a point, at least 0"),
    "wrong together": (["-p", "floor:=3.0"], "floor: 3.0 given, expected at most the gain of 1.0\n"),
    "wrong type of ROS's own": (["-p", "use_sim_time:=3"], "Trying to set parameter 'use_sim_time' to '3'"),
    "depth of a queue": (
        ["-p", "qos_overrides./voltages.subscription.depth:=-1"],
        "qos_overrides./voltages.subscription.depth: -1 given, expected at least 1 and at most 1000000\n",
    ),
    "no file": (["--params-file", "/dev/zero"], "/dev/zero: cannot be read: expected a regular file\n"),
    "folder": (["--params-file", "."], ".: cannot be read: expected a regular file\n"),
    "name": (["-p", "gian:=1.0"], "gian: unknown; did you mean gain?\n"),
    "name for this node": (["-p", "estimator:gian:=1.0"], "gian: unknown; did you mean gain?\n"),
    "file": (["--params-file", "missing.yaml"], "missing.yaml: cannot be read: "),
    "content": (["--params-file", "bad.yaml"], "bad.yaml: /**: io.deadlin: unknown; did you mean io.deadl"),
}


@pytest.mark.parametrize("bad", BAD_BEFORE_ROS)
def test_what_is_refused_at_the_start_ends_with_one_line_and_code_2(bad, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    Path("bad.yaml").write_text("/**: {ros__parameters: {io: {deadlin: 1.0}}}\n")
    arguments, reason = BAD_BEFORE_ROS[bad]
    with StopSignal():  # restores the handlers that the end of the process takes
        assert node_process.main(find_component("testbed", "estimator"), ["--ros-args", *arguments]) == 2
    err = capfd.readouterr().err
    assert err.startswith(f"estimator: error: {reason}")
    assert err.count("\n") == 1


REFUSED_BY_ROS = {
    "long topic": ["-r", f"voltages:={LONG}"],
    "policy": ["-p", "qos_overrides./voltages.subscription.durability:=bogus"],
}


@pytest.mark.parametrize("kind", REFUSED_BY_ROS)
def test_topics_that_ros_does_not_make_are_one_line_and_code_2(start, kind):
    code, out, err = start("estimator", "--ros-args", *REFUSED_BY_ROS[kind]).end()
    assert (code, out, err.count("\n")) == (2, "", 1), err
    assert "[estimator]: voltages: " in err


def test_failure_of_a_component_at_the_start_is_code_1_and_a_refusal_code_2(start):
    failed, refused = (start("estimator", "--ros-args", "-p", f"fault:={kind}") for kind in ("configure", "refuse"))
    assert (failed.end()[0], refused.end()[0]) == (1, 2)


def test_quality_of_service_of_a_topic_that_the_node_has_not_is_remarked(start, bench):
    name = "qos_overrides./voltage.subscription.durability"
    process = start("estimator", "--ros-args", "-p", f"{name}:=volatile")
    remark = f"{name}: no topic of this node has it; did you mean qos_overrides./voltages.subscription.durability?"
    bench.until(lambda: bench.logged(remark), "the remark")
    process.popen.send_signal(signal.SIGINT)
    assert process.end()[0] == 0


@pytest.mark.parametrize("arguments", [["-p", "other:gian:=1.0"], ["-p", "use_sim_time:=true"], ["-p", "gain:=2.0"]])
def test_overrides_for_others_and_of_ros_itself_are_let_through(arguments):
    assert mission_of_arguments(find_component("testbed", "estimator"), ["--ros-args", *arguments]).nodes


@pytest.mark.parametrize(
    ("number", "executor"), [(signal.SIGINT, "events"), (signal.SIGTERM, "events"), (signal.SIGINT, "draining")]
)
def test_signals_end_a_node_cleanly(start, bench, mission_file, number, executor):
    process = start("estimator", "--ros-args", "--params-file", mission_file, executor=executor)
    bench.until(lambda: bench.node.count_publishers("estimator/sun_estimate") == 1, "the node is up")
    process.popen.send_signal(number)
    code, _, err = process.end()
    assert (code, "Traceback" in err) == (0, False), err


def test_second_interrupt_does_not_tear_the_clean_up_apart(start, bench, mission_file):
    process = start("estimator", "--ros-args", "--params-file", mission_file)
    bench.until(lambda: bench.node.count_publishers("estimator/sun_estimate") == 1, "the node is up")
    for _ in range(5):
        process.popen.send_signal(signal.SIGINT)
    code, _, err = process.end()
    assert (code, "Traceback" in err) == (0, False), err


def test_three_processes_fly_a_mission(start, bench, mission_file, tmp_path):
    estimates = bench.listen("estimator/sun_estimate", SunEstimate)
    arguments = ("--ros-args", "--params-file", mission_file)
    partners = [start(name, *arguments) for name in ("estimator", "controller")]
    plant = start("source", "--summary", str(tmp_path / "summary.json"), *arguments)
    bench.until(lambda: plant.popen.poll() is not None, "the plant ends by itself")
    code, _, err = plant.end()
    assert code == 0, err
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["counters"]["cycles"] == 10
    bench.until(lambda: len(estimates) == 10, "all estimates")
    for partner in partners:
        partner.popen.send_signal(signal.SIGINT)
        assert partner.end()[0] == 0


def test_plant_that_fails_ends_with_code_1(start):
    flight = ("-p", "mission.duration:=1.0", "-p", "mission.epoch:='2013-06-01T00:00:00Z'")
    code, _, err = start("source", "--ros-args", *flight, "-p", "fails_at:=2").end()
    assert code == 1
    assert "RuntimeError: the plant is out of order" in err


def test_partners_that_never_come_end_the_plant_with_code_1(start, mission_file):
    limits = ("-p", "lockstep.startup_limit:=0.2", "-p", "lockstep.warn_after:=0.1")
    code, _, err = start("source", "--ros-args", "--params-file", mission_file, *limits).end()
    assert code == 1
    assert "after 0.2 s still absent: voltages has 0 of 1 listeners" in err


REMAPPED = ("-r", "__node:=second", "-r", "voltages:=css/volts", "-r", "__ns:=/sat1")


def test_remapped_topics_and_names_and_a_driver_that_publishes_volatile(start, bench):
    qos = "qos_overrides./sat1/css/volts.subscription"
    overrides = ("-p", f"{qos}.durability:=volatile", "-p", f"{qos}.reliability:=best_effort", "-p", "use_gyro:=false")
    start("estimator", "--ros-args", *REMAPPED, *overrides)
    driver = bench.node.create_publisher(CssVoltages, "/sat1/css/volts", qos_profile_sensor_data)
    bench.until(lambda: driver.get_subscription_count() == 1, "the node listens to the driver")
    names = bench.node.get_node_names_and_namespaces
    bench.until(lambda: ("second", "/sat1") in names(), "it has its other name")
    heard = bench.listen("/sat1/second/sun_estimate", SunEstimate)
    bench.until(lambda: bench.node.count_publishers("/sat1/second/sun_estimate") == 1, "the output carries its name")
    codec = codec_of(CssVoltages)
    steps = iter(range(1000))

    def answered() -> bool:
        # best effort: what was sent before the listener was ready is gone, so the driver keeps sending
        sample = codec.sample(1_370_044_800_000_000_000 + next(steps) * 100_000_000, "bus", voltages=[1.0, 1.0])
        driver.publish(codec.encode(sample))
        return bool(heard)

    bench.until(answered, "an estimate")


def test_quality_of_service_overrides_may_stand_in_a_mission(mission_text):
    qos = "{qos_overrides: {/voltages: {subscription: {durability: volatile}}}, use_sim_time: false}"
    mission = mission_from_text(mission_text + f"estimator: {{ros__parameters: {qos}}}\n", "bench.yaml")
    assert mission.parameters["estimator"]["qos_overrides./voltages.subscription.durability"] == "volatile"
    assert mission_from_text(mission.text(), "again").parameters == mission.parameters


def test_later_files_stand_over_earlier_ones(tmp_path):
    first, second = tmp_path / "1.yaml", tmp_path / "2.yaml"
    first.write_text(
        "/**: {ros__parameters: {mission: {period: 0.5, case: 3}}}\nestimator: {ros__parameters: {gain: 2.0}}"
    )
    second.write_text("/**: {ros__parameters: {mission: {period: 0.25}}}")
    arguments = ["--ros-args", "--params-file", str(first), "--params-file", str(second)]
    mission = mission_of_arguments(find_component("testbed", "estimator"), arguments)
    node = mission.node("estimator")
    assert (mission.values.mission.period, mission.values.mission.case) == (0.25, 3)
    assert node.values.gain == 2.0
    assert mission.origin == f"{first}, {second}"


def test_node_of_another_package_without_a_file_stands_by_itself():
    component = find_component("testbed", "estimator")
    mission = mission_of_arguments(component, [])
    assert [n.name for n in mission.nodes] == ["estimator"]
    mission = mission_of_arguments(component, ["--ros-args", "-r", "__node:=second"])
    assert [n.name for n in mission.nodes] == ["second"]
    assert mission.node("second").component is component


def test_node_of_the_usual_graph_without_a_file_has_that_graph_around_it():
    graph = USUAL_GRAPH
    package, _, executable = graph[0].partition("/")
    component = find_component(package, executable)
    assert len(mission_of_arguments(component, []).nodes) == len(graph)
    second = mission_of_arguments(find_component("css_estimation", "ekf"), ["--ros-args", "-r", "__node:=second"])
    assert [n.name for n in second.nodes][-1] == "second"
    assert len(second.nodes) == len(graph) + 1
