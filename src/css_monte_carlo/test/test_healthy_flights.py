# SPDX-License-Identifier: Apache-2.0
"""Flights without a fault in which the Sun is hard to find: none of their sensors is held for failed."""

import numpy as np
import pytest

from css_analysis.configured_mission import configured
from css_analysis.flight_metrics import windows_of
from css_common.health import SORT_GYRO
from css_common.mission import load_mission
from css_monte_carlo.case_table import case_table
from css_monte_carlo.direct_flight import fly_and_keep
from css_monte_carlo.stepped_flight import SteppedFlight


def test_what_watches_the_gyro_takes_a_dark_cell_for_one_at_right_angles_to_the_sun():
    """Where, as for `ekf`, one with a narrow view said less it took gyro and cells for failed, at 30 s."""
    mission = configured(load_mission("okeefe_2013", ["mission.duration=60"]), case=122, estimator="wavg")
    kept = fly_and_keep(mission, ["wavg/sun_estimate", "health/wavg"])
    assert kept["health/wavg"] == []
    estimates = kept["wavg/sun_estimate"]
    assert len(estimates) >= mission.steps
    assert not np.any([e.isolated | e.sensors_left for e in estimates])


@pytest.mark.parametrize("bias_deg_h", [0.0, 7200.0])
def test_a_gyro_without_a_fault_that_is_held_for_failed_is_counted_even_where_it_is_used_on(bias_deg_h):
    """Its own bias is taken off: it is not left out, but the node tells of its axes, and no fault acts on them."""
    settings = ["mission.duration=40", f"gyro.bias_deg_h={bias_deg_h}"]
    mission = configured(load_mission("okeefe_2013", settings), case=1, estimator="wavg")
    told = fly_and_keep(mission, ["health/wavg"])["health/wavg"]
    sums, _ = SteppedFlight(mission).fly(np.array([1]), 10)
    (row,) = case_table(np.array([1]), sums, mission.period_ns * 1e-9, windows_of(mission)).to_pylist()
    held = any(SORT_GYRO in sample.sort for sample in told)
    assert held == (bias_deg_h > 0.0)
    assert row["left_sensors"] == row["falsely_left_sensors"] == held


@pytest.mark.parametrize("case", [1, 3])
@pytest.mark.parametrize("gyro", [True, False], ids=["gyro", "no gyro"])
def test_cells_in_a_plane_accuse_neither_the_gyro_nor_one_another(case, gyro):
    """They leave two Suns, and what follows the wrong one was taken for a proof that gyro or cells are wrong."""
    cells = "cells.normals=1,0,0,0,1,0,-1,0,0,0,-1,0", "cells.field_of_view_deg=180", "cells.clip_normal=0,0,0"
    settings = [*cells, "mission.duration=150", f"mission.case={case}", f"sun_filter.use_gyro={str(gyro).lower()}"]
    told = fly_and_keep(load_mission("okeefe_sun_filter", settings), ["sun_filter/sun_estimate", "health/sun_filter"])
    assert not any(e.isolated or e.sensors_left for e in told["sun_filter/sun_estimate"])
    assert told["health/sun_filter"] == []
