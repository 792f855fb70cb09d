# SPDX-License-Identifier: Apache-2.0
"""The Clark missions: what the paper concludes must come out, and a recording serves every estimator."""

import numpy as np
import pytest
from flights import fly_composed
from presence import present
from scipy.spatial.transform import Rotation

from css_analysis.flight_log import read_flight
from css_analysis.flight_metrics import Windows
from css_bringup.replay_bag import mission_of_bag, replay
from css_bringup.replay_pass import parse_request
from css_common.mission import load_mission
from css_estimation.sun.safe_hold import MODE_FLAT, MODE_NO_SUN, MODE_PYRAMID, MODE_PYRAMID_DENIED, MODE_SHADOW
from css_monte_carlo.case_table import case_table
from css_monte_carlo.chunk import fly_cases
from css_monte_carlo.direct_flight import fly_directly
from css_monte_carlo.mission_flight import MissionFlight

CASES = np.arange(6)
TWO_ORBITS = "mission.duration=11290"
DOUBLED = "css_array.albedo.factor=2.0"


@pytest.fixture(scope="module")
def figures():
    """Columns of the case table by configuration: panel-Sun and heading errors over two orbits."""
    flown = {}
    for key, name, overrides in (
        ("flat", "clark_1996_flat", []),
        ("pyramid", "clark_1996_pyramid", []),
        ("doubled", "clark_1996_pyramid", [DOUBLED]),
    ):
        mission = load_mission(name, [TWO_ORBITS, *overrides])
        tallies = fly_cases(MissionFlight(mission), CASES, 1000).tallies
        flown[key] = case_table(CASES, tallies, mission.period_ns * 1e-9, Windows())
    return flown


def mean(table, column):
    return float(np.mean(table[column].to_numpy(zero_copy_only=False)))


def test_pyramid_points_within_ten_degrees_acquisition_included(figures):
    for key in ("pyramid", "doubled"):
        assert mean(figures[key], "pointing_error_sunlit_deg") < 10.0
        assert np.all(figures[key]["acquired_s"].is_valid())


def test_pyramid_does_not_mind_doubled_albedo(figures):
    nominal, doubled = (mean(figures[k], "pointing_error_sunlit_deg") for k in ("pyramid", "doubled"))
    assert abs(doubled - nominal) < 0.5


def test_pyramid_points_better_than_flat_cells_by_the_papers_factor(figures):
    flat, pyramid = (mean(figures[k], "pointing_error_sunlit_deg") for k in ("flat", "pyramid"))
    assert pyramid < 0.6 * flat


def test_flat_cells_err_as_in_the_paper(figures):
    """5.03 deg is the paper's average over sunlight; its attitude differs, ours is 6 deg (docs/clark.md)."""
    assert 4.0 < mean(figures["flat"], "heading_error_sunlit_deg") < 8.0


def test_a_start_that_stares_at_doubled_albedo_finds_the_sun():
    """The panels face the Earth over northern ice, with the Sun 128 deg off them; the flat cells turn them."""
    overrides = [
        DOUBLED,
        "mission.duration=1200",
        "orbit.true_anomaly_deg=105.0",
        "dynamics.initial.rate=fixed",
        "dynamics.initial.omega_deg_s=0,0,0",
        "dynamics.initial.attitude=fixed",
    ]
    mission = load_mission("clark_1996_pyramid", overrides)
    first = fly_directly(load_mission("clark_1996_pyramid", [*overrides, "mission.duration=1"]))
    sigma = _facing_the_earth(first, np.asarray(mission.values.spacecraft.array_normal))
    log = fly_directly(mission.with_overrides([f"dynamics.initial.sigma_bn={','.join(map(repr, sigma))}"]))
    modes = log.estimates["pyramid_switch"].mode
    assert modes[0] == MODE_PYRAMID_DENIED, "all of the pyramid is lit, and it is not believed"
    assert np.degrees(log.pointing_error[0]) > 90.0
    assert modes[-1] == MODE_PYRAMID
    assert np.degrees(log.pointing_error[-1]) < 10.0


def _facing_the_earth(log, array_normal_b):
    """MRP that puts the array normal on nadir, where the light of the Earth comes from while all below is sunlit."""
    nadir_n = -log.truth.r_n[0] / np.linalg.norm(log.truth.r_n[0])
    across_n = np.cross(nadir_n, log.truth.sun_n[0])
    turn, _ = Rotation.align_vectors([array_normal_b, [1.0, 0.0, 0.0]], [nadir_n, across_n])
    return (-turn.as_mrp()).tolist()


def test_a_recording_serves_all_estimators_side_by_side(tmp_path):
    mission = load_mission("clark_1996_pyramid", ["mission.duration=400", "orbit.true_anomaly_deg=50.0"])
    fly_composed(mission, tmp_path / "bag")
    requests = ["pyramid_switch", "flat", "wavg", "ekf"]
    result = replay(
        tmp_path / "bag",
        tmp_path / "replay",
        mission_of_bag(tmp_path / "bag", {}, [], None),
        map(parse_request, requests),
        {},
    )
    by_name = {run.label: run for run in result.replayed}
    assert set(by_name) == set(requests)
    assert present(by_name["pyramid_switch"].comparison).identical
    log = read_flight(tmp_path / "replay")
    assert set(log.estimates) == set(requests)
    assert all(len(log.estimates[name].stamp_ns) == 800 for name in requests)
    flat = log.estimates["flat"].mode
    assert set(flat.tolist()) <= {MODE_NO_SUN, MODE_FLAT, MODE_SHADOW} and np.any(flat == MODE_FLAT)
