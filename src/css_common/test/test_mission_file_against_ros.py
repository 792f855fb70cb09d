# SPDX-License-Identifier: Apache-2.0
"""Mission files against the parser of ROS itself: a file means the same to a node that reads it with rcl."""

import array
from typing import Any

import pytest
from rclpy.context import Context
from rclpy.node import Node
from ros_values import values_of

from css_common.mission_file import MissionError, dump_sections, flattened, read_sections
from css_common.schema import default_values
from css_common.shared_sections import shared_parameters


@pytest.fixture
def read_by_ros(tmp_path):
    """Parameters of a node that was given some text as its parameter file."""
    contexts: list[Any] = []

    def read(text: str) -> dict:
        file = tmp_path / f"{len(contexts)}.yaml"
        file.write_text(text, encoding="utf-8")
        context = Context()
        context.init(args=["--ros-args", "--params-file", str(file)])
        contexts.append(context)
        node = Node("reader", context=context, automatically_declare_parameters_from_overrides=True)
        values = values_of(node)
        node.destroy_node()
        return {
            name: list(value) if isinstance(value, array.array) else value
            for name, value in values.items()
            if name not in ("use_sim_time", "start_type_description_service")
        }

    yield read
    for context in contexts:
        context.shutdown()


def read_by_us(text: str) -> dict:
    """The same by the mission reader."""
    return flattened(read_sections(text, "x")["/**"])


WORDS = (
    "0 1 -1 +7 42 0x1F 0X1f 010 007 9223372036854775807 1_000 0b1 0o17 "
    "1.0 -1.5 +.5 5. 1e4 1E4 1e-4 -1.5E+3 .5e3 1.e3 .inf -.inf .Inf .nan .NaN 1e 1.0.0 e5 1.5x .e3 "
    "true True TRUE false yes Yes no NO on On off OFF y Y n N yEs tru "
    "08 0x 0x1p3 0x1.8 -0x10 0779 0777 -010 infinity nan inf INF -.inf +.inf 1e400 1e-400 1e-320 ~ null Null . + "
    "18446744073709551615 -9223372036854775809 9223372036854775808 1. 1.e 1__0 00 -0 -0.0 00.5 1d5 0x" + "f" * 30 + " "
    "2013-06-01 2013-06-01T00:00:00Z 1:30 1:30:00 12:30:45.5 = << text a/b:c"
)


@pytest.mark.parametrize("word", WORDS.split())
def test_plain_words(read_by_ros, word):
    text = f"/**:\n  ros__parameters:\n    value: {word}\n"
    theirs, ours = read_by_ros(text), read_by_us(text)
    assert repr(ours["value"]) == repr(theirs["value"])
    assert type(ours["value"]) is type(theirs["value"])


def test_colons_inside_brackets_stand_in_quotes(read_by_ros):
    # the parser of the ROS wheels takes no colon inside brackets, so a mission has it in quotes or on a line of its own
    text = "/**:\n  ros__parameters:\n    a: ['x/y:z', \"1:30\"]\n    b: x/y:z\n    c: {d: 'x:y'}\n"
    assert read_by_ros(text) == read_by_us(text) == {"a": ["x/y:z", "1:30"], "b": "x/y:z", "c.d": "x:y"}


def test_quoted_words_keys_and_lists(read_by_ros):
    text = """\
/**:
  ros__parameters:
    off: {1: 1.5, y: 2.5}
    quoted: ["1", 'on', "1e4", plain]
    reals: [1.0, 1e-4, -.5]
    wholes: [1, -2]
    flags: [on, false]
    folded: >-
      two
      lines
    é: "ü"
"""
    assert read_by_ros(text) == read_by_us(text)


@pytest.mark.parametrize("text", ["a: &x {b: 1.0}\nc: *x", "a: [[1.0], [2.0]]", "a: [x/y:z]", "{a: 1:30}"])
def test_what_ros_refuses_does_not_pass_here_either(read_by_ros, text):
    lines = "".join(f"    {line}\n" for line in text.splitlines())
    text = "/**:\n  ros__parameters:\n" + lines
    with pytest.raises(Exception, match="params-file"):
        read_by_ros(text)
    try:
        values = read_by_us(text)
    except MissionError:
        return
    assert isinstance(values["a"][0], list), "read, but no specification takes it"


def test_written_missions_are_read_the_same(read_by_ros):
    parameters = {p.name: p.default for p in shared_parameters().values() if not p.example and p.default != []}
    parameters |= {
        "mission.description": "1e4",
        "mission.name": "y",
        "graph.nodes": ["a/b:c"],
        "io.deadline": 1e-4,
        "orbit.altitude": 1e22,
    }
    text = dump_sections({"/**": parameters})
    assert read_by_ros(text) == read_by_us(text) == parameters


def test_defaults_hold_nothing_that_a_file_could_not():
    for _, value in default_values(shared_parameters().values()).items():
        assert value is not None
