# SPDX-License-Identifier: Apache-2.0
"""Every parameter of every node is read by the services that `ros2 param` uses, all of a node in one call."""

import math

import pytest
from listing import MISSIONS, components, executable
from rcl_interfaces.srv import DescribeParameters, GetParameters, GetParameterTypes, ListParameters
from rclpy.parameter import parameter_value_to_python

from css_common.component import Component
from css_common.mission import Mission, MissionError, load_mission
from css_common.testing import Bench


def read_all(bench: Bench, kind: type[Component], name: str, mission: Mission) -> None:
    """Reads all parameters of a node in one call of each service and compares them with the mission."""
    node = bench.host(kind, mission, name, start=False)
    names = list(bench.request(ListParameters, f"{name}/list_parameters", ListParameters.Request()).result.names)
    assert {p.name for p in kind.table()} <= set(names)
    got = bench.request(GetParameters, f"{name}/get_parameters", GetParameters.Request(names=names)).values
    types = bench.request(
        GetParameterTypes, f"{name}/get_parameter_types", GetParameterTypes.Request(names=names)
    ).types
    described = bench.request(
        DescribeParameters, f"{name}/describe_parameters", DescribeParameters.Request(names=names)
    ).descriptors
    assert len(got) == len(types) == len(described) == len(names)
    for parameter, value, of_type, descriptor in zip(names, got, types, described, strict=True):
        assert value.type == of_type == descriptor.type != 0, parameter
        assert descriptor.name == parameter
    values = {parameter: parameter_value_to_python(value) for parameter, value in zip(names, got, strict=True)}
    for parameter, expected in mission.node_of(kind, name).canonical.items():
        found = values[parameter]
        # what a mission does not give is no number
        unknown = isinstance(expected, float) and math.isnan(expected) and math.isnan(found)
        assert unknown or (list(found) if isinstance(expected, list) else found) == expected, parameter
    bench.remove(node)


@pytest.mark.parametrize("name", MISSIONS)
def test_nodes_of_a_mission(name):
    mission = load_mission(name)
    with Bench() as bench:
        for node in mission.nodes:
            read_all(bench, node.component, node.name, mission)


def test_kinds_of_nodes_that_no_mission_flies():
    missions = [load_mission(name) for name in MISSIONS]
    flown = {node.component for mission in missions for node in mission.nodes}
    left = [kind for kind in components() if kind not in flown]
    with Bench() as bench:
        for kind in left:
            name = executable(kind)
            read_all(bench, kind, name, next(mission for mission in missions if fits(mission, kind, name)))


def fits(mission: Mission, kind: type[Component], name: str) -> bool:
    """Whether a mission describes what a node needs."""
    try:
        return bool(mission.node_of(kind, name))
    except MissionError:
        return False
