# SPDX-License-Identifier: Apache-2.0
"""Parameters of a hosted component: declared with unit and range, refused with a reason, changed in flight."""

from typing import Any

import pytest
from rcl_interfaces.msg import ParameterType
from rcl_interfaces.srv import DescribeParameters, GetParameters, SetParameters, SetParametersAtomically
from rclpy.context import Context
from rclpy.parameter import Parameter

from css_common import ros_parameters
from css_common.host import ComponentNode
from css_common.mission import find_component, mission_from_text
from css_common.schema import ParameterError

TEXT = """\
/**:
  ros__parameters:
    mission: {epoch: '2013-06-01T00:00:00Z', duration: 10.0}
    graph: {nodes: [testbed/source, testbed/estimator]}
estimator:
  ros__parameters: {use_gyro: false, gain: 2.0, labels: [a, b]}
"""


@pytest.fixture
def node(bench, mission) -> ComponentNode:
    """An active estimator."""
    return bench.host(find_component("testbed", "estimator"), mission(text=TEXT), "estimator")


def set_parameters(bench, **values):
    """Answers of the node's parameter service, one a parameter."""
    parameters = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
    request = SetParameters.Request(parameters=parameters)
    return bench.request(SetParameters, "estimator/set_parameters", request).results


def test_every_parameter_is_declared_with_description_unit_and_range(bench, node):
    names = [p.name for p in node.component_type.table()]
    request = DescribeParameters.Request(names=names)
    found = {d.name: d for d in bench.request(DescribeParameters, "estimator/describe_parameters", request).descriptors}
    assert set(found) == set(names)
    for p in node.component_type.table():
        descriptor = found[p.name]
        assert p.description in descriptor.description
        if p.unit != "-":
            assert descriptor.description.endswith(f"[{p.unit}]")
        assert p.expectation() in descriptor.additional_constraints
        assert descriptor.read_only == (not p.tunable)
        assert not descriptor.dynamic_typing
    assert found["gain"].type == ParameterType.PARAMETER_DOUBLE
    (span,) = found["gain"].floating_point_range
    assert (span.from_value, span.to_value) == (0.0, 10.0)
    (span,) = found["window"].integer_range
    assert (span.from_value, span.to_value, span.step) == (1, 100, 1)
    (span,) = found["mission.seed"].integer_range
    assert (span.from_value, span.to_value) == (0, 2**63 - 1)
    assert found["mission.epoch"].description.startswith("UTC instant")


def test_declared_values_are_those_of_the_mission(bench, node):
    request = GetParameters.Request(names=["gain", "labels", "weights", "use_gyro", "window", "fault", "io.deadline"])
    values = bench.request(GetParameters, "estimator/get_parameters", request).values
    assert values[0].double_value == 2.0
    assert list(values[1].string_array_value) == ["a", "b"]
    assert list(values[2].double_array_value) == [1.0, 2.0]
    assert values[3].bool_value is False
    assert values[4].integer_value == 4
    assert values[5].string_value == "none"
    assert values[6].double_value == 0.5


def test_empty_lists_have_a_type_and_a_value(bench, mission):
    node = bench.host(find_component("testbed", "estimator"), mission(text=TEXT.replace("[a, b]", "[]")), "estimator")
    names = ["io.accepted_frames", "labels", "gain"]
    frames, labels, gain = bench.request(
        GetParameters, "estimator/get_parameters", GetParameters.Request(names=names)
    ).values
    assert frames.type == labels.type == ParameterType.PARAMETER_STRING_ARRAY
    assert list(frames.string_array_value) == list(labels.string_array_value) == []
    assert gain.double_value == 2.0
    assert node.component.values.io.accepted_frames == node.component.values.labels == []
    assert not set_parameters(bench, labels=["c"])[0].successful, "fixed at start, empty or not"


def test_tunable_parameters_change_in_flight(bench, node):
    for result in set_parameters(bench, gain=3.5, weights=[0.5, 0.25], loud=True, fault="nan"):
        assert result.successful
    values = node.component.values
    assert (values.gain, values.loud, values.fault) == (3.5, True, "nan")
    assert values.weights.tolist() == [0.5, 0.25]


def test_component_keeps_its_state_when_it_is_tuned(bench, node):
    node.component.count = 17
    set_parameters(bench, gain=3.5)
    assert node.component.count == 17


# ROS checks type and range by itself first, in its own words.
REFUSED: dict[str, list[tuple[Any, str]]] = {
    "gain": [
        (11.0, "out of range Min: 0.0, Max: 10.0"), (-1e-3, "out of range Min: 0.0, Max: 10.0"),
        (float("nan"), "out of range"), (float("inf"), "out of range"), (3, "expected 'Type.DOUBLE'"),
        ("3.0", "expected 'Type.DOUBLE'"), ([3.0], "expected 'Type.DOUBLE'"),
    ],
    "weights": [
        ([1.0], "weights: [1.0] given, expected 2 values, not 1"),
        ([1.0, -1.0], "weights: [1.0, -1.0] given"), ([1.0, float("nan")], "weights: [1.0, nan] given"),
        ([1, 2], "expected 'Type.DOUBLE_ARRAY'"),
    ],
    "fault": [("everything", "fault: 'everything' given, expected one of none, raise, nan")],
    "floor": [
        (5.0, "floor: 5.0 given, expected at most the gain of 2.0"),
        (float("nan"), "floor: nan given, expected a finite number"),
    ],
    "window": [(5, "read-only")],
    "use_gyro": [(True, "read-only")],
    "note": [("x", "read-only")],
    "cells.normals": [([1.0, 0.0, 0.0], "read-only")],
    "mission.case": [(1, "read-only")],
    "gian": [(1.0, "declared")],
}  # fmt: skip


