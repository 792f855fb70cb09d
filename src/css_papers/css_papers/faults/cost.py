# SPDX-License-Identifier: Apache-2.0
"""What the health of cells costs: the same flights with it and without it."""

import numpy as np

from css_common.mission import Mission
from css_monte_carlo.chunk import fly_cases
from css_monte_carlo.mission_flight import MissionFlight
from css_monte_carlo.study import Configuration

_STEPS = 5000
_FLIGHTS = 3  # the fastest counts: nothing but the loop can make it faster


def cost_ns(mission: Mission, configuration: Configuration) -> float:
    """Processor time [ns] of a step that finding faults takes."""
    mission = configuration.applied(mission).with_overrides(
        [f"mission.duration={min(_STEPS, mission.steps) * mission.period_ns * 1e-9:g}", "mission.epoch_spread_days=0"]
    )
    switch = f"{configuration.estimator}.health.enabled"
    on, off = (_step_ns(mission.with_overrides([f"{switch}={word}"])) for word in ("true", "false"))
    return on - off


def _step_ns(mission: Mission) -> float:
    flight, case = MissionFlight(mission), np.zeros(1, int)
    return min(1e9 * fly_cases(flight, case, flight.steps).cpu_s / flight.steps for _ in range(_FLIGHTS))
