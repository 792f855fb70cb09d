# SPDX-License-Identifier: Apache-2.0
"""Ordinary parameter files, as a node of ours reads them and as a plain node of rclpy does: the same values."""

import array
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rclpy.context import Context
from rclpy.node import Node
from ros_values import values_of

from css_common.mission import find_component
from css_common.mission_file import MissionError
from css_common.node_arguments import mission_of_arguments, parse_arguments
from css_common.schema import ParameterError

FILES = sorted((Path(__file__).parent / "data" / "parameter_files").glob("*.yaml"))
ESTIMATOR = find_component("testbed", "estimator")
DEFAULTS = {p.name: p.default for p in ESTIMATOR.table()}
NAMED = ["-r", "__node:=ekf"]


def read_by_ros(arguments: list[str]) -> tuple[str, Mapping[str, Any]]:
    """Full name of a plain node with this command line, and what it was given."""
    context = Context()
    context.init(args=["--ros-args", *arguments])
    try:
        node = Node(
            "estimator",
            context=context,
            start_parameter_services=False,
            automatically_declare_parameters_from_overrides=True,
        )
        values = values_of(node)
        full_name = node.get_fully_qualified_name()
        node.destroy_node()
    finally:
        context.shutdown()
    return full_name, {k: list(v) if isinstance(v, array.array) else v for k, v in values.items()}


def read_by_us(arguments: list[str]) -> tuple[str, Mapping[str, Any]]:
    """The same of a node of ours."""
    arguments = ["--ros-args", *arguments]
    parsed = parse_arguments("estimator", arguments)
    mission = mission_of_arguments(ESTIMATOR, arguments)
    return f"{parsed.namespace.rstrip('/')}/{parsed.name}", mission.node_of(ESTIMATOR, parsed.name).canonical


def compare(arguments: list[str]) -> Mapping[str, Any]:
    """What both read, after it has turned out to be the same; values that no file gives are defaults."""
    full_name, theirs = read_by_ros(arguments)
    our_name, ours = read_by_us(arguments)
    assert our_name == full_name
    expected = {name: theirs.get(name, default) for name, default in DEFAULTS.items()}
    assert ours == {name: list(v) if isinstance(v, tuple) else v for name, v in expected.items()}
    return ours


@pytest.mark.parametrize("namespace", ["/", "/sat1", "/x", "/x/y"])
@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_file(file, namespace):
    values = compare(["--params-file", str(file), "-r", f"__ns:={namespace}", *NAMED])
    heard = {
        "nested": namespace == "/sat1", "other": namespace == "/", "star": namespace == "/", "wild": True,
    }[file.stem]  # fmt: skip
    assert values["use_gyro"] is not heard


def section(name: str, **values: object) -> str:
    """A section of a parameter file."""
    lines = "".join(f"    {key}: {value}\n" for key, value in values.items())
    return f"{name}:\n  ros__parameters:\n{lines}"


@pytest.fixture
def write(tmp_path):
    """Writes parameter files; gives the arguments that name them."""

    def write(*texts: str) -> list[str]:
        arguments = []
        for number, text in enumerate(texts):
            (tmp_path / f"{number}.yaml").write_text(text)
            arguments += ["--params-file", str(tmp_path / f"{number}.yaml")]
        return arguments

    return write


ORDER = {
    "shared first": ([section("/**", gain=2.0) + section("ekf", gain=3.0)], 3.0),
    "shared last": ([section("ekf", gain=3.0) + section("/**", gain=2.0)], 2.0),
    "two wildcards": ([section("/**/ekf", gain=2.0) + section("/*", gain=3.0)], 3.0),
    "two files": ([section("ekf", gain=3.0), section("ekf", gain=4.0)], 4.0),
    "shared in a second file": ([section("ekf", gain=3.0), section("/**", gain=2.0)], 2.0),
    "section stays where it came first": (
        [section("/*", gain=2.0) + section("/**", gain=3.0), section("/*", gain=4.0)], 3.0,
    ),
    "slash or none": ([section("ekf", gain=3.0), section("/ekf", gain=4.0)], 4.0),
    "others beside it": ([section("camera", fps=30, size="[1, 2]") + section("ekf", gain=3.0)], 3.0),
    "of another node of the default graph": ([section("gyro", port="/dev/ttyS0") + section("ekf", gain=3.0)], 3.0),
    "for all, and not known here": ([section("/**", fps=30, gain=3.0)], 3.0),
    "comments alone": (["# nothing\n"], 1.0),
    "nothing": ([""], 1.0),
    "a section of nothing": (["ekf:\n  ros__parameters: {}\ngyro: {}\n"], 1.0),
}  # fmt: skip


