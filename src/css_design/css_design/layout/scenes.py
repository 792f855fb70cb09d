# SPDX-License-Identifier: Apache-2.0
"""Where the Sun and the Earth are when a layout of cells is judged: directions over the sphere, places of the orbit.

In each scene the Sun is in one direction in b and the Earth, with the light that the mission's own model of it gives,
where a sunlit place of the orbit and a turn about the Sun line put it.
"""

import math
from typing import NamedTuple

import numpy as np

from css_common.mission import Mission, MissionError
from css_common.vectors import Mat3, mat3
from css_design.errors import DesignError
from css_monte_carlo.mission_flight import MissionFlight
from css_monte_carlo.mission_parts import NoPlace
from css_sim.nodes.css_array import CssArray

DIRECTIONS, AROUND_ARRAY, PLACES, TURNS = 200, 60, 4, 3
CONE_DEG = 30.0
"""Half angle about the normal of the arrays within which the control holds the Sun: power positive."""

_GOLDEN = math.pi * (3.0 - math.sqrt(5.0))


class Scenes(NamedTuple):
    """S scenes.

    Attributes:
        suns_b: (S, 3) unit vectors to the Sun.
        dcm_bn: (S, 3, 3) rotations from n to b.
        place: (S,) row of `lights` and `flux`.
        lights: (P, 192) light of the Earth at each place, `earth_light.new_light`.
        flux: (P,) of the Sun [-], 1 at 1 AU.
        weight: (S,) share in the mean; they add to 1.
    """

    suns_b: np.ndarray
    dcm_bn: np.ndarray
    place: np.ndarray
    lights: np.ndarray
    flux: np.ndarray
    weight: np.ndarray


def scenes_of(mission: Mission, pointing: float, directions: int = DIRECTIONS) -> Scenes:
    """The scenes of a mission.

    Args:
        pointing: share of the weight of Suns within 30 deg of the array normal, where the control holds it; the rest is
            spread evenly over the sphere, as a spacecraft finds the Sun.
        directions: over the sphere.

    Raises:
        DesignError: the mission has no cells, or no sunlit place.
    """
    array = next((node for node in mission.nodes if node.component is CssArray), None)
    if array is None:
        raise DesignError(f"{mission.origin}: graph.nodes has no css_sim/css_array, no cells to lay out")
    lights, flux, suns_n = _places(mission, array.name)
    normal = np.asarray(mission.values.spacecraft.array_normal)
    sphere = spread_over(directions, math.pi, normal)
    cone = spread_over(AROUND_ARRAY, math.radians(CONE_DEG), normal)
    shares = (1.0 - pointing, pointing)
    weights = [np.full(len(d), share / len(d)) for d, share in zip((sphere, cone), shares, strict=True)]
    suns, weight = np.concatenate([sphere, cone]), np.concatenate(weights)
    if pointing == 0.0:
        suns, weight = sphere, weights[0]
    count = len(lights) * TURNS
    dcm = np.zeros((len(suns), count, 3, 3))
    for s, sun_b in enumerate(suns):
        for k in range(count):
            # each direction begins at another turn, so that all of them together see the Earth from all sides
            turn = 2.0 * math.pi * ((k % TURNS) / TURNS + s * 0.618)
            dcm[s, k] = _frame(sun_b, 0.0) @ _frame(suns_n[k // TURNS], turn).T
    return Scenes(
        np.repeat(suns, count, axis=0),
        dcm.reshape(-1, 3, 3),
        np.tile(np.repeat(np.arange(len(lights)), TURNS), len(suns)),
        lights,
        flux,
        np.repeat(weight / count, count),
    )


def spread_over(count: int, half_angle: float, axis: np.ndarray) -> np.ndarray:
    """(count, 3) unit vectors spread evenly within an angle [rad] of an axis, on a spiral."""
    height = 1.0 - (np.arange(count) + 0.5) / count * (1.0 - math.cos(half_angle))
    across, angle = np.sqrt(1.0 - height**2), _GOLDEN * np.arange(count)
    local = np.stack([height, across * np.cos(angle), across * np.sin(angle)], axis=1)
    return local @ _frame(axis, 0.0).T


def _frame(first: np.ndarray, turn: float) -> np.ndarray:
    """(3, 3) whose columns are an axis and two across it, turned about it [rad]."""
    first = first / np.linalg.norm(first)
    start = np.eye(3)[int(np.argmin(np.abs(first)))]
    second = np.cross(first, start)
    second /= np.linalg.norm(second)
    third = np.cross(first, second)
    cosine, sine = math.cos(turn), math.sin(turn)
    return np.stack([first, cosine * second + sine * third, cosine * third - sine * second], axis=1)


def dcm_at(scenes: Scenes, s: int) -> Mat3:
    """Rotation of a scene."""
    return mat3(scenes.dcm_bn[s])


def _places(mission: Mission, array: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Light of the Earth, flux of the Sun and its direction in n at sunlit places spread over the orbit."""
    # one Earth for all: layouts are compared under the mean of the clouds
    mean = mission.with_overrides([f"{array}.albedo.draw=mean"])
    try:
        flight = MissionFlight(mean)
    except NoPlace as reason:
        raise DesignError(f"{mission.origin}: {reason}") from reason
    except MissionError as error:
        raise DesignError(str(error)) from error
    states = flight.surroundings.states(0, flight.steps)
    sunlit = np.flatnonzero(states["illumination"] > 0.99)
    if not len(sunlit):
        raise DesignError(f"{mission.origin}: the flight is never in sunlight, nothing to lay out cells for")
    steps = sunlit[np.linspace(0, len(sunlit) - 1, 2 * PLACES + 1).astype(int)[1::2]]
    lights = [flight.surroundings.block(int(step), 1).light[0] for step in steps]
    return np.array(lights), states["solar_flux"][steps].copy(), states["sun_n"][steps].copy()
