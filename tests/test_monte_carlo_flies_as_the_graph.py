# SPDX-License-Identifier: Apache-2.0
"""What the compiled loop proves holds for the flight graph: the same numbers at every step, to the last bit."""

import numpy as np
import pytest
from flights import fly_composed
from listing import estimators_by_mission

from css_analysis.flight_log import read_flight
from css_common.mission import find_mission, load_mission, mission_from_text
from css_estimation.sun.sun_estimator import SunEstimator
from css_monte_carlo.chunk import fly_cases
from css_monte_carlo.direct_flight import configured
from css_monte_carlo.mission_flight import MissionFlight
from css_msgs.msg import SunEstimate

EVENTS = """
    events:
      gyro_off: {time: 20.0, node: gyro, action: deactivate}
      gyro_on: {time: 45.0, node: gyro, action: activate}
"""
# The flight begins in the shadow and leaves it after 31 s, while the gyro is off.
OVERRIDES = ["mission.duration=60.0", "orbit.true_anomaly_deg=269.75"]
CASE = 7
FLOWN = estimators_by_mission(SunEstimator)
SAFE_HOLD = [(name, estimator) for name in FLOWN if name != "okeefe_2013" for estimator in FLOWN[name]]


def trace_of_log(log, estimator):
    """(steps, columns) of a recorded flight in the order of the loop's trace."""
    truth, estimates = log.having("truth"), log.estimates[estimator]
    columns = (truth.sigma_bn, truth.omega_bn_b, estimates.sun_b, estimates.omega_bn_b)
    return np.hstack((*columns, log.having("torque_command").torque, log.having("wheels").speed))


@pytest.mark.parametrize("estimator", FLOWN["okeefe_2013"])
def test_every_step_of_a_case_equals_that_of_the_composed_graph(estimator, tmp_path):
    text = find_mission("okeefe_2013").read_text().replace("    criteria:", EVENTS + "    criteria:")
    mission = mission_from_text(text, "scripted", OVERRIDES)
    flown = configured(mission, case=CASE, estimator=estimator)
    fly_composed(flown, tmp_path / "bag")
    log = read_flight(tmp_path / "bag")
    estimates = log.estimates[estimator]
    assert not log.sunlit[0] and log.sunlit[-1]

    flight = MissionFlight(configured(mission, estimator=estimator))
    trace = fly_cases(flight, np.array([3, CASE, 9]), 10, traced=True).trace[1]
    np.testing.assert_array_equal(trace, trace_of_log(log, estimator))
    assert len(trace) == 600
    sources = np.unique(estimates.rate_source)
    assert len(sources) == 3, "the flight has steps with gyro, with rates from the Sun and without any"


@pytest.mark.parametrize(("name", "estimator"), SAFE_HOLD)
def test_safe_hold_with_magnetometer_and_rods_equals_the_composed_graph(name, estimator, tmp_path):
    """From the shadow, where the rods work, past sunrise."""
    mission = load_mission(name, ["mission.duration=150.0", "orbit.true_anomaly_deg=43.0"])
    fly_composed(configured(mission, case=CASE), tmp_path / "bag")
    log = read_flight(tmp_path / "bag")
    estimates = log.estimates[estimator]
    assert not log.sunlit[0] and log.sunlit[-1]
    assert np.any(log.having("control").dumping)
    assert SunEstimate.RATE_FIELD in estimates.rate_source

    trace = fly_cases(MissionFlight(mission), np.array([CASE]), 10, traced=True).trace[0]
    np.testing.assert_array_equal(trace, trace_of_log(log, estimator))
    assert len(trace) == 300