@pytest.mark.parametrize("order", ORDER)
def test_order(write, order):
    texts, gain = ORDER[order]
    assert compare([*write(*texts), *NAMED])["gain"] == gain


names = st.sampled_from(
    ["/**", "/*", "/**/ekf", "/*/ekf", "ekf", "/ekf", "/a/ekf", "a/ekf", "/a/*", "/a/**", "/**/*", "/*/*", "/a/b/ekf",
     "other", "/a/other", "/**/other", "/*/**/ekf"]
)  # fmt: skip
keys, values = st.sampled_from(["gain", "width_deg", "io.deadline"]), st.sampled_from([1.0, 2.0, 3.0])
bodies = st.dictionaries(keys, values, min_size=1)
files = st.lists(st.dictionaries(names, bodies, min_size=1, max_size=4), min_size=1, max_size=3)


@settings(max_examples=80, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(files, st.sampled_from(["/", "/a", "/a/b"]))
def test_any_sections_in_any_order(write, files, namespace):
    # one and the same section under two names in one file is an error here
    texts = [
        "".join(section(name, **body) for name, body in file.items() if not (name[0] != "/" and f"/{name}" in file))
        for file in files
    ]
    compare([*write(*texts), "-r", f"__ns:={namespace}", *NAMED])


REMAPS = {
    "node": ["-r", "__node:=b"],
    "old word": ["--remap", "__name:=b"],
    "for this one": ["-r", "estimator:__node:=b", "-r", "estimator:__ns:=/x", "-r", "b:__ns:=/a"],
    "for another": ["-r", "other:__node:=b", "-r", "other:__ns:=/a"],
    "first rule": ["-r", "__node:=b", "-r", "__node:=c", "-r", "__ns:=/a", "-r", "__ns:=/b"],
    "twice arguments of ROS": ["-r", "a:=b", "--", "--ros-args", "-r", "__node:=b"],
}


@pytest.mark.parametrize("remap", REMAPS)
def test_names(write, remap):
    compare([*write(section("/a/b", gain=2.0) + section("b", gain=3.0)), *REMAPS[remap]])


def test_typos_for_this_node_are_refused_though_ros_takes_them(write):
    for text, reason in (
        (section("ekf", gian=2.0), "ekf: gian: unknown; did you mean gain?"),
        (section("/**/ekf", fps=30), "/**/ekf: fps: unknown"),
        (section("/**", gian=2.0), "/**: gian: unknown; did you mean gain?"),
        (section("ekf", gain=20.0), "ekf: gain: 20.0 given, expected at least 0 and at most 10"),
    ):
        with pytest.raises((MissionError, ParameterError)) as caught:
            read_by_us([*write(text), *NAMED])
        assert str(caught.value).endswith(reason)


def test_section_of_this_node_in_another_namespace_is_remarked(write):
    arguments = ["--ros-args", *write(section("estimator", gain=2.0)), "-r", "__ns:=/sat1"]
    mission = mission_of_arguments(ESTIMATOR, arguments)
    (remark,) = mission.remarks
    assert "section estimator is not for this node, /sat1/estimator; /**/estimator would be" in remark
    assert mission.node_of(ESTIMATOR, "estimator").values.gain == 1.0


MISSION = section(
    "/**",
    **{
        "mission.duration": 1.0,
        "mission.epoch": "2013-06-01T00:00:00Z",
        "graph.nodes": "[testbed/source, testbed/estimator]",
    },
)


def test_mission_may_hold_sections_of_nodes_that_are_none_of_its_graph(write):
    text = MISSION + section("camera", fps=30) + section("controller_of_tv", x=1) + section("estimator", gain=2.0)
    mission = mission_of_arguments(ESTIMATOR, ["--ros-args", *write(text)])
    assert mission.node("estimator").values.gain == 2.0


def test_near_miss_of_a_node_in_a_mission_is_an_error(write):
    with pytest.raises(MissionError, match=r"section estimatr: unknown; did you mean estimator\?$"):
        mission_of_arguments(ESTIMATOR, ["--ros-args", *write(MISSION + section("estimatr", gain=2.0))])


def test_node_beside_the_graph_of_a_mission_has_its_section(write):
    arguments = ["--ros-args", *write(MISSION + section("second", gain=2.0)), "-r", "__node:=second"]
    assert mission_of_arguments(ESTIMATOR, arguments).node_of(ESTIMATOR, "second").values.gain == 2.0
