# SPDX-License-Identifier: Apache-2.0
"""Budgets against closed forms and against flights: propagation, the Monte Carlo beside it, and recordings."""

import io
import json
import math

import numpy as np
import pytest
from rich.console import Console

from css_bringup.commands import fly
from css_common.command import USAGE
from css_common.mission import load_mission
from css_design.budget import measured, perturbations
from css_design.budget.along import Along
from css_design.budget.budget import budget_of, remark_on
from css_design.budget.measured import Estimate, Split, bound, root_mean_square
from css_design.budget.open_loop import estimates, flown_path, readings
from css_design.budget.perturbations import squares_by_source
from css_design.budget.propagation import rayleigh_percentile
from css_design.budget.recorded import recorded_budget
from css_design.budget.sources import SOURCES, heard_sources, is_active, seeing_everywhere, without
from css_design.budget.turning import Follower
from css_design.commands import budget
from css_design.errors import DesignError
from css_design.new_mission.new_mission import new_mission, read_items
from css_design.verbs.budget import explain_signs
from css_monte_carlo.mission_flight import MissionFlight

STARING = (
    "mission.duration=300", "dynamics.initial.rate=fixed", "orbit.true_anomaly_deg=60", "mrp_control.deadband_deg=0",
    "css_array.albedo.enabled=false", "css_array.warp=false", "css_array.degradation=0", "gyro.noise_deg_s=0",
    "gyro.bias_deg_h=0",
)  # fmt: skip


def quiet(*overrides):
    """Two minutes and more of staring at the Sun, without any error but what is asked for."""
    return load_mission("okeefe_2013", [*STARING, *overrides])


def split_along(mission):
    """Root mean squares [rad] of each source along case 0 of the quiet flight, whatever the estimator, and the path."""
    ideal = quiet()
    path, _ = flown_path(MissionFlight(ideal), 0)
    along = Along(MissionFlight(without(mission, heard_sources(mission))), path)
    # settled: on the way there the edges of views go over the Sun, which is not linear
    rows = path.counted & (np.arange(len(path.counted)) >= 2000)
    return {name: math.sqrt(np.mean(square[0, rows])) for name, square in squares_by_source(mission, along)}, path


def nothing(done, total):
    pass


def test_the_open_loop_is_the_loop_to_the_last_bit():
    mission = load_mission("okeefe_2013", ["mission.duration=60"])
    flight = MissionFlight(mission)
    for case in (0, 3):
        path, said = flown_path(flight, case)
        again = estimates(flight, path, readings(flight, path))
        assert np.array_equal(again.sun_b, said.sun_b)


def test_noise_of_cells_against_the_steady_filter():
    """Of the sunline filter at rest: P = A P A^T + K R K^T with its own gain, solved beside it."""
    sigma = 0.02
    mission = quiet(f"css_array.noise={sigma}")
    found, path = split_along(mission)
    sun = path.sun_b[-1]
    cells = mission.values.cells.normals
    seen = cells[cells @ sun > 0.5]
    p = mission.node("ekf").values
    squares = []
    for normals in (seen,):
        tangent = np.linalg.svd(sun[None])[2][1:]
        h = normals @ tangent.T
        q, r = p.process_sigma**2 * mission.values.mission.period, p.cell_sigma**2
        own, true = np.eye(2), np.zeros((2, 2))
        for _ in range(3000):
            own = own + q * np.eye(2)
            gain = own @ h.T @ np.linalg.inv(h @ own @ h.T + r * np.eye(len(h)))
            left = np.eye(2) - gain @ h
            own = left @ own
            true = left @ true @ left.T + sigma**2 * gain @ gain.T
        squares.append(np.trace(true))
    assert len(seen) >= 3
    # white signs along half a minute of independent errors, two pairs
    assert found["noise"] == pytest.approx(math.sqrt(squares[0]), rel=0.12)


