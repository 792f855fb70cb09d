# SPDX-License-Identifier: Apache-2.0
"""A mission with another estimator, another case or without its gyro: as studies fly it, and as a command says it."""

from css_common.mission import Mission, MissionError
from css_common.mission_node import Node
from css_common.sensor_inputs import measures_rates, uses_gyro
from css_msgs.msg import AttitudeEstimate


def configured(
    mission: Mission, *, case: int | None = None, estimator: str | None = None, gyro: bool = True
) -> Mission:
    """A mission with another case, another Sun estimator in the place of the one that flies, the gyro on or off.

    An attitude filter of the graph that is named as the estimator stays where it is; the gyro is then switched for it.

    Raises:
        MissionError: there is no such estimator, or it uses no gyro and shall fly without.
    """
    if case is not None:
        mission = mission.with_overrides([f"mission.case={case}"])
    mission, _ = _with_estimator(mission, estimator)
    return mission.with_overrides(_gyro(mission, estimator, gyro))


def configuring_overrides(mission: Mission, estimator: str, gyro: bool) -> list[str]:
    """KEY=VALUE texts that make of a mission what `configured` makes of it.

    Raises:
        MissionError: as `configured`.
    """
    with_estimator, overrides = _with_estimator(mission, estimator)
    return [*overrides, *_gyro(with_estimator, estimator, gyro)]


def flies_with_gyro(mission: Mission, estimator: str | None = None) -> bool:
    """Whether an estimator flies with a gyro as the mission has it: one is in the graph, and the estimator may use it.

    Of an estimator that has no choice (no parameter `use_gyro`) it is true.

    Raises:
        MissionError: there is no such estimator.
    """
    mission, _ = _with_estimator(mission, estimator)
    node = mission.node(mission.values.graph.estimator if estimator is None else estimator)
    return not uses_gyro(node.component) or bool(node.values.use_gyro and measures_rates(mission.nodes))


def is_attitude(node: Node) -> bool:
    """Whether a node estimates attitude, by the message that it publishes."""
    return any(output.message_type is AttitudeEstimate for output in node.outputs)


def is_attitude_filter(mission: Mission, name: str) -> bool:
    """Whether a node of the graph estimates attitude."""
    return any(node.name == name and is_attitude(node) for node in mission.nodes)


def _gyro(mission: Mission, estimator: str | None, gyro: bool) -> list[str]:
    name = mission.values.graph.estimator if estimator is None else estimator
    if not gyro and not flies_with_gyro(mission, name):
        return []
    if uses_gyro(mission.node(name).component):
        return [f"{name}.use_gyro={'true' if gyro else 'false'}"]
    if not gyro:
        raise MissionError(f"{mission.origin}: gyro off given, but {name} uses no gyro; expected gyro on for it")
    return []


def _with_estimator(mission: Mission, estimator: str | None) -> tuple[Mission, list[str]]:
    """A mission in which another Sun estimator flies, from the graph or in the place of the one that flew."""
    flown = mission.values.graph.estimator
    if estimator in (None, flown) or is_attitude_filter(mission, str(estimator)):
        return mission, []
    names = [node.name for node in mission.nodes]
    overrides = [f"graph.estimator={estimator}"]
    if estimator not in names and flown in names:
        entry = f"{mission.node(flown).package}/{estimator}"
        nodes = [
            entry if name == flown else listed for name, listed in zip(names, mission.values.graph.nodes, strict=True)
        ]
        overrides.insert(0, f"graph.nodes={','.join(nodes)}")
    return mission.with_overrides(overrides), overrides
