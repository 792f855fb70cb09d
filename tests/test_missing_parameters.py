# SPDX-License-Identifier: Apache-2.0
"""What no two spacecraft have in common has no default: a mission that does not say it is asked for it, by name."""

import pytest
from presence import present

from css_common.mission import Mission, load_mission, mission_from_text
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


def without(*keys, whole=WHOLE):
    """The mission of O'Keefe & Schaub, or another one, with some keys taken out."""
    shared = {key: value for key, value in whole["/**"].items() if key not in keys}
    return Mission("mine.yaml", whole | {"/**": shared})


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
        ("mission.epoch", "dynamics: mission.epoch: missing, expected a text, for instance mission: {epoch: "),
        ("mission.duration", "dynamics: mission.duration: missing, .* for instance mission: {duration: "),
        ("wheels.inertia", "dynamics: wheels.inertia: missing, .* for instance wheels: {inertia: "),
        ("wheels.max_torque", "dynamics: wheels.max_torque: missing, .* for instance wheels: {max_torque: "),
        ("wheels.max_speed_rpm", "dynamics: wheels.max_speed_rpm: missing, .* for instance wheels: {max_speed_rpm: "),
        ("orbit.altitude", "orbit.altitude: missing, .* for instance 400.0e"),
    ],
)
def test_what_is_missing_is_asked_for(key, asked):
    with pytest.raises(MissionError, match=f"mine.yaml: .*{asked}"):
        without(key)


@pytest.mark.parametrize(
    "key",
    [
        "orbit.launch.latitude_deg",
        "orbit.launch.longitude_deg",
        "orbit.launch.azimuth_deg",
        "orbit.launch.elevation_deg",
        "orbit.launch.apogee",
        "payload.axis_azimuth_deg",
        "payload.axis_elevation_deg",
        "payload.spin_hz",
        "payload.coning_period",
        "payload.coning_angle_deg",
    ],
)
def test_a_rocket_is_asked_where_it_starts_and_how_it_turns(key):
    leaf = key.rpartition(".")[2]
    with pytest.raises(MissionError, match=rf"mine.yaml: rocket: {key}: missing, .* for instance .*{leaf}: "):
        without(key, whole=load_mission("esprit_2006").parameters)


def test_an_estimator_that_counts_the_momentum_of_wheels_asks_for_their_inertia():
    whole = load_mission("okeefe_sun_filter").parameters
    alone = {"/**": whole["/**"] | {"graph.nodes": ["css_estimation/sun_filter"]}}
    with pytest.raises(MissionError, match=r"mine.yaml: sun_filter: wheels\.inertia: missing"):
        without("wheels.inertia", whole=alone)
    assert without("wheels.axes", "wheels.inertia", whole=alone)


def test_events_ask_from_when_they_count():
    event = "events: {off: {time: 1.0, node: ekf, action: deactivate}}"
    alone = f"{FACES}, graph: {{nodes: [css_estimation/ekf]}}, eclipse.source: sensors"
    text = f"/**: {{ros__parameters: {{{alone}, {event}}}}}"
    with pytest.raises(MissionError, match=r"mine: /\*\*: mission\.epoch: missing"):
        mission_from_text(text, "mine")
    assert mission_from_text(text.replace("graph:", "mission.epoch: 2026-06-01, graph:"), "mine").events


def test_nothing_is_asked_for_that_nobody_needs():
    mission = mission_from_text(
        f"/**: {{ros__parameters: {{{FACES}, graph: {{nodes: [css_estimation/ekf]}}}}}}", "mine"
    )
    assert mission.values.spacecraft.inertia.shape == (0, 3) and mission.values.orbit.source == "none"
    assert mission.values.cells.clip_normal.tolist() == [0.0, 0.0, 0.0]


def test_an_orbit_is_asked_for_by_those_who_ask_a_model():
    with pytest.raises(MissionError, match=r"flat: orbit\.source: missing"):
        mission_from_text(f"/**: {{ros__parameters: {{{FACES}, {NODES}}}}}", "mine")
    orbit = "orbit: {source: elements, altitude: 400.0e+3}"
    with pytest.raises(MissionError, match=r"flat: mission\.epoch: missing"):
        mission_from_text(f"/**: {{ros__parameters: {{{FACES}, {NODES}, {orbit}}}}}", "mine")
    text = f"/**: {{ros__parameters: {{{FACES}, {NODES}, eclipse.source: sensors}}}}"
    assert mission_from_text(text, "mine").node("flat").values.eclipse.source == "sensors"


@pytest.mark.parametrize("kind", [Ekf, Dynamics])
def test_a_node_by_itself_asks_when_it_has_its_parameters(kind):
    mission = mission_of_arguments(kind, [])
    node = mission.node_of(kind, kind.__name__.lower())
    assert "missing" in present(conflict(kind, node.canonical, node.name))
    assert preflight(mission, kind) == []
