# SPDX-License-Identifier: Apache-2.0
"""A cell that fails in front of estimators of the attitude: each leaves it out, says so, and errs no more for it."""

import numpy as np
import pytest

from css_analysis.estimate_errors import attitude_errors
from css_common.mission import load_mission
from css_monte_carlo.direct_flight import fly_checked

BEGIN_S = 400.0
NAMES = ("attitude_vector", "attitude_voltage", "triad")
NODES = (
    "graph.nodes=css_sim/dynamics,css_sim/css_array,css_sim/gyro,css_sim/magnetometer,"
    "css_estimation/attitude_filter:attitude_vector,css_estimation/attitude_filter:attitude_voltage,css_estimation/triad"
)


def flown(mission, *changes):
    fault = ("faults.it.target=cell.0", "faults.it.kind=stuck", "faults.it.level=0.7")
    return fly_checked(load_mission(mission, [*changes, *fault]))


@pytest.fixture(scope="module")
def log():
    return flown("cubesat_vmm", "mission.case=1", NODES, f"faults.it.time={BEGIN_S}")


@pytest.mark.parametrize("name", NAMES)
def test_a_stuck_cell_is_left_out_and_costs_no_more_than_its_absence(log, name):
    told = [record for record in log.health if record.node == name]
    assert [(record.target, record.kind, record.end_s) for record in told] == [("cell.0", "stuck", None)]
    # 20 readings or more of a body that turns slowly, one a second
    found_s = told[0].begin_s
    assert BEGIN_S < found_s < BEGIN_S + 60.0
    columns = log.attitudes[name]
    np.testing.assert_array_equal(columns.isolated, np.where(log.time(columns) < found_s, 0, 1))
    steps, errors, _ = attitude_errors(log, name)
    time_s = steps * log.mission.period_ns * 1e-9
    assert errors[time_s > found_s].mean() < 1.5 * errors[time_s < BEGIN_S].mean()


def test_without_health_nothing_is_left_out():
    off = [f"{name}.health.enabled=false" for name in NAMES]
    log = flown("cubesat_vmm", "mission.case=1", NODES, "mission.duration=500", *off, f"faults.it.time={BEGIN_S}")
    assert not log.health
    steps, errors, _ = attitude_errors(log, "triad")
    assert np.degrees(errors[steps > BEGIN_S + 30.0]).max() > 10.0


def test_earthlight_leaves_out_what_the_sun_filter_beside_it_does():
    log = flown("okeefe_earthlight", "mission.case=1", "mission.duration=120", "faults.it.time=60")
    found = {
        name: [(record.target, record.kind, record.begin_s) for record in log.health if record.node == name]
        for name in ("sun_filter", "earthlight")
    }
    assert found["earthlight"] and found["earthlight"] == found["sun_filter"]
    assert log.attitudes["earthlight"].isolated[-1] == log.estimates["sun_filter"].isolated[-1] == 1
