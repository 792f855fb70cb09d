# SPDX-License-Identifier: Apache-2.0
"""The estimator of docs/own_estimator.md, which brings its own rate, flies as it stands there."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest

from css_analysis.estimator_runs import estimator_runs
from css_common.mission import mission_from_text
from css_common.preflight import preflight
from css_monte_carlo.chunk import fly_cases
from css_monte_carlo.direct_flight import fly_directly
from css_monte_carlo.mission_flight import MissionFlight
from css_msgs.msg import SunEstimate

GUIDE = Path(__file__).parents[1] / "docs" / "own_estimator.md"
FACES = "1,0,0, -1,0,0, 0,1,0, 0,-1,0, 0,0,1, 0,0,-1"
IDEAL = (
    "mission.duration=40", f"cells.normals={FACES}", "cells.field_of_view_deg=180", "cells.clip_normal=0,0,0",
    "css_array.albedo.enabled=false", "css_array.warp=false", "css_array.degradation=0",
    "alpha_beta_filter.gate=0", "alpha_beta_filter.minimum_output=0",
    "dynamics.initial.attitude=fixed", "dynamics.initial.rate=fixed", "dynamics.initial.omega_deg_s=0.3,-0.2,0.1",
)  # fmt: skip
"""Faces of a cube without errors, whose weighted average is the direction to the Sun."""


@pytest.fixture(scope="module")
def mission(tmp_path_factory):
    """The guide's mission, with its package on the path."""
    folder = tmp_path_factory.mktemp("guide")
    algorithm, node, *_ = re.findall(r"```python\n(.*?)```", GUIDE.read_text(encoding="utf-8"), re.DOTALL)
    (text,) = re.findall(r"```yaml\n(.*?)```", GUIDE.read_text(encoding="utf-8"), re.DOTALL)
    nodes = folder / "my_package" / "nodes"
    nodes.mkdir(parents=True)
    (folder / "my_package" / "alpha_beta.py").write_text(algorithm, encoding="utf-8")
    (nodes / "alpha_beta_filter.py").write_text(node, encoding="utf-8")
    sys.path.insert(0, str(folder))
    yield mission_from_text(text, "guide")
    sys.path.remove(str(folder))
    for name in [name for name in sys.modules if name.split(".")[0] == "my_package"]:
        del sys.modules[name]


def test_it_hears_its_cells_alone_and_says_how_it_smooths(mission):
    node = mission.node("alpha_beta_filter")
    assert [port.topic for port in node.inputs] == ["css/voltages"]
    assert node.component.smoothing(node.values) == (0.02, 0.2)
    assert preflight(mission) == []


def test_its_rate_is_the_one_at_which_the_sun_turns(mission):
    nodes = "graph.nodes=css_sim/dynamics,css_sim/css_array,my_package/alpha_beta_filter"
    log = fly_directly(mission.with_overrides([*IDEAL, nodes]))
    estimate = log.estimates["alpha_beta_filter"]
    assert set(estimate.rate_source.tolist()) == {SunEstimate.RATE_SUN}
    truth, sun_b = log.having("truth").omega_bn_b[-50:], estimate.sun_b[-50:]
    across = truth - np.sum(truth * sun_b, axis=1, keepdims=True) * sun_b
    assert np.linalg.norm(across, axis=1).min() > 2e-3
    np.testing.assert_allclose(estimate.omega_bn_b[-50:], across, atol=1e-4)


def test_it_turns_the_arrays_to_the_sun(mission):
    log = fly_directly(mission.with_overrides(["mission.duration=300"]))
    assert log.flown == "alpha_beta_filter"
    (run,) = estimator_runs(log)
    assert run["flown"] and run["power_positive_s"] is not None and run["power_positive_s"] < 180.0


def test_the_compiled_loop_flies_the_same(mission):
    mission = mission.with_overrides(["mission.duration=10"])
    (trace,) = fly_cases(MissionFlight(mission), np.array([0]), 10, traced=True).trace
    estimate = fly_directly(mission).estimates["alpha_beta_filter"]
    np.testing.assert_array_equal(trace[:, 6:12], np.hstack([estimate.sun_b, estimate.omega_bn_b]))