@pytest.mark.parametrize("bench", ["events"], indirect=True)
@pytest.mark.parametrize(("name", "value", "reason"), [(n, v, r) for n, rows in REFUSED.items() for v, r in rows])
def test_bad_values_are_refused_with_the_reason(bench, node, name, value, reason):
    before = dict(node.canonical)
    (result,) = set_parameters(bench, **{name: value})
    assert not result.successful
    assert reason in result.reason
    assert node.canonical == before
    assert node.component.values.gain == 2.0


def test_several_at_once_are_checked_together(bench, node):
    def together(**values):
        parameters = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
        request = SetParametersAtomically.Request(parameters=parameters)
        return bench.request(SetParametersAtomically, "estimator/set_parameters_atomically", request).result

    # a floor of 5 is too much for the gain in force, but not for the one that comes with it
    assert together(floor=5.0, gain=6.0).successful
    assert (node.component.values.floor, node.component.values.gain) == (5.0, 6.0)
    assert not together(floor=1.0, gain=20.0).successful
    assert (node.component.values.floor, node.component.values.gain) == (5.0, 6.0)


def test_deletion_of_a_parameter_is_refused(bench, node):
    parameters = [Parameter("gain", Parameter.Type.NOT_SET).to_parameter_msg()]
    request = SetParameters.Request(parameters=parameters)
    (result,) = bench.request(SetParameters, "estimator/set_parameters", request).results
    assert not result.successful
    assert node.get_parameter("gain").value == 2.0


def test_deadline_changes_where_it_is_used(bench, node):
    assert set_parameters(bench, **{"io.deadline": 0.125})[0].successful
    assert node.matcher.deadline_ns == 125_000_000


def test_check_that_fails_itself_refuses_and_the_node_lives(bench, node, monkeypatch):
    def broken(values):
        raise IndexError("not so many wheels")

    monkeypatch.setattr(node.component_type, "conflicts", broken)
    (result,) = set_parameters(bench, gain=3.0)
    assert not result.successful
    assert "not so many wheels" in result.reason
    monkeypatch.undo()
    assert set_parameters(bench, gain=3.0)[0].successful


def test_tuning_that_fails_is_counted_and_the_node_lives(bench, node, monkeypatch):
    def broken(self, values):
        raise IndexError("no such table")

    monkeypatch.setattr(node.component_type, "tune", broken)
    set_parameters(bench, gain=3.0)
    assert node.counters["cycle_failed"] == 1
    monkeypatch.undo()
    assert set_parameters(bench, gain=4.0)[0].successful
    assert node.component.values.gain == 4.0


def overridden(*arguments: str) -> dict[str, Any]:
    """Values of a node under a command line of its own."""
    context = Context()
    context.init(args=["--ros-args", *arguments])
    mission = mission_from_text(TEXT, "bench.yaml")
    try:
        node = ComponentNode(find_component("testbed", "estimator"), "estimator", mission, context=context)
        values = dict(node.canonical)
        node.destroy_node()
        return values
    finally:
        context.shutdown()


def test_overrides_of_the_command_line_win():
    values = overridden("-p", "gain:=3.0", "-p", "window:=7", "-p", "estimator:labels:=[x]", "-p", "note:=hello")
    assert (values["gain"], values["window"], values["labels"], values["note"]) == (3.0, 7, ["x"], "hello")
    assert values["floor"] == 0.0


def test_list_may_be_emptied_on_the_command_line():
    assert overridden("-p", "labels:=[]")["labels"] == []


@pytest.mark.parametrize(
    ("override", "reason"),
    [
        ("gain:=3", "gain: 3 given, expected a number written with a point, at least 0 and at most 10"),
        ("gain:=11.0", "gain: 11.0 given, expected at least 0 and at most 10"),
        ("gain:=much", "gain: 'much' given, expected a number written with a point"),
        ("gain:=.nan", "gain: nan given, expected a finite number"),
        ("window:=0", "window: 0 given, expected at least 1 and at most 100"),
        ("window:=1.0", "window: 1.0 given, expected a whole number"),
        ("width_deg:=0.0", "width_deg: 0.0 given, expected above 0 and at most 90 [deg]"),
        ("weights:=[1.0]", "weights: [1.0] given, expected 2 values, not 1"),
        ("weights:=[]", "weights: [] given, expected 2 values, not 0"),
        ("weights:=[1, 2]", "weights: [1, 2] given, expected a list of numbers written with points"),
        ("rows:=[1.0, 2.0]", "rows: [1.0, 2.0] given"),
        ("fault:=all", "fault: 'all' given, expected one of none"),
        ("note:=1.0", "note: 1.0 given, expected a text"),
        ("use_gyro:=1", "use_gyro: 1 given, expected true or false"),
    ],
)
def test_bad_overrides_are_refused_at_the_start(override, reason):
    with pytest.raises(ParameterError) as caught:
        overridden("-p", override)
    assert reason in str(caught.value)


def test_types_of_ros_exist_for_every_kind_of_parameter():
    kinds = {p.kind for node in default_kinds() for p in node}
    assert kinds <= set(ros_parameters._TYPES)


def default_kinds():
    """Tables of the components at hand."""
    yield find_component("testbed", "estimator").table()
    yield find_component("testbed", "source").table()
