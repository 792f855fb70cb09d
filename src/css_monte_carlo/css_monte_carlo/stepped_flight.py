# SPDX-License-Identifier: Apache-2.0
"""A mission that the compiled loop has no place for: its components are stepped, one case after the other.

The same study as any other, measured by the same sums, some hundred times slower.
"""

import time

import numpy as np

from css_analysis.configured_mission import is_attitude
from css_analysis.errors import StudyError
from css_analysis.flight_metrics import windows_of
from css_common.mission import Mission, MissionError
from css_common.random_streams import RandomKey, random_key
from css_monte_carlo.attitude_guess import takes_guess, with_guess
from css_monte_carlo.attitude_tallies import AttitudeTallies
from css_monte_carlo.case_missions import case_mission
from css_monte_carlo.direct_flight import fly_checked
from css_monte_carlo.log_tallies import tally_attitudes, tally_headings
from css_monte_carlo.measures import ATTITUDE, HEADING, CaseTallies
from css_monte_carlo.mission_parts import is_heading
from css_sim import gyro, initial_conditions
from css_sim.flight_checks import MotionError
from css_sim.nodes.dynamics import Dynamics
from css_sim.nodes.gyro import Gyro


class SteppedFlight:
    """The flights of a mission, all cases of one configuration.

    Attributes:
        mission: what flies.
        measure: how the estimator of interest is measured.
    """

    def __init__(self, mission: Mission, estimator: str | None = None) -> None:
        """Looks at the estimator.

        Args:
            estimator: node whose estimates are measured, None: `graph.estimator`.

        Raises:
            MissionError: there is no such node, or it estimates neither Sun nor attitude.
        """
        node = mission.node(estimator or mission.values.graph.estimator)
        if not (is_attitude(node) or is_heading(node)):
            raise MissionError(f"{mission.origin}: {node.name} estimates neither Sun nor attitude, nothing to measure")
        self.mission = mission
        self.measure = ATTITUDE if is_attitude(node) else HEADING
        self._estimator = node.name

    def fly(self, numbers: np.ndarray, sample_every: int, guess_deg: float = 0.0) -> tuple[CaseTallies, float]:
        """Running sums of cases (C,), and processor time [s]; `guess_deg` as of `MissionFlight.cases`.

        Raises:
            StudyError: a spacecraft turns faster than can be computed.
        """
        start = time.thread_time()
        period_s = self.mission.period_ns * 1e-9
        tallies = self.measure.new_tallies(
            len(numbers), self.mission.steps, period_s, sample_every, windows_of(self.mission)
        )
        for c, number in enumerate(numbers):
            flown = case_mission(self.mission, int(number))
            key = random_key(flown.values.mission.seed, flown.values.mission.case)
            if guess_deg > 0.0 and takes_guess(flown, self._estimator):
                flown = with_guess(flown, key, guess_deg)
            try:
                log = fly_checked(flown)
            except MotionError as error:
                raise StudyError(f"case {number} of {flown.name}: {error}") from error
            if isinstance(tallies, AttitudeTallies):
                tally_attitudes(tallies, c, log, self._estimator, _gyro_bias(flown, key))
            else:
                tally_headings(tallies, c, log, self._estimator, _wheels(flown, key))
        return tallies, time.thread_time() - start


def _gyro_bias(mission: Mission, key: RandomKey) -> np.ndarray:
    """True bias of the gyro (K, 3) [rad/s] at every step; NaN without a gyro, or with several."""
    nodes = [node for node in mission.nodes if node.component is Gyro]
    if len(nodes) != 1:
        return np.full((mission.steps, 3), np.nan)
    p = gyro.parameters(nodes[0].values)
    errors = gyro.draw_errors(p, key)
    return np.array([gyro.bias_at(p, errors, key, step) for step in range(mission.steps)])


def _wheels(mission: Mission, key: RandomKey) -> np.ndarray:
    """Wheels (N,) of `rigid_body.WHEEL`; none when the plant has none."""
    plants = [node for node in mission.nodes if node.component is Dynamics]
    return initial_conditions.dispersed_body(plants[0].values, key).wheels if plants else np.zeros(0)
