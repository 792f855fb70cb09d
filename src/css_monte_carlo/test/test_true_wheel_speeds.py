# SPDX-License-Identifier: Apache-2.0
"""Tachometers that err in a flight: the truth goes on knowing better."""

import math

import numpy as np
from presence import present

from css_common.mission import load_mission
from css_monte_carlo.direct_flight import fly_directly

RPM = 2.0 * math.pi / 60.0


def test_the_truth_has_the_speeds_that_the_report_lacks():
    nodes = "css_sim/dynamics,css_sim/css_array,css_estimation/wavg"  # nobody hears the wheels: the flight is the same
    changes = ["mission.duration=20.0", "dynamics.initial.wheel_speed_rpm=300", "dynamics.friction.coulomb=0.001"]
    mission = load_mission("okeefe_2013", [f"graph.nodes={nodes}", "graph.estimator=wavg", *changes])
    exact = fly_directly(mission)
    assert exact.true_wheels is None
    rough = fly_directly(mission.with_overrides(["dynamics.tachometer.resolution_rpm=5.0"]))
    np.testing.assert_array_equal(present(rough.true_wheels).speed, exact.having("wheels").speed)
    steps = rough.having("wheels").speed / (5.0 * RPM)
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)
    np.testing.assert_allclose(
        rough.having("wheels").speed, present(rough.true_wheels).speed, atol=2.5 * RPM * (1.0 + 1e-9)
    )
    assert len(np.unique(steps)) > 5
