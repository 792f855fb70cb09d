# SPDX-License-Identifier: Apache-2.0
"""Flights without a fault in which the Sun is hard to find: none of their sensors is held for failed."""

import numpy as np

from css_analysis.configured_mission import configured
from css_common.mission import load_mission
from css_monte_carlo.direct_flight import fly_and_keep


def test_what_watches_the_gyro_takes_a_dark_cell_for_one_at_right_angles_to_the_sun():
    """Where, as for `ekf`, one with a narrow view said less it took gyro and cells for failed, at 30 s."""
    mission = configured(load_mission("okeefe_2013", ["mission.duration=60"]), case=122, estimator="wavg")
    kept = fly_and_keep(mission, ["wavg/sun_estimate", "health/wavg"])
    assert kept["health/wavg"] == []
    estimates = kept["wavg/sun_estimate"]
    assert len(estimates) >= mission.steps
    assert not np.any([e.isolated | e.sensors_left for e in estimates])