def test_scale_and_tilt_of_cells_against_the_geometry():
    """Of least squares at rest: what a gain or a tilt does to each output, through the pseudo-inverse."""
    scale, tilt = 0.01, 0.2
    base = quiet(f"css_array.scale_cell_error={scale}", f"css_array.misalignment_deg={tilt}")
    nodes = "css_sim/dynamics,css_sim/css_array,css_sim/gyro,css_estimation/wls,sunpoint_control/mrp_control"
    mission = base.with_overrides([f"graph.nodes={nodes}", "graph.estimator=wls"]).with_overrides(["wls.weights=equal"])
    found, path = split_along(mission)
    expected: dict[str, list[float]] = {"calibration": [], "misalignment": []}
    cells = mission.values.cells.normals
    for sun in path.sun_b[2000:][path.counted[2000:]][::50]:
        seen = cells[cells @ sun > 0.5]
        inverse = np.linalg.pinv(seen)
        across = np.eye(3) - np.outer(sun, sun)
        outputs = seen @ sun
        expected["calibration"].append(np.sum((across @ inverse @ np.diag(scale * outputs)) ** 2))
        slopes = np.sqrt(np.maximum(0.0, 1.0 - outputs**2))  # over the angle in the plane of Sun and normal
        expected["misalignment"].append(np.sum((across @ inverse @ np.diag(math.radians(tilt) * slopes)) ** 2))
    for name, squares in expected.items():
        assert found[name] == pytest.approx(math.sqrt(np.mean(squares)), rel=0.05), name


def test_propagation_meets_the_monte_carlo_where_errors_are_ordinary():
    mission = quiet("css_array.noise=0.015", "css_array.scale_cell_error=0.05", "css_array.misalignment_deg=1.5")
    done = []
    found = budget_of(mission, 16, 2, lambda flown, total: done.append((flown, total)), nothing)
    heading = {row.source: row for row in found.parts[0].rows}
    assert set(heading) == {"noise", "calibration", "misalignment", "layout", "filter"}
    for name in ("noise", "calibration", "misalignment"):
        row = heading[name]
        # what is small beside the start of each flight has an interval that begins below zero
        assert row.alone.low <= row.predicted <= row.alone.high or 0.7 < row.ratio < 1.4, heading
    assert 0.7 < heading["calibration"].ratio < 1.4 and 0.7 < heading["misalignment"].ratio < 1.4, heading
    assert done[-1][0] == done[-1][1] == 16 * 10
    whole, summed = found.parts[0].total.value, found.parts[0].predicted_sum
    assert summed == pytest.approx(math.sqrt(sum(row.predicted**2 for row in heading.values())))
    assert summed == pytest.approx(whole, rel=0.35)
    assert found.acquired == 16


def test_noise_of_a_new_cubesat_does_not_add_up_in_the_loop():
    """A body that holds the Sun along one face: four dark cells read what is left of the noise above zero.

    Taken for light, it pulls the estimate off, the body follows, and half an hour later they are a degree off.
    """
    mission = new_mission("mine", *read_items({}, "3u")).mission.with_overrides(["mission.duration=1800"])
    heard = heard_sources(mission)
    ideal = without(mission, heard)
    noise = without(mission, [source for source in heard if source.name != "noise"])
    deaf = noise.with_overrides(["sun_filter.output_low=-10"])
    flown = measured.fly({"none": ideal, "noise": noise, "deaf": deaf}, 4, nothing)
    alone, misled = (root_mean_square(flown[name].heading, flown["none"].heading).value for name in ("noise", "deaf"))
    assert math.degrees(alone) < 0.3 < 0.5 < math.degrees(misled)


@pytest.mark.parametrize("given", ["cells.measured.scales=1,1,1,1,1,1,1,1", "gyro.measured.bias_deg_h=1,2,3"])
def test_a_calibrated_mission_is_refused_with_the_reason(given):
    with pytest.raises(
        DesignError, match=r"okeefe_2013.*measured.* given, .* nobody has calibrated; expected"
    ) as error:
        budget_of(load_mission("okeefe_2013", [given]), 2, 1, nothing, nothing)
    assert "\n" not in str(error.value)


