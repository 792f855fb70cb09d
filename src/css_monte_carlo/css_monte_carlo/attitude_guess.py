# SPDX-License-Identifier: Apache-2.0
"""Attitudes that filters begin with in a study: beside the true one, by a draw of the case."""

import math

from css_common.attitude import mrp_add, rotation_vector_to_mrp
from css_common.mission import Mission
from css_common.mission_node import Node
from css_common.random_streams import RandomKey, Stream, normal4
from css_common.vectors import Vec3
from css_estimation.attitude.attitude_options import GivenStart
from css_estimation.nodes.attitude_filter import AttitudeFilter
from css_sim import initial_conditions
from css_sim.nodes.dynamics import Dynamics


def guessed_start(key: RandomKey, sigma_bn: Vec3, guess_deg: float) -> GivenStart:
    """A start beside the true attitude, by a draw of `guess_deg` [deg] about each axis, 1 sigma."""
    sigma = math.radians(guess_deg)
    x, y, z, _ = normal4(key, Stream.ATTITUDE_GUESS, 0, 0)
    guess = mrp_add(sigma_bn, rotation_vector_to_mrp((sigma * x, sigma * y, sigma * z)))
    return GivenStart(True, guess, sigma**2)


def takes_guess(mission: Mission, estimator: str) -> bool:
    """Whether a node of the graph can begin with a guess, and the plant has an attitude to guess."""
    return _plant(mission) is not None and issubclass(mission.node(estimator).component, AttitudeFilter)


def with_guess(mission: Mission, key: RandomKey, guess_deg: float) -> Mission:
    """The mission of one case, whose attitude filters all begin with the guess of the case."""
    plant = _plant(mission)
    assert plant is not None
    rotation = initial_conditions.initial_state(initial_conditions.parameters(plant.values), key)
    sigma_bn = ",".join(repr(float(c)) for c in guessed_start(key, rotation.sigma_bn, guess_deg).sigma_bn)
    start = ("attitude=given", f"sigma_bn={sigma_bn}", f"sigma_deg={guess_deg!r}")
    filters = [node.name for node in mission.nodes if issubclass(node.component, AttitudeFilter)]
    return mission.with_overrides([f"{name}.start.{line}" for name in filters for line in start])


def _plant(mission: Mission) -> Node | None:
    plants = [node for node in mission.nodes if node.component is Dynamics]
    return plants[0] if plants else None
