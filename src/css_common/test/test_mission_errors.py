# SPDX-License-Identifier: Apache-2.0
"""Every way in which a mission file can be wrong gives one line that names file, key, value and what was expected."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from css_common.mission import Mission, find_mission, load_mission, mission_from_text
from css_common.mission_file import MissionError

HEAD = """\
/**:
  ros__parameters:
    mission: {name: bench, duration: 1.0, period: 0.1}
    graph: {nodes: [testbed/source, testbed/gyro, testbed/estimator, testbed/controller], estimator: estimator}
"""


def refusal(text: str, *overrides: str) -> str:
    """The one line with which a mission is refused."""
    with pytest.raises(MissionError) as caught:
        mission_from_text(text, "bench.yaml", overrides)
    message = str(caught.value)
    assert "\n" not in message
    assert len(message) < 500
    return message


def shared(lines: str) -> str:
    """The small mission with more lines in its shared section."""
    return HEAD + "".join(f"    {line}\n" for line in lines.splitlines())


def section(name: str, body: str) -> str:
    """The small mission with a section of a node."""
    return HEAD + f"{name}:\n  ros__parameters: {body}\n"


NOT_A_PARAMETER_FILE = {
    "[1, 2]": "expected node names at the top, found list",
    "just words": "expected node names at the top, found str",
    "/**: {mission: {name: x}}": "/**: expected the one key ros__parameters below it",
    "/**:": "/**: expected the one key ros__parameters below it",
    "/**: {ros__parameters: 3}": "/**: ros__parameters must hold keys and values",
    "/**: {ros__parameters: }": "/**: ros__parameters must hold keys and values",
    "/**: {ros__parameters: {}, also: 1}": "expected the one key ros__parameters",
    "a: [1, 2": "not valid YAML",
    "a: 1\n b: 2": "not valid YAML",
    "a: !!python/object:os.system x": "not valid YAML",
    "a: \x07": "not valid YAML",
    "a: 1\n---\nb: 2": "not valid YAML",
    "? [a, b]\n: 1": "line 1: expected a word as key",
    "? {a: b}\n: 1": "line 1: expected a word as key",
    "[" * 3000: "not valid YAML",
    "/**: {ros__parameters: {mission: {seed: " + "9" * 5000 + "}}}": "not valid YAML",
}


@pytest.mark.parametrize("text", NOT_A_PARAMETER_FILE)
def test_files_of_another_form(text):
    assert refusal(text).startswith("bench.yaml: ")
    assert NOT_A_PARAMETER_FILE[text] in refusal(text)


DUPLICATES = {
    shared("io: {deadline: 0.5}\nio: {largest_gap: 1.0}"): "line 6: io stands twice",
    shared("io:\n  deadline: 0.5\n  deadline: 0.6"): "line 7: deadline stands twice",
    shared("io.deadline: 0.5\nio: {deadline: 0.6}"): "io.deadline stands twice",
    section("estimator", "{gain: 1.0}") + "estimator: {ros__parameters: {gain: 2.0}}": "estimator stands twice",
    section("estimator", "{gain: 1.0}") + "/estimator: {ros__parameters: {gain: 2.0}}": "estimator stands twice",
}


@pytest.mark.parametrize("text", DUPLICATES)
def test_keys_that_stand_twice(text):
    assert DUPLICATES[text] in refusal(text)
    assert refusal(text).startswith("bench.yaml: ")


def test_aliases_are_refused_because_ros_refuses_them():
    assert "bench.yaml: line 6: aliases" in refusal(shared("io: &io {deadline: 0.5}\nmore: *io"))
    assert "aliases" in refusal("a: &x\n  b: *x")


SHARED_ERRORS = {
    "io: {deadlin: 0.5}": "bench.yaml: /**: io.deadlin: unknown; did you mean io.deadline?",
    "ios: {deadline: 0.5}": "bench.yaml: /**: ios.deadline: unknown; did you mean io.deadline?",
    "io: {deadline: 1}": "bench.yaml: /**: io.deadline: 1 given, expected a number written with a point [s]",
    "io: {deadline: -0.5}": "bench.yaml: /**: io.deadline: -0.5 given, expected a number written with a point [s], "
    "at least 0.001",
    "io: {deadline: }": "bench.yaml: /**: io.deadline: None given",
    "io: {deadline: .nan}": "bench.yaml: /**: io.deadline: nan given",
    "io: {deadline: [0.5]}": "bench.yaml: /**: io.deadline: [0.5] given",
    "io: {deadline: {x: 0.5}}": "bench.yaml: /**: io.deadline.x: unknown; did you mean io.deadline?",
    "io: {body_frame: off}": "bench.yaml: /**: io.body_frame: False given, expected a text",
    "io: {input_matching: newest}": "'newest' given, expected one of exact, latest",
    "autostart: 1": "bench.yaml: /**: autostart: 1 given, expected true or false",
    "cells: {normals: [0.0, 0.0]}": "bench.yaml: /**: cells.normals: [0.0, 0.0] given, expected a list of numbers "
    "written with points, rows of 3 values",
    "cells: {normals: [0.0, 0, 1.0]}": "cells.normals: [0.0, 0, 1.0] given, expected a list of numbers written with",
    "cells: {normals: [[0.0, 0.0, 1.0]]}": "cells.normals: [[0.0, 0.0, 1.0]] given, expected a list of numbers",
    "cells: {normals: [0.0, 0.0, 2.0]}": "bench.yaml: /**: cells.normals: row 0 has length 2, expected unit vectors",
    "cells: {field_of_view_deg: 200.0}": "bench.yaml: /**: cells.field_of_view_deg: 200.0 given, expected a number",
    "orbit: {source: tle}": "bench.yaml: /**: orbit.tle_line1: expected the 69 characters",
    "spacecraft: {inertia: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, -1.0]}": "spacecraft.inertia: eigenvalue -1",
    "wheels: {axes: [1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0]}": "wheels.axes: they span 1 of 3 directions",
    "1: 2": "bench.yaml: /**: 1: unknown",
    '"a\\nb": 2': r"bench.yaml: /**: 'a\nb': unknown",
    "events: 5": "bench.yaml: /**: events: unknown",
}


@pytest.mark.parametrize("lines", SHARED_ERRORS)
def test_shared_sections(lines):
    assert SHARED_ERRORS[lines] in refusal(shared(lines))


def test_epoch_that_is_no_instant():
    text = HEAD.replace("duration: 1.0", "epoch: tomorrow")
    assert "bench.yaml: /**: mission.epoch: 'tomorrow' is not a UTC instant" in refusal(text)


NODE_ERRORS = {
    ("estimator", "{gian: 2.0}"): "bench.yaml: estimator: gian: unknown; did you mean gain?",
    ("estimator", "{gain: 20.0}"): "bench.yaml: estimator: gain: 20.0 given, expected a number written with a point, "
    "at least 0 and at most 10",
    ("estimator", "{gain: 2}"): "bench.yaml: estimator: gain: 2 given, expected a number written with a point",
    ("estimator", "{floor: 3.0}"): "bench.yaml: estimator: floor: 3.0 given, expected at most the gain of 1.0",
    ("estimator", "{width_deg: 0.0}"): "expected a number written with a point [deg], above 0 and at most 90",
    ("estimator", "{fault: all}"): "bench.yaml: estimator: fault: 'all' given, expected one of none, raise, nan",
    ("estimator", "{weights: [1.0]}"): "bench.yaml: estimator: weights: [1.0] given",
    ("estimator", "{orbit: {altitude: 5.0e+5}}"): "bench.yaml: estimator: orbit.altitude: unknown",
    ("estimatr", "{gain: 2.0}"): "bench.yaml: section estimatr: unknown; did you mean estimator? (sections are /** "
    "and the nodes of graph.nodes: source, gyro, estimator, controller)",
    ("/ns/estimator", "{gain: 2.0}"): "bench.yaml: section ns/estimator: unknown",
    ("/*", "{gain: 2.0}"): "bench.yaml: section *: unknown",
}


@pytest.mark.parametrize("place", NODE_ERRORS)
def test_node_sections(place):
    assert NODE_ERRORS[place] in refusal(section(*place))


GRAPH_ERRORS = {
    "testbed": "graph.nodes: 'testbed' given, expected PACKAGE/EXECUTABLE[:NAME]",
    "testbed/": "graph.nodes: 'testbed/' given, expected PACKAGE/EXECUTABLE[:NAME]",
    "testbed/a/b": "graph.nodes: 'testbed/a/b' given, expected PACKAGE/EXECUTABLE[:NAME]",
    "testbed/estimator:my-node": "graph.nodes: 'testbed/estimator:my-node' given, expected PACKAGE/EXECUTABLE[:NAME]",
    "testbed/estimator:2nd": "graph.nodes: 'testbed/estimator:2nd' given, expected PACKAGE/EXECUTABLE[:NAME]",
    "testbed/estimator:é": "expected PACKAGE/EXECUTABLE[:NAME]",
    "testbed/estimatr": "there is no testbed/nodes/estimatr.py in this workspace",
    "testbod/estimator": "there is no testbod/nodes/estimator.py in this workspace",
    "testbed/nothing": "graph.nodes: testbed.nodes.nothing defines no component",
    "testbed/gyro": "graph.nodes: two nodes are called gyro",
    "testbed/rival": "rival and source both publish voltages",
}


@pytest.mark.parametrize("entry", GRAPH_ERRORS)
def test_nodes_of_the_graph(entry):
    message = refusal(HEAD.replace("testbed/gyro,", f"testbed/gyro, '{entry}',"))
    assert message.startswith("bench.yaml: ")
    assert GRAPH_ERRORS[entry] in message


def test_node_file_that_cannot_be_imported_shows_its_own_error():
    # a broken installation is no error of the mission: the traceback says more than a line could
    with pytest.raises(ModuleNotFoundError, match="a_package_that_nobody_has"):
        mission_from_text(HEAD.replace("testbed/gyro,", "testbed/incomplete,"), "bench.yaml")


WIRING_ERRORS = {
    "nowhere": "rival needs the topic voltagse: unknown; did you mean voltages?; no node of graph.nodes publishes it",
    "type": "rival takes voltages as css_msgs/msg/WheelTorqueCommand, source publishes css_msgs/msg/CssVoltages",
    "divider": "rival expects mag/field every 1 steps, compass publishes it every 4",
}


@pytest.mark.parametrize("wiring", WIRING_ERRORS)
def test_wiring(wiring):
    text = HEAD.replace("testbed/gyro,", "testbed/gyro, testbed/compass, testbed/rival,")
    message = refusal(text + f"rival: {{ros__parameters: {{wiring: {wiring}}}}}\n")
    assert message.startswith("bench.yaml: ")
    assert WIRING_ERRORS[wiring] in message


def test_control_that_listens_to_an_estimator_that_does_not_fly():
    message = refusal(HEAD.replace("estimator: estimator", "estimator: flat"))
    assert "controller needs the topic flat/sun_estimate: unknown" in message


def test_without_a_plant_devices_publish_what_nodes_need():
    text = HEAD.replace("testbed/source, testbed/gyro, ", "")
    assert [n.name for n in mission_from_text(text, "bench.yaml").nodes] == ["estimator", "controller"]


def test_awaited_topics_must_exist():
    message = refusal(shared("lockstep: {wait_for: [comand]}"))
    assert "bench.yaml: /**: lockstep.wait_for: comand: unknown; did you mean command?" in message


EVENT_ERRORS = {
    "{time: 0.5, node: gyro}": "events.off.action: None given, expected one of activate, deactivate, set",
    "{time: 0.5, node: gyro, action: stop}": "events.off.action: 'stop' given, expected one of activate",
    "{time: 5, node: gyro, action: deactivate}": "events.off.time: 5 given, expected seconds from the epoch",
    "{time: -5.0, node: gyro, action: deactivate}": "events.off.time: -5.0 given, expected seconds from the epoch",
    "{time: .nan, node: gyro, action: deactivate}": "events.off.time: nan given",
    "{node: gyro, action: deactivate}": "events.off.time: None given",
    "{time: 0.5, node: gyr, action: deactivate}": "events.off.node: gyr: unknown; did you mean gyro?",
    "{time: 0.5, action: deactivate}": "events.off.node: None: unknown",
    "{time: 0.5, noode: gyro, action: deactivate}": "events.off.noode: unknown; did you mean node?",
    "{time: 0.5, node: estimator, action: set, parameter: gian, value: 2.0}": "events.off.parameter: gian: unknown; "
    "did you mean gain?",
    "{time: 0.5, node: estimator, action: set, parameter: window, value: 2}": "events.off.parameter: window cannot "
    "change in flight",
    "{time: 0.5, node: estimator, action: set, parameter: gain, value: 20.0}": "events.off.value: gain: 20.0 given",
    "{time: 0.5, node: estimator, action: set, parameter: gain}": "events.off.value: gain: None given",
    "{time: 0.5, node: estimator, action: set}": "events.off.parameter: '': unknown",
    "3.0": "events.off",
}


@pytest.mark.parametrize("event", EVENT_ERRORS)
def test_events(event):
    message = refusal(shared(f"events: {{off: {event}}}"))
    assert message.startswith("bench.yaml: /**: ")
    assert EVENT_ERRORS[event] in message


CRITERIA_ERRORS = {
    "{pointing: {most: 1.0}}": "criteria.pointing.most: unknown, expected min or max",
    "{pointing: {max: 1}}": "criteria.pointing.max: 1 given, expected a number written with a point",
    "{pointing: {max: .nan}}": "criteria.pointing.max: nan given, expected a number",
    "{pointing: 5.0}": "criteria.pointing",
}


@pytest.mark.parametrize("criteria", CRITERIA_ERRORS)
def test_criteria(criteria):
    message = refusal(shared(f"criteria: {criteria}"))
    assert message.startswith("bench.yaml: /**: ")
    assert CRITERIA_ERRORS[criteria] in message


OVERRIDE_ERRORS = {
    "io.deadline": "'io.deadline' is no override, expected KEY=VALUE",
    "io.deadlin=1": "override io.deadlin: unknown; did you mean io.deadline?",
    "estimator.gian=1": "override estimator.gian: unknown; did you mean estimator.gain?",
    "estimatr.gain=1": "override estimatr.gain: unknown; did you mean estimator.gain?",
    "gain=1": "override gain: unknown",
    "estimator.gain=much": "override estimator.gain: 'much' given, expected a number written with a point",
    "estimator.gain=20": "override estimator.gain: 20.0 given",
    "estimator.floor=5": "bench.yaml: estimator: floor: 5.0 given, expected at most the gain of 1.0",
    "cells.normals=1,2": "override cells.normals: [1.0, 2.0] given",
    "cells.normals=1,2,x": "override cells.normals: '1,2,x' given",
    "graph.nodes=testbed/source": "controller needs",
    "=1": "override '': unknown",
}


@pytest.mark.parametrize("override", [o for o in OVERRIDE_ERRORS if o != "graph.nodes=testbed/source"])
def test_overrides(override):
    assert OVERRIDE_ERRORS[override] in refusal(HEAD, override)


def test_files_that_are_not_there(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SUNPOINT_HOME", str(tmp_path))
    monkeypatch.setenv("AMENT_PREFIX_PATH", "")
    with pytest.raises(MissionError, match=r"^missing\.yaml: no such mission file$"):
        load_mission("missing.yaml")
    with pytest.raises(MissionError, match=r"^\./missing: no such mission file$"):
        load_mission("./missing")
    (tmp_path / "config").mkdir()
    (tmp_path / "config" / "bench.yaml").write_text(HEAD)
    assert find_mission("bench") == tmp_path / "config" / "bench.yaml"
    assert load_mission("bench").name == "bench"
    with pytest.raises(MissionError, match=r"^mission bnech: unknown; did you mean bench\? \(missions: bench\)$"):
        load_mission("bnech")
    (tmp_path / "config" / "folder.yaml").mkdir()
    with pytest.raises(MissionError, match=r"folder\.yaml: no such mission file$"):
        load_mission("config/folder.yaml")
    (tmp_path / "latin.yaml").write_bytes("/**: ä".encode("latin-1"))
    with pytest.raises(MissionError, match=r"^latin\.yaml: cannot be read: "):
        load_mission("latin.yaml")


# Words that mean something in a mission, put together at random: YAML that nearly is one.
WORDS = (
    "/** ros__parameters mission graph nodes io events criteria estimator gyro deadline gain testbed/source time node "
    "action set deactivate parameter value max min autostart 1 0.5 -3 1e-4 .nan true off ~ [] {} & * ? ! | > \" ' % "
    "@ ` - : , # << *x &x"
)
words = st.sampled_from(WORDS.split())
glue = st.sampled_from([" ", ": ", "\n", "\n  ", "\n    ", "\n      ", "{", "}", "[", "]", ", ", ": {", "}\n", ""])
scraps = st.lists(st.tuples(words, glue), max_size=30).map(lambda pairs: "".join(a + b for a, b in pairs))


@given(st.one_of(scraps, scraps.map(lambda s: "/**:\n  ros__parameters:\n    " + s), st.text(max_size=60)))
def test_any_text_is_a_mission_or_refused_in_one_line(text):
    try:
        mission = mission_from_text(text, "bench.yaml")
    except MissionError as error:
        assert str(error).startswith("bench.yaml: ")
        assert len(str(error).splitlines()) == 1
    else:
        assert isinstance(mission, Mission)