def test_sources_of_a_mission():
    mission = load_mission("okeefe_2013")
    assert [source.name for source in heard_sources(mission) if is_active(mission, source)] == [
        "albedo", "calibration", "gyro",
    ]  # fmt: skip
    ideal = without(mission, heard_sources(mission))
    assert not any(is_active(ideal, source) for source in heard_sources(ideal))
    # of an estimator that knows the response and the losses they are no error
    filtered = load_mission("okeefe_sun_filter")
    calibration = next(source for source in SOURCES if source.name == "calibration")
    assert not is_active(filtered, calibration)
    assert without(filtered, heard_sources(filtered)).node("css_array").values.warp


def test_cells_everywhere_see_everywhere():
    dense = seeing_everywhere(load_mission("okeefe_2013"))
    assert dense is not None
    normals = dense.values.cells.normals
    directions = np.random.default_rng(1).normal(size=(500, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    assert np.min(np.sum(directions @ normals.T > 0.3, axis=1)) >= 6
    assert np.allclose(normals.sum(axis=0), 0.0, atol=0.2)
    assert seeing_everywhere(load_mission("clark_1996_flat")) is None  # it goes by faces


def test_percentile_of_a_mixture_of_rayleighs():
    assert rayleigh_percentile(np.full(10, 2.0), 0.95) == pytest.approx(math.sqrt(-2.0 * math.log(0.05)))
    draws = np.random.default_rng(1).normal(size=(400_000, 2))
    squares = np.repeat([0.5, 2.0, 8.0, 0.0], 100_000)
    errors = np.linalg.norm(draws * np.sqrt(0.5 * squares)[:, None], axis=1)
    assert rayleigh_percentile(squares, 0.95) == pytest.approx(np.quantile(errors, 0.95), rel=0.01)
    assert rayleigh_percentile(np.zeros(3), 0.95) == 0.0
    assert math.isnan(rayleigh_percentile(np.zeros(0), 0.95))


def test_intervals_hold_the_truth_as_often_as_they_say():
    generator = np.random.default_rng(7)
    held = 0
    for _ in range(200):
        squares = generator.normal(size=(40, 2)) ** 2 @ np.ones(2)
        found = root_mean_square(squares)
        held += found.low <= math.sqrt(2.0) <= found.high
    assert 176 <= held <= 199  # bootstraps of skewed sums hold a little less than 95 %
    rows = [np.abs(generator.normal(size=300)) for _ in range(50)]
    found = bound(rows)
    assert found.low < 1.96 < found.high and found.value == pytest.approx(1.96, abs=0.05)


def test_differences_below_zero_keep_their_sign():
    found = root_mean_square(np.array([1.0, 1.0]), np.array([5.0, 5.0]))
    assert found.value == -2.0
    assert math.isnan(root_mean_square(np.array([np.nan])).value)


def test_remarks_say_where_it_disagrees():
    def about(value, width=0.1):
        return Estimate(value, value - width, value + width)

    assert remark_on(1.0, Split(about(1.05), about(1.0)), 2.0) == ""
    assert "more than flights show" in remark_on(2.0, Split(about(1.0), about(1.0)), 2.0)
    assert "flights show more" in remark_on(0.3, Split(about(1.0), about(1.0)), 2.0)
    assert "smaller with it" in remark_on(1.0, Split(about(1.0), about(-1.0)), 2.0)
    assert "costs more beside" in remark_on(1.0, Split(about(1.0), about(2.0)), 2.0)
    assert "hidden by the others" in remark_on(1.0, Split(about(1.0), about(0.2)), 2.0)
    assert "of second order it makes 57.30 deg" in remark_on(0.3, Split(about(1.0), about(1.0)), 2.0, 1.0)
    assert remark_on(0.05, Split(about(0.01, 0.001), about(0.0)), 2.0) == ""  # too small to matter


@pytest.mark.parametrize(("numbers", "words"), [((1.0, math.nan), ""), ((1.0, -0.2), "is less, by the square of")])
def test_a_number_below_zero_is_explained(numbers, words):
    out = io.StringIO()
    explain_signs(numbers, Console(file=out))
    assert words in out.getvalue() and bool(words) == bool(out.getvalue())


def test_the_body_follows_a_steady_error_and_not_a_fast_one():
    mission = load_mission("okeefe_2013", ["mrp_control.deadband_deg=0", "mrp_control.gains.ki=0"])
    follower = Follower.of(mission)
    assert follower is not None
    count, period = 6000, mission.values.mission.period
    time = np.arange(count) * period
    active = np.ones(count, bool)
    steady = follower.follow(np.tile([0.01, 0.0, 0.0], (count, 1)), active)
    assert steady[-1] == pytest.approx([0.01, 0.0, 0.0], rel=1e-3, abs=1e-12)
    # a second-order low-pass: |H| = (K/4) / |K/4 - I w^2 + i P w|
    w, moment, gains = 0.5, 10.5, mission.node("mrp_control").values.gains
    wave = follower.follow(0.01 * np.sin(w * time)[:, None] * [1.0, 0.0, 0.0], active)
    gain = 0.25 * gains.k / abs(complex(0.25 * gains.k - moment * w * w, gains.p * w))
    assert np.max(np.abs(wave[3000:, 0])) == pytest.approx(0.01 * gain, rel=0.1)
    assert Follower.of(load_mission("okeefe_2013")) is None  # a deadband
    active[:3000] = False
    assert not follower.follow(np.ones((count, 3)), active)[:3000].any()


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    folder = tmp_path_factory.mktemp("flights") / "bag"
    options = ["--duration", "150", "--set", "dynamics.initial.rate=fixed", "--set", "orbit.true_anomaly_deg=60"]
    fly.main(["okeefe_2013", *options, "--out", str(folder)])
    return folder


def test_a_recording_is_split_by_its_own_draws(bag):
    found = recorded_budget(bag)
    assert found.remarks == []  # cells and estimates are those of the recording, to the last bit
    rows = {row.source: row for row in found.rows}
    assert set(rows) == {"albedo", "calibration", "gyro", "layout", "filter"}
    assert 0.0 < rows["calibration"].alone < 5.0 and rows["gyro"].alone < rows["calibration"].alone
    assert found.bound.low <= found.bound.value <= found.bound.high
    assert 0.0 < found.total < 5.0 and found.counted_s > 60.0


def test_the_command_on_a_recording(bag, capsys):
    assert budget.main([str(bag), "--json"]) == 0
    told = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert told["mission"] == "okeefe_2013" and told["remarks"] == []
    assert {"source", "alone_deg", "left_out_deg"} == set(told["heading"]["sources"][0])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nowhere"], "mission nowhere: unknown"),
        (["okeefe_2013", "--cases", "1"], "--cases: 1 given, expected 2 to"),
        (["okeefe_2013", "--set", "mrp_control.gains.p=5000"], "gains.p: 5000 given, expected at most"),
        (["esprit_2006"], "ekf is not in the graph"),
        (["cubesat_vmm"], "graph.estimator: ekf is not in the graph, expected a Sun estimator"),
    ],
)
def test_what_is_wrong_is_one_line(arguments, words, capsys):
    assert budget.main(arguments) == USAGE
    assert words in capsys.readouterr().err.splitlines()[-1]


def test_a_folder_that_is_no_recording(tmp_path, capsys):
    assert budget.main([str(tmp_path)]) == USAGE
    assert budget.main([str(tmp_path), "--cases", "5"]) == USAGE
    assert all("budget: error:" in line for line in capsys.readouterr().err.splitlines())


def test_probes_are_pairs_and_the_modules_agree_on_sources():
    assert perturbations.PROBES >= 1
    assert set(measured.configurations(load_mission("okeefe_2013"))) == {
        "all", "none", "+albedo", "-albedo", "+calibration", "-calibration", "+gyro", "-gyro",
        "none, cells everywhere", "all, cells everywhere",
    }  # fmt: skip
