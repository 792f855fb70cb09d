# SPDX-License-Identifier: Apache-2.0
"""A mission without errors along a path, and what differences from it come to."""

from collections.abc import Callable

import numpy as np

from css_design.budget.open_loop import Estimates, Path, estimates, readings
from css_design.budget.turning import Follower
from css_estimation.sun.sun_heading import Measured
from css_monte_carlo.mission_flight import MissionFlight

_SEED = 20130601


class Along:
    """A mission without errors along a path, and what differences from it come to."""

    def __init__(self, flight: MissionFlight, path: Path, follower: Follower | None = None) -> None:
        """Runs the estimator on perfect sensors.

        Args:
            flight: of the mission without errors.
            path: that it flew.
            follower: how its body follows; None: it is not said.
        """
        self.flight = flight
        self.path = path
        self.nominal = readings(flight, self.path)
        self.base = estimates(flight, self.path, self.nominal)
        self._follower = follower
        self.random = np.random.default_rng(_SEED + path.case)
        self.runs = 1
        self.second_order = np.zeros(len(path.truth))

    def run(self, measured: Measured) -> np.ndarray:
        """Headings (M, 3) of other readings; those of the nominal where there is no estimate."""
        self.runs += 1
        return self.filled(estimates(self.flight, self.path, measured))

    def filled(self, found: Estimates) -> np.ndarray:
        """Headings of estimates, with those of the nominal where there is none."""
        return np.where((found.known & self.base.known)[:, None], found.sun_b, self.base.sun_b)

    def apart(self, plus: np.ndarray, minus: np.ndarray, share: float) -> np.ndarray:
        """(2, M) squares of the heading's and the pointing's difference [rad^2], at steps that do not count zero.

        Args:
            share: of the difference that is one standard deviation.
        """
        turn = share * np.cross(minus, plus)  # rotation vectors, small
        square = np.sum(turn**2, axis=1)
        followed = np.zeros(len(square))
        if self._follower is not None:
            followed = np.sum(self._follower.follow(turn, self.path.counted) ** 2, axis=1)
        return np.where(self.path.counted, np.stack([square, followed]), 0.0)

    def pair(self, change: Callable[[float], Measured]) -> np.ndarray:
        """Of readings that a parameter changes by plus and minus one standard deviation."""
        plus, minus = self.run(change(1.0)), self.run(change(-1.0))
        self.second_order += self.apart(0.5 * (plus + minus), self.base.sun_b, 1.0)[0]
        return self.apart(plus, minus, 0.5)

    def take_second_order(self) -> np.ndarray:
        """(M,) squares [rad^2] of what all pairs since the last time left of second order."""
        taken, self.second_order = self.second_order, np.zeros_like(self.second_order)
        return taken

    def single(self, measured: Measured) -> np.ndarray:
        """Of readings with an error that is given."""
        return self.apart(self.run(measured), self.base.sun_b, 1.0)
