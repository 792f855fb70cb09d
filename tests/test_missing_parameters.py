# SPDX-License-Identifier: Apache-2.0
"""What no two spacecraft have in common has no default: a mission that does not say it is asked for it, by name."""

import pytest

from css_common.mission import load_mission, mission_from_text
from css_common.mission_file import MissionError
from css_common.node_arguments import mission_of_arguments
from css_common.preflight import preflight
from css_common.stepping import conflict
from css_estimation.nodes.ekf import Ekf
from css_sim.nodes.dynamics import Dynamics

WHOLE = load_mission("okeefe_2013").parameters
NODES = "graph: {nodes: [css_estimation/flat, css_estimation/ekf], estimator: ekf}"
FACES = (
    "cells: {normals: [1.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -1.0]}"
)


def without(*keys):
    """The mission of O'Keefe & Schaub with some keys taken out."""
    shared = {key: value for key, value in WHOLE["/**"].items() if key not in keys}
    return type(load_mission("okeefe_2013"))("mine.yaml", WHOLE | {"/**": shared})


@pytest.mark.parametrize(
    ("key", "asked"),
    [
        ("spacecraft.inertia", "dynamics: spacecraft.inertia: missing, .* for instance spacecraft: {inertia: "),
        ("wheels.axes", "dynamics: wheels.axes: missing, .* for instance wheels: {axes: "),
        ("cells.normals", "css_array: cells.normals: missing, .* for instance cells: {normals: "),
        (
            "orbit.source",
            "dynamics: orbit.source: missing, expected one of elements, tle, ballistic, for instance orbit: ",
        ),
        ("orbit.altitude", "orbit.altitude: missing, .* for instance 400.0e"),
    ],
)
def test_what_is_missing_is_asked_for(key, asked):
    with pytest.raises(MissionError, match=f"mine.yaml: .*{asked}"):
        without(key)


def test_nothing_is_asked_for_that_nobody_needs():
    mission = mission_from_text(
        f"/**: {{ros__parameters: {{{FACES}, graph: {{nodes: [css_estimation/ekf]}}}}}}", "mine"
    )
    assert mission.values.spacecraft.inertia.shape == (0, 3) and mission.values.orbit.source == "none"
    assert mission.values.cells.clip_normal.tolist() == [0.0, 0.0, 0.0]


def test_an_orbit_is_asked_for_by_those_who_ask_a_model():
    with pytest.raises(MissionError, match=r"flat: orbit\.source: missing"):
        mission_from_text(f"/**: {{ros__parameters: {{{FACES}, {NODES}}}}}", "mine")
    text = f"/**: {{ros__parameters: {{{FACES}, {NODES}, eclipse.source: sensors}}}}"
    assert mission_from_text(text, "mine").node("flat").values.eclipse.source == "sensors"


@pytest.mark.parametrize("kind", [Ekf, Dynamics])
def test_a_node_by_itself_asks_when_it_has_its_parameters(kind):
    mission = mission_of_arguments(kind, [])
    node = mission.node_of(kind, kind.__name__.lower())
    assert "missing" in conflict(kind, node.canonical)
    assert preflight(mission, kind) == []
