# SPDX-License-Identifier: Apache-2.0
"""Every way in which a mission file can be wrong gives one line that names file, key, value and what was expected."""

import os

import pytest
from hypothesis import given
from hypothesis import strategies as st

from css_common.mission import Mission, find_mission, load_mission, mission_from_text
from css_common.mission_file import MissionError, read_text
from css_common.mission_section import name_for_files
from css_common.places import SECTIONS_INDEX

HEAD = """\
/**:
  ros__parameters:
    mission: {epoch: '2013-06-01T00:00:00Z', name: bench, duration: 1.0, period: 0.1}
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
    "extends: okeefe_2013": "extends: stands at the top, expected below a section",
    "seed: 3": "seed: stands at the top, expected below a section, such as /**: {ros__parameters: ...}",
    "/**:": "/**: expected the one key ros__parameters below it",
    "/**: {ros__parameters: }": "/**: ros__parameters must hold keys and values",
    "/**: 3": "/**: expected the one key ros__parameters below it",
    "/**/mission:\n  name: x": "/**/mission: expected the one key ros__parameters below it",
    "a: {b-c: {ros__parameters: {}}}": "a: expected the name of a node, 'a/b-c' is none",
    "a//b: {ros__parameters: {}}": "a//b: expected the name of a node",
    "'**': {ros__parameters: {}, b: 1}": "**: expected the one key ros__parameters below it",
    "/**: {ros__parameters: 3}": "/**: ros__parameters must hold keys and values",
    "/**: {ros__parameters: [a]}": "/**: ros__parameters must hold keys and values",
    "/**: {ros__parameters: {}, also: 1}": "expected the one key ros__parameters",
    "a: [1, 2": "not valid YAML",
    "a: 1\n b: 2": "not valid YAML",
    "a: !!python/object:os.system x": "line 1: a: the tag !!python/object:os.system is not read by ROS",
    "/**:\n  ros__parameters:\n    mission: {name: !!bool foo}": "line 3: /**.mission.name: the tag !!bool is not read",
    "/**: {ros__parameters: {mission: {epoch: !!timestamp foo}}}": "/**.mission.epoch: the tag !!timestamp is not read",
    "/**: {ros__parameters: {mission: {name: !!binary Zm9v}}}": "/**.mission.name: the tag !!binary is not read by ROS",
    "/**: {ros__parameters: {mission: !!set {a, b}}}": "/**.mission: the tag !!set is not read by ROS",
    "/**: {ros__parameters: {mission: !!omap [a: b]}}": "/**.mission: the tag !!omap is not read by ROS",
    "/**: {ros__parameters: {!!binary mission: {}}}": "the tag !!binary is not read by ROS",
    "/**: {ros__parameters: {mission: {case: !mine 3}}}": "/**.mission.case: the tag !mine is not read by ROS",
    "? ''\n: 1": "line 1: expected a word as key",
    "a: \ud800": "not valid YAML: line 1: '\\ud800' is half a character",
    'a: "\\ud800"': "not valid YAML: line 1: ",
    "a: \x00": "not valid YAML",
    "a:\n\tb: 1": "not valid YAML: line 2: ",
    "a: &x [b]\nc: &y [*x, *x]": "line 2: aliases are not read by ROS",
    "a:\n  <<: {b: 1}": "a: expected the one key ros__parameters below it",
    "{a: " * 10_000: "nested more than 32 deep",
    "a: \x07": "not valid YAML",
    "a: 1\n---\nb: 2": "not valid YAML",
    "? [a, b]\n: 1": "line 1: expected a word as key",
    "? {a: b}\n: 1": "line 1: expected a word as key",
    "[" * 3000: "not valid YAML",
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
    "io: {deadline: -0.5}": "bench.yaml: /**: io.deadline: -0.5 given, expected at least 0.001 and at most 1e+09 [s]",
    "io: {deadline: }": "bench.yaml: /**: io.deadline: None given",
    "io: {deadline: .nan}": "bench.yaml: /**: io.deadline: nan given, expected a finite number",
    "use_sim_time: 3": "bench.yaml: /**: use_sim_time: 3 given, expected true or false",
    "mission.seed: " + "9" * 5000: "/**: mission.seed: '99999999",
    "mission.seed: " + "9" * 19: "/**: mission.seed: 1e+19 given, expected a whole number",
    'mission.description: "a\\eb"': "description: 'a\\x1bb' given, expected one line without control characters",
    "io: {deadline: [0.5]}": "bench.yaml: /**: io.deadline: [0.5] given",
    "io: {deadline: {x: 0.5}}": "bench.yaml: /**: io.deadline.x: unknown; did you mean io.deadline?",
    "io: {body_frame: off}": "bench.yaml: /**: io.body_frame: False given, expected a text",
    "io: {input_matching: newest}": "'newest' given, expected one of exact, latest",
    "autostart: 1": "bench.yaml: /**: autostart: 1 given, expected true or false",
    "cells: {normals: [0.0, 0.0]}": "/**: cells.normals: [0.0, 0.0] given, expected rows of 3 values, not 2",
    "cells: {normals: [0.0, 0, 1.0]}": "cells.normals: [0.0, 0, 1.0] given, expected a list of numbers written with",
    "cells: {normals: [[0.0, 0.0, 1.0]]}": "cells.normals: [[0.0, 0.0, 1.0]] given, expected a list of numbers",
    "cells: {normals: [0.0, 0.0, 2.0]}": "bench.yaml: /**: cells.normals: row 0 has length 2, expected unit vectors",
    "cells: {field_of_view_deg: 200.0}": "/**: cells.field_of_view_deg: 200.0 given, expected at least 1 and at",
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
    text = HEAD.replace("epoch: '2013-06-01T00:00:00Z'", "epoch: tomorrow")
    assert "bench.yaml: /**: mission.epoch: 'tomorrow' is not a UTC instant" in refusal(text)


NODE_ERRORS = {
    ("estimator", "{gian: 2.0}"): "bench.yaml: estimator: gian: unknown; did you mean gain?",
    ("estimator", "{gain: 20.0}"): "bench.yaml: estimator: gain: 20.0 given, expected at least 0 and at most 10",
    ("estimator", "{gain: 2}"): "bench.yaml: estimator: gain: 2 given, expected a number written with a point",
    ("estimator", "{floor: 3.0}"): "bench.yaml: estimator: floor: 3.0 given, expected at most the gain of 1.0",
    ("estimator", "{width_deg: 0.0}"): "0.0 given, expected above 0 and at most 90 [deg]",
    ("estimator", "{fault: all}"): "bench.yaml: estimator: fault: 'all' given, expected one of none, raise, nan",
    ("estimator", "{weights: [1.0]}"): "bench.yaml: estimator: weights: [1.0] given",
    ("estimator", "{orbit: {altitude: 5.0e+5}}"): "bench.yaml: estimator: orbit.altitude: unknown",
    ("estimatr", "{gain: 2.0}"): "bench.yaml: section estimatr: unknown; did you mean estimator? (sections are /** "
    "and the nodes of graph.nodes: source, gyro, estimator, controller)",
    ("/ns/estimator", "{gain: 2.0}"): "bench.yaml: section /ns/estimator: unknown",
    ("/ns/*", "{gain: 2.0}"): "bench.yaml: section /ns/*: unknown",
    ("/*", "{gian: 2.0}"): "bench.yaml: /*: gian: unknown; did you mean gain?",
    ("/**/estimator", "{gian: 2.0}"): "bench.yaml: /**/estimator: gian: unknown; did you mean gain?",
    ("/**/estimator", "{gain: 20.0}"): "bench.yaml: estimator: gain: 20.0 given, expected at least 0 and at most 10",
    ("/**/estimatr", "{gain: 2.0}"): "bench.yaml: section /**/estimatr: unknown; did you mean estimator?",
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
    "os/path": "there is no os/nodes/path.py in this workspace",
    "__main__/x": "expected PACKAGE/EXECUTABLE[:NAME]",
    "this/that": "there is no this/nodes/that.py in this workspace",
    "testbed/estimator:" + "n" * 101: "expected at most 100 letters",
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
    "{pointing: {max: .nan}}": "criteria.pointing.max: nan given, expected a finite number",
    "{pointing: {max: many}}": "criteria.pointing.max: 'many' given, expected a number written with a point",
    "{pointing: {min: 2.0, max: 1.0}}": "criteria.pointing.min: 2.0 given, expected at most the max of 1.0",
    "{pointing: 5.0}": "criteria.pointing: unknown, expected min or max",
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
    "cells.normals=1,2,x": "override cells.normals: [1.0, 2.0, 'x'] given, expected a list of numbers",
    "estimator.gain=": "override estimator.gain: '' given, expected a number",
    "graph.nodes=testbed/source": "controller needs",
    "=1": "override '': unknown",
}


@pytest.mark.parametrize("override", [o for o in OVERRIDE_ERRORS if o != "graph.nodes=testbed/source"])
def test_overrides(override):
    assert OVERRIDE_ERRORS[override] in refusal(HEAD, override)


def test_files_that_are_not_there(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SUNPOINT_HOME", str(tmp_path))
    brings_cells = tmp_path / "install" / "css_sensors"
    (brings_cells / SECTIONS_INDEX).mkdir(parents=True)
    (brings_cells / SECTIONS_INDEX / "css_sensors").touch()
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(brings_cells))
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
    with pytest.raises(MissionError, match=r"folder\.yaml: a mission is a regular file$"):
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


MISSION_ERRORS = {
    "name: ../elsewhere/precious": "mission.name: '../elsewhere/precious' given, expected a name for files",
    "name: /tmp/x": "mission.name: '/tmp/x' given",
    "name: ..": "mission.name: '..' given",
    "name: .hidden": "mission.name: '.hidden' given",
    "name: -rf": "mission.name: '-rf' given",
    "name: ''": "mission.name: '' given",
    'name: "\U0001f680"': "mission.name: '\U0001f680' given",
    'name: "a\\0b"': r"mission.name: 'a\x00b' given, expected one line without control characters",
    'name: "a\\nb"': r"mission.name: 'a\nb' given, expected one line without control characters",
    "name: " + "n" * 5000: "expected a name for files of at most 100 bytes",
    "name: " + "ü" * 51: "expected a name for files of at most 100 bytes",
    "duration: 0.05": "mission.duration: 0.05 s given, 0.5 steps of mission.period 0.1 s, expected 1 to",
    "duration: 3.2e+7\n      period: 0.001": "mission.duration: 3.2e+07 s given, 3.2e+10 steps",
    "duration: 1e+300": "mission.duration: 1e+300 given, expected above 0 and at most 3.2e+08 [s]",
    "epoch: 9999-12-31": "9999-12-31 given, expected one between 1970-01-01 and 2038-01-19: ",
    "epoch: 9999-12-31T23:59:59-23:59": "between 1970-01-01 and 2038-01-19",
    "epoch: 0001-01-01T00:00:00+23:59": "between 1970-01-01 and 2038-01-19",
    "epoch: 2038-01-19T03:14:08Z": "between 1970-01-01 and 2038-01-19",
    "epoch: 1969-12-31T23:59:59Z": "between 1970-01-01 and 2038-01-19",
    "epoch: 2016-12-31T23:59:60Z": "2013-06-01T00:00:00Z; ROS stamps know no leap second",
    "epoch: 1:30": "mission.epoch: '1:30' is not a UTC instant",
    "period: 1:30": "mission.period: '1:30' given, expected a number written with a point [s]",
    "case: 010.0": "mission.case: 10.0 given, expected a whole number",
    "seed: -1": "mission.seed: -1 given, expected at least 0 and at most 9223372036854775807",
}


@pytest.mark.parametrize("line", MISSION_ERRORS)
def test_name_time_and_numbers_of_a_mission(line):
    message = refusal(f"/**:\n  ros__parameters:\n    mission:\n      {line}\n")
    assert message.startswith("bench.yaml: /**: ")
    assert MISSION_ERRORS[line] in message


@pytest.mark.parametrize("name", ["okeefe_2013", "x", "Flug 7 (2)", "v1.2-rc+3", "été", "ü" * 50])
def test_names_that_are_names_for_files(name):
    assert mission_from_text(HEAD.replace("bench", f'"{name}"'), "bench.yaml").name == name
    assert name_for_files(name) == name


@pytest.mark.parametrize(
    ("text", "name"),
    [("a/b", "a_b"), ("../x", "_.._x"), ("", "_"), ("(1)", "_(1)"), ("\U0001f680", "_"), ("ü" * 60, "ü" * 50)],
)
def test_what_is_no_name_is_made_one(text, name):
    assert name_for_files(text) == name
    assert mission_from_text(HEAD.replace("bench", f'"{name_for_files(text)}"'), "bench.yaml").name == name


def test_flight_that_ends_within_a_step_says_so():
    assert mission_from_text(HEAD, "bench.yaml").remarks == ()
    (remark,) = mission_from_text(HEAD, "bench.yaml", ["mission.duration=1.26"]).remarks
    assert remark == ("mission.duration: 1.26 s is no multiple of mission.period 0.1 s: 13 steps are flown, 1.3 s")


def shared_lines(form: str, count: int) -> str:
    """A shared section of many lines."""
    return HEAD + "".join("    " + form.format(i) + "\n" for i in range(count))


LARGE = {
    "keys": (shared_lines("k{}: 1", 20_000), "k0: unknown"),
    "keys like known ones": (shared_lines("mission.duratio{}: 1.0", 20_000), "did you mean mission.duration?"),
    "a long key": (shared_lines("? " + "k" * 100_000 + "\n    : 1", 1), "...: unknown"),
    "sections": ("".join(f"s{i}: {{ros__parameters: {{a: 1}}}}\n" for i in range(20_000)), "section s0: unknown"),
    "nodes": (HEAD.replace("[", "[" + "testbed/gyro, " * 20_000), "graph.nodes: 20004 given, expected at most 64"),
    "events": (shared_lines("events.e{}: {{time: 1.0, node: gyro, action: stop}}", 20_000), "'stop' given"),
    "a list": (shared_lines("cells: {{normals: [" + "0.0, " * 300_000 + "0.0]}}", 1), "expected rows of 3 values"),
    "nesting": (HEAD + "".join(" " * i + "a:\n" for i in range(2_000)), "nested more than 32 deep"),
}


@pytest.mark.timeout(60)  # what grows with the square of the size takes longer, the others take a second
@pytest.mark.parametrize("kind", LARGE)
def test_large_files_are_refused_in_a_moment(kind):
    text, reason = LARGE[kind]
    assert reason in refusal(text)


FILES = {
    "mark of UTF-8": (HEAD.encode("utf-8-sig"), None),
    "UTF-16 with its mark": (HEAD.encode("utf-16"), None),
    "other ends of lines": (HEAD.replace("\n", "\r\n").encode(), None),
    "UTF-16 without a mark": (HEAD.encode("utf-16-be"), "x.yaml: not valid YAML"),
    "NUL": (HEAD.encode() + b"\0", "x.yaml: not valid YAML"),
    "half a pair of surrogates": (HEAD.encode() + b"\xed\xa0\x80", "x.yaml: cannot be read: "),
    "tabs": (HEAD.replace("  ", "\t").encode(), "x.yaml: not valid YAML: line 2: "),
    "nothing": (b"", "x.yaml: holds no parameters"),
    "a comment": (b"# none\n", "x.yaml: holds no parameters"),
    "too much": (b"#" * 4_000_001, "x.yaml: cannot be read: 4000001 bytes, expected at most 4000000"),
}


@pytest.mark.parametrize("kind", FILES)
def test_bytes_of_a_file(kind, tmp_path):
    data, reason = FILES[kind]
    (tmp_path / "x.yaml").write_bytes(data)
    if reason is None:
        assert load_mission(tmp_path / "x.yaml").name == "bench"
    else:
        with pytest.raises(MissionError) as caught:
            load_mission(tmp_path / "x.yaml")
        assert reason in str(caught.value)


def test_what_is_no_file(tmp_path):
    os.mkfifo(tmp_path / "pipe.yaml")
    for path in (tmp_path, tmp_path / "pipe.yaml", "/dev/zero", "/dev/null"):
        with pytest.raises(MissionError, match=r": a mission is a regular file$"):
            load_mission(path)
    for path in (tmp_path / "pipe.yaml", "/dev/zero", tmp_path):
        with pytest.raises(MissionError, match=r": cannot be read: expected a regular file$"):
            read_text(path)
    for path in ("a\0b.yaml", "a\udcff.yaml", f"{'n' * 300}.yaml", f"{'n' * 5000}.yaml"):
        with pytest.raises(MissionError, match=r": no such mission file$"):
            load_mission(path)
        with pytest.raises(MissionError, match=r": cannot be read: "):
            read_text(path)
