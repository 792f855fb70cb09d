# SPDX-License-Identifier: Apache-2.0
"""Missions on top of other missions."""

import os

import pytest

from css_common.mission import load_mission, mission_from_text
from css_common.mission_extends import sections_of_file, sections_of_text
from css_common.mission_file import MissionError
from css_common.node_arguments import mission_of_arguments
from css_common.node_files import find_component

BASE = """\
/**:
  ros__parameters:
    mission: {name: base, duration: 1.0, period: 0.1, epoch: '2013-06-01T00:00:00Z'}
    graph: {nodes: [testbed/source, testbed/gyro, testbed/estimator, testbed/controller], estimator: estimator}
    cells: {normals: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0]}
    io: {deadline: 0.25, largest_gap: 30.0}
estimator:
  ros__parameters: {gain: 2.0, floor: 0.5, io: {deadline: 0.75}}
"""


def shared(*lines):
    return "/**:\n  ros__parameters:\n" + "".join(f"    {line}\n" for line in lines)


@pytest.fixture
def write(tmp_path):
    """Writes a mission file; its path."""

    def written(name, text):
        file = tmp_path / name
        file.parent.mkdir(exist_ok=True)
        file.write_text(text, encoding="utf-8")
        return str(file)

    written("base.yaml", BASE)
    return written


def test_the_nearest_file_wins_key_by_key_and_lists_are_replaced(write):
    own = "estimator: {ros__parameters: {gain: 3.0}}\n"
    text = shared("extends: base", "mission: {duration: 2.0}", "cells: {normals: [0.0, 0.0, 1.0]}") + own
    mission = load_mission(write("mine.yaml", text))
    estimator = mission.node("estimator").values
    assert (estimator.gain, estimator.floor, estimator.io.deadline) == (3.0, 0.5, 0.75)
    assert (mission.values.mission.duration, mission.values.mission.period) == (2.0, 0.1)
    assert mission.values.cells.normals.tolist() == [[0.0, 0.0, 1.0]]
    assert mission.values.io.largest_gap == 30.0


def test_what_is_for_all_nodes_wins_over_what_the_other_says_for_one(write):
    mission = load_mission(write("mine.yaml", shared("extends: base", "io: {deadline: 0.5}")))
    assert mission.node("estimator").values.io.deadline == 0.5


def test_the_name_is_that_of_the_file_unless_it_has_one(write):
    assert load_mission(write("mine.yaml", shared("extends: base"))).name == "mine"
    assert load_mission(write("mine.yaml", shared("extends: base", "mission: {name: other}"))).name == "other"


@pytest.mark.parametrize("named", ["base", "base.yaml", "./base.yaml", "../base.yaml"])
def test_names_and_paths_are_looked_for_beside_the_file(write, named):
    file = write("below/mine.yaml" if ".." in named else "mine.yaml", shared(f"extends: {named}"))
    assert load_mission(file).values.io.largest_gap == 30.0


def test_names_are_found_among_the_missions_of_the_project(write, tmp_path, monkeypatch):
    monkeypatch.setenv("SUNPOINT_HOME", str(tmp_path))
    write("config/common.yaml", BASE)
    text = shared("extends: common")
    assert load_mission(write("mine.yaml", text)).values.io.largest_gap == 30.0
    assert mission_from_text(text, "text").values.io.largest_gap == 30.0


def test_several_stand_on_top_of_each_other(write):
    write("middle.yaml", shared("extends: base", "io: {deadline: 0.5, largest_gap: 20.0}"))
    mission = load_mission(write("mine.yaml", shared("extends: middle", "io: {largest_gap: 10.0}")))
    assert (mission.values.io.deadline, mission.values.io.largest_gap) == (0.5, 10.0)


def test_sections_of_nodes_that_leave_the_graph_go_with_them(write):
    nodes = "graph: {nodes: [testbed/source, 'testbed/estimator:second', testbed/controller], estimator: second}"
    mission = load_mission(write("mine.yaml", shared("extends: base", nodes)))
    assert [node.name for node in mission.nodes] == ["source", "second", "controller"]
    assert mission.node("second").values.gain != 2.0


def test_a_typo_in_the_other_is_refused_all_the_same(write):
    write("base.yaml", BASE + "estimater: {ros__parameters: {gain: 2.0}}\n")
    with pytest.raises(MissionError, match="section estimater: unknown; did you mean estimator"):
        load_mission(write("mine.yaml", shared("extends: base")))


def test_the_whole_is_written_and_read_again(write):
    file = write("mine.yaml", shared("extends: base", "io: {deadline: 0.5}"))
    text = load_mission(file, ["mission.seed=7"]).text()
    assert "extends" not in text
    again = mission_from_text(text, "recorded")
    assert again.parameters == load_mission(file, ["mission.seed=7"]).parameters


def test_a_node_with_the_file_sees_the_whole(write):
    file = write("mine.yaml", shared("extends: base", "io: {deadline: 0.5}"))
    component = find_component("testbed", "estimator")
    mission = mission_of_arguments(component, ["--ros-args", "--params-file", file])
    assert mission.node("estimator").values.gain == 2.0 and mission.node("estimator").values.io.deadline == 0.5


def test_circles_are_refused_by_name(write):
    write("a.yaml", shared("extends: b"))
    write("b.yaml", shared("extends: c"))
    write("c.yaml", shared("extends: b"))
    with pytest.raises(MissionError, match=r"c\.yaml: extends: b\.yaml -> c\.yaml -> b\.yaml is a circle"):
        sections_of_file(write("mine.yaml", shared("extends: a")))
    itself = write("self.yaml", shared("extends: self"))
    with pytest.raises(MissionError, match=r"self\.yaml -> self\.yaml is a circle"):
        sections_of_file(itself)


@pytest.mark.parametrize("named", ["[base]", "3", "''", "{x: base}"])
def test_what_names_no_mission_is_refused(write, named):
    with pytest.raises(MissionError, match="extends"):
        load_mission(write("mine.yaml", shared(f"extends: {named}")))


@pytest.mark.parametrize("named", ["nowhere", "nowhere.yaml", "below/base", os.devnull])
def test_a_missing_one_is_named_with_the_file_that_asks_for_it(write, named):
    with pytest.raises(MissionError, match=r"mine\.yaml: extends: "):
        load_mission(write("mine.yaml", shared(f"extends: {named}")))


def test_a_text_without_it_is_what_it_was():
    assert sections_of_text(BASE, "x")["estimator"] == {"gain": 2.0, "floor": 0.5, "io.deadline": 0.75}
