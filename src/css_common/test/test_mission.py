# SPDX-License-Identifier: Apache-2.0
"""What a mission file means: sections over sections, overrides, the graph, awaited topics, events, criteria, text."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from css_common.component import Plant
from css_common.mission import find_component, mission_from_text
from css_common.mission_file import dump_sections, flattened, read_sections
from css_msgs.msg import CssVoltages, SunEstimate

HEAD = """\
/**:
  ros__parameters:
    mission: {name: bench, duration: 1.0, period: 0.1, epoch: '2013-06-01T00:00:00Z'}
    graph: {nodes: [testbed/source, testbed/gyro, testbed/estimator, testbed/controller], estimator: estimator}
"""


def mission_of(lines: str = "", *overrides: str, nodes: str = ""):
    """The small mission with more lines in its shared section and more sections."""
    return mission_from_text(HEAD + "".join(f"    {x}\n" for x in lines.splitlines()) + nodes, "bench.yaml", overrides)


def graph_of(*entries: str, lines: str = ""):
    """A mission of other nodes."""
    flight = "mission: {duration: 1.0, epoch: 2013-06-01}"
    text = f"/**: {{ros__parameters: {{{flight}, graph: {{nodes: {list(entries)}, estimator: estimator}}, {lines}}}}}"
    return mission_from_text(text, "bench.yaml")


def test_values_come_from_the_node_section_then_the_shared_one_then_the_default():
    text = "io: {deadline: 0.25}\ncells: {field_of_view_deg: 100.0}"
    mission = mission_of(text, nodes="estimator: {ros__parameters: {gain: 2.0, io: {deadline: 0.75}}}\n")
    estimator, gyro = mission.node("estimator"), mission.node("gyro")
    assert (estimator.values.io.deadline, gyro.values.io.deadline) == (0.75, 0.25)
    assert mission.values.io.deadline == 0.25
    assert estimator.values.cells.field_of_view_deg == 100.0
    assert (estimator.values.gain, estimator.values.floor) == (2.0, 0.0)
    assert estimator.values.io.largest_gap == 60.0


def test_node_sees_its_own_sections_only():
    values = mission_of().node("gyro").values
    assert hasattr(values, "mission")
    assert hasattr(values, "io")
    assert not hasattr(values, "cells")


def test_plants_always_have_the_section_that_their_host_reads():
    assert mission_of("lockstep: {hold_limit: 5.0}").node("source").values.lockstep.hold_limit == 5.0


@pytest.mark.parametrize(
    ("written", "value"),
    [("1e-4", 1e-4), ("1E+3", 1000.0), ("1e4", 1e4), ("2.5e-1", 0.25), ("+.5e1", 5.0), ("5.", 5.0), ("0.5", 0.5)],
)
def test_numbers_with_exponents_are_numbers(written, value):
    assert mission_of(f"criteria: {{rate: {{max: {written}}}}}").criteria == {"rate": {"max": value}}


@pytest.mark.parametrize("word", ["2013-06-01", "2013-06-01T00:00:00Z", "1:30", "1_000", "0o17", "e5", "=", "x"])
def test_words_that_yaml_makes_something_else_of_are_texts_as_in_ros(word):
    assert mission_of(nodes=f"estimator:\n  ros__parameters:\n    note: {word}\n").node("estimator").values.note == word


def test_keys_are_words_as_in_ros():
    flat = flattened(read_sections("/**: {ros__parameters: {off: {1: 2, 0x1: 3, 1.0: 4, y: 5}}}", "x")["/**"])
    assert flat == {"off.1": 2, "off.0x1": 3, "off.1.0": 4, "off.y": 5}


def test_overrides_reach_shared_sections_and_nodes():
    mission = mission_of(
        "", "mission.duration=20", "cells.normals=[1,0,0, 0,1,0]", "estimator.gain=3", "estimator.weights=0.5, 0.25",
        "estimator.use_gyro=false", "estimator.io.deadline=0.125", "estimator.labels=a,b", "mission.description=a=b",
        "lockstep.wait_for=[]", "estimator.offset=-3",
    )  # fmt: skip
    estimator = mission.node("estimator").values
    assert mission.values.mission.duration == 20.0
    assert mission.steps == 200
    assert mission.values.cells.normals.tolist() == estimator.cells.normals.tolist() == [[1, 0, 0], [0, 1, 0]]
    assert (estimator.gain, estimator.use_gyro, estimator.offset) == (3.0, False, -3)
    assert estimator.weights.tolist() == [0.5, 0.25]
    assert (estimator.io.deadline, mission.values.io.deadline) == (0.125, 0.5)
    assert estimator.labels == ["a", "b"]
    assert mission.values.mission.description == "a=b"
    assert mission.values.lockstep.wait_for == []


def test_the_last_override_of_a_key_counts():
    assert mission_of("", "mission.case=1", "mission.case=2").values.mission.case == 2


def test_overrides_are_applied_together():
    # neither alone would do
    mission = mission_of("", "estimator.floor=5", "estimator.gain=6")
    assert mission.node("estimator").values.floor == 5.0
    mission = mission_of("", "graph.nodes=testbed/source,testbed/estimator:b,testbed/controller", "graph.estimator=b")
    assert [n.name for n in mission.nodes] == ["source", "b", "controller"]


def test_overrides_leave_the_mission_that_they_change_alone():
    mission = mission_of()
    changed = mission.with_overrides(["estimator.gain=3"])
    assert (mission.node("estimator").values.gain, changed.node("estimator").values.gain) == (1.0, 3.0)


def test_graph():
    mission = graph_of("testbed/source", "testbed/estimator", "testbed/estimator:second", "testbed/controller")
    assert [(n.name, n.executable) for n in mission.nodes] == [
        ("source", "source"), ("estimator", "estimator"), ("second", "estimator"), ("controller", "controller"),
    ]  # fmt: skip
    assert mission.plant.name == "source"
    assert issubclass(mission.plant.component, Plant)
    assert mission.topics["second/sun_estimate"] is SunEstimate
    assert mission.topics["voltages"] is CssVoltages
    assert mission.outputs["command"].ends_cycle
    assert graph_of("testbed/source").plant is not None


def test_graph_without_a_plant():
    assert mission_from_text("/**: {ros__parameters: {graph: {nodes: []}}}", "x").plant is None


def test_nodes_that_are_not_in_the_graph_take_its_parameters_too():
    component = find_component("testbed", "estimator")
    node = mission_of("io: {deadline: 0.25}").node_of(component, "elsewhere")
    assert (node.name, node.package, node.executable) == ("elsewhere", "testbed", "estimator")
    assert node.values.io.deadline == 0.25


AWAITED = {
    # the command needs the estimate of the same stamp: one topic stands for both
    ("testbed/source", "testbed/estimator", "testbed/controller"): ("command",),
    # a second estimator may not fall behind
    ("testbed/source", "testbed/estimator", "testbed/estimator:second", "testbed/controller"): (
        "second/sun_estimate",
        "command",
    ),
    # optional inputs imply nothing: the gyro may be silent
    ("testbed/source", "testbed/gyro", "testbed/estimator"): ("estimator/sun_estimate",),
    # nothing ends a cycle: what nobody consumes
    ("testbed/source", "testbed/gyro"): ("gyro/imu",),
    ("testbed/source", "testbed/gyro", "testbed/compass"): ("gyro/imu", "mag/field"),
    ("testbed/source",): (),
}


@pytest.mark.parametrize("entries", AWAITED)
def test_awaited_topics(entries):
    assert graph_of(*entries).awaited == AWAITED[entries]


def test_awaited_topics_when_inputs_are_not_matched_exactly():
    # a command may be made of an older estimate then, so it does not stand for it
    entries = ("testbed/source", "testbed/estimator", "testbed/controller")
    mission = graph_of(*entries, lines="io: {input_matching: latest}")
    assert mission.awaited == ("estimator/sun_estimate", "command")


def test_awaited_topics_by_hand():
    assert mission_of("lockstep: {wait_for: [gyro/imu, command]}").awaited == ("gyro/imu", "command")


EVENTS = """\
events:
  late: {time: 900.0, node: gyro, action: activate}
  off: {time: 0.5, node: gyro, action: deactivate}
  more: {time: 0.5, node: estimator, action: set, parameter: gain, value: 2.0}
  weigh: {time: 0.0, node: estimator, action: set, parameter: weights, value: [0.5, 0.5]}"""


def test_events_are_sorted_by_time_and_name():
    events = mission_of(EVENTS).events
    assert [(e.name, e.time, e.node, e.action) for e in events] == [
        ("weigh", 0.0, "estimator", "set"),
        ("more", 0.5, "estimator", "set"),
        ("off", 0.5, "gyro", "deactivate"),
        ("late", 900.0, "gyro", "activate"),
    ]
    assert (events[1].parameter, events[1].value) == ("gain", 2.0)


def test_criteria():
    mission = mission_of("criteria: {pointing_deg: {max: 5.0}, rate: {min: 0.0, max: 1.0e-3}}")
    assert mission.criteria == {"pointing_deg": {"max": 5.0}, "rate": {"min": 0.0, "max": 1e-3}}
    assert mission_of().criteria == {}


def test_times_are_whole_nanoseconds():
    mission = mission_of()
    assert mission.period_ns == 100_000_000
    assert mission.epoch_ns == 1_370_044_800_000_000_000
    assert mission.steps == 10


def test_text_and_back():
    lines = EVENTS + "\ncriteria: {pointing_deg: {max: 5.0}}\ncells: {normals: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0]}"
    node = "/estimator: {ros__parameters: {gain: 2.0, labels: [a, 'b'], note: 'on'}}\n"
    mission = mission_of(lines, "mission.case=7", "estimator.floor=1e-7", "mission.duration=1e7", nodes=node)
    again = mission_from_text(mission.text(), "again.yaml")
    assert again.parameters == mission.parameters
    assert again.shared == mission.shared
    assert (again.events, again.criteria) == (mission.events, mission.criteria)
    assert [n.canonical for n in again.nodes] == [n.canonical for n in mission.nodes]
    assert again.text() == mission.text()


names = st.text("abcdefghij_0123456789", min_size=1, max_size=6)
values = st.one_of(
    st.booleans(),
    st.integers(-(2**63), 2**63 - 1),
    st.floats(allow_nan=False, allow_infinity=False, allow_subnormal=False),
    st.text(max_size=12),
    st.sampled_from(["1e4", "1e-4", ".5e3", "on", "y", "~", "", "null", "0x10", "010", "1_0", "1:30", "2013-06-01"]),
    st.lists(st.floats(allow_nan=False, allow_infinity=False, allow_subnormal=False), max_size=20),
    st.lists(st.text(max_size=4), max_size=4),
)


@given(st.dictionaries(st.sampled_from(["/**", "estimator", "gyro"]), st.dictionaries(names, values, min_size=1)))
def test_every_value_is_read_as_it_was_written(parameters):
    text = dump_sections(parameters)
    found = {section: flattened(body) for section, body in read_sections(text, "x").items()}
    assert found == parameters
    for section, flat in parameters.items():
        for name, value in flat.items():
            assert type(found[section][name]) is type(value)
