# SPDX-License-Identifier: Apache-2.0
"""The turn about the Sun line is looked for with the heading that an Earth left which nobody had predicted."""

import math

import numpy as np
import pytest
from cell_layouts import LAYOUTS
from sun_filter_flight import SunFilterFlight

from css_common.vectors import unit
from css_environment.albedo import albedo_output, new_workspace
from css_estimation.sun_filter.hypotheses import give_up_elsewhere
from css_estimation.sun_filter.memory import DEAD, X_GAIN

CELLS = 6


class UnderClouds(SunFilterFlight):
    """Six faces under an Earth half as bright again as the mean one, and each face under clouds of its own."""

    def __init__(self, seed: int) -> None:
        dice = np.random.default_rng(seed)
        sun_b, omega = unit(tuple(dice.normal(size=3))), tuple(math.radians(0.5) * dice.normal(size=3))
        earth = unit(tuple(dice.normal(size=3)))
        # on the side of the Sun, where the Earth is lit
        super().__init__(sun_b, omega, seed, 0.005, (abs(earth[0]), earth[1], earth[2]), **LAYOUTS["six faces"])
        self.more = 0.5 + 0.45 * dice.normal(size=CELLS)

    def clouds(self, outputs: np.ndarray) -> None:
        light, p = np.zeros(CELLS), self.filter
        albedo_output(self.light, p.cells, p.screen, p.cos_half_view, self.dcm_bn, new_workspace(), light)
        outputs += self.more * light


def test_few_headings_beside_bright_faces_are_beyond_three_error_bars():
    """Not none: the Sun low over one face and the Earth on the opposite one may be taken for each other."""
    found = []
    for seed in range(24):
        flight = UnderClouds(seed)
        for _ in range(15):
            found.append(0.5 * flight.squared_error(flight.fly(10.0, gyro=True, change=flight.clouds)))
    assert 0.5 < np.median(found) < 1.5
    assert np.mean(np.array(found) > 3.0**2) < 0.05


@pytest.fixture
def followed():
    """A flight, and the clouds of three turns that it follows."""
    flight = UnderClouds(1)
    flight.fly(30.0, gyro=True)
    weights = flight.memory.weights
    weights[:] = DEAD
    weights[[2, 5, 7]] = 0.0, -1.0, -3.0
    clouds = flight.memory.estimates[:, X_GAIN + CELLS : X_GAIN + 2 * CELLS]
    clouds[:] = 0.5
    return flight, clouds


def test_a_turn_whose_clouds_are_none_is_given_up_for_another_however_likely_it_is(followed):
    flight, clouds = followed
    clouds[2, 3] = 4.1
    assert not give_up_elsewhere(flight.p, flight.memory)
    assert np.flatnonzero(flight.memory.weights > DEAD).tolist() == [5, 7]
    assert not give_up_elsewhere(flight.p, flight.memory)
    assert np.flatnonzero(flight.memory.weights > DEAD).tolist() == [5, 7]


def test_where_all_clouds_are_none_all_turns_are_kept_to_be_looked_for_again(followed):
    flight, clouds = followed
    clouds[[2, 5, 7], 3] = 4.1, -4.1, 9.0
    assert give_up_elsewhere(flight.p, flight.memory)
    assert np.flatnonzero(flight.memory.weights > DEAD).tolist() == [2, 5, 7]
