# SPDX-License-Identifier: Apache-2.0
"""Which node of a mission plays which part in the compiled loop."""

from typing import NamedTuple

from css_analysis.configured_mission import is_attitude
from css_common.component import Component
from css_common.mission import Mission, MissionError
from css_common.mission_node import Node
from css_estimation.nodes.attitude_filter import AttitudeFilter
from css_estimation.nodes.earthlight import Earthlight
from css_estimation.sun.flight_sky import hears_flag
from css_estimation.sun.sun_estimator import SunEstimator
from css_msgs.msg import SunEstimate
from css_sim.nodes.css_array import CssArray
from css_sim.nodes.dynamics import Dynamics
from css_sim.nodes.gyro import Gyro
from css_sim.nodes.magnetometer import Magnetometer
from sunpoint_control.controller import Controller

_PLACES = (Dynamics, CssArray, Controller, Gyro, Magnetometer, SunEstimator, AttitudeFilter, Earthlight)


class NoPlace(MissionError):
    """The compiled loop has no place for something of a mission, which flies as a graph nevertheless."""


class Parts(NamedTuple):
    """Nodes by their part; None for parts that a mission does not have."""

    plant: Node
    array: Node
    control: Node | None
    gyro: Node | None
    magnetometer: Node | None
    heading: Node | None  # the Sun estimator that controls or is measured
    attitude: Node | None  # the attitude filter that is measured


def parts_of(mission: Mission, estimator: str | None = None) -> Parts:
    """Sorts the nodes of a mission.

    Args:
        estimator: node whose estimates are measured, None: `graph.estimator`.

    Raises:
        NoPlace: the graph has a node, or the mission an event, that the compiled loop has no place for.
        MissionError: there is no such estimator.
    """
    node = mission.node(estimator or mission.values.graph.estimator)
    for listed in mission.nodes:
        if not issubclass(listed.component, _PLACES):
            raise _no_place(mission, f"the compiled loop has no place for the node {listed.name}")
    for listed in mission.nodes:
        if hears_flag(listed.values):
            raise _no_place(mission, f"the compiled loop has no place for the eclipse flag of {listed.name}")
    control = _part(mission, Controller)
    parts = Parts(
        plant=_needed(mission, Dynamics),
        array=_needed(mission, CssArray),
        control=control,
        gyro=_part(mission, Gyro),
        magnetometer=_part(mission, Magnetometer),
        heading=node if control is None else mission.node(mission.values.graph.estimator),
        attitude=None,
    )
    if is_attitude(node):
        parts = parts._replace(attitude=node, heading=None if control is None else parts.heading)
    elif parts.heading != node:
        raise _no_place(mission, f"{node.name} does not control, and the compiled loop flies one Sun estimator")
    _check_events(mission, parts)
    return parts


def is_heading(node: Node) -> bool:
    """Whether a node estimates the direction to the Sun, by the message that it publishes."""
    return any(output.message_type is SunEstimate for output in node.outputs)


def measured_estimators(mission: Mission) -> list[str]:
    """Names of the estimators that a study measures unless told: the one that controls, or all if none does.

    Raises:
        MissionError: nothing owns simulated time, or nothing estimates.
    """
    if mission.plant is None:
        raise MissionError(f"{mission.origin}: no node of graph.nodes owns simulated time, nothing can fly")
    flown = [node for node in mission.nodes if node.name == mission.values.graph.estimator and is_heading(node)]
    if flown and _part(mission, Controller) is not None:
        return [flown[0].name]
    names = [node.name for node in mission.nodes if is_attitude(node) or is_heading(node)]
    if not names:
        raise MissionError(f"{mission.origin}: no node of graph.nodes estimates Sun or attitude, nothing to measure")
    return names


def _part(mission: Mission, component: type[Component]) -> Node | None:
    nodes = [node for node in mission.nodes if issubclass(node.component, component)]
    if len(nodes) > 1:
        raise _no_place(mission, f"{nodes[0].name} and {nodes[1].name} are both {component.__name__}; expected one")
    return nodes[0] if nodes else None


def _needed(mission: Mission, component: type[Component]) -> Node:
    node = _part(mission, component)
    if node is None:
        raise _no_place(mission, f"no node of graph.nodes is {component.__name__}, which the compiled loop needs")
    return node


def _check_events(mission: Mission, parts: Parts) -> None:
    switched = [node.name for node in (parts.gyro, parts.magnetometer) if node is not None]
    for event in mission.events:
        if event.action != "set" and event.node not in switched:
            allowed = ", ".join(switched) or "none"
            raise _no_place(mission, f"events.{event.name}: the compiled loop switches sensors alone, here {allowed}")


def _no_place(mission: Mission, reason: str) -> NoPlace:
    return NoPlace(f"{mission.origin}: {reason}")
