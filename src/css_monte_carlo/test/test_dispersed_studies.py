# SPDX-License-Identifier: Apache-2.0
"""Studies whose cases draw parameters: the same bytes however they are cut, the flights that `fly` flies, and what is
made of them."""

import json
import os
import re
import signal

import numpy as np
import pytest

from css_analysis.errors import StudyError
from css_analysis.estimator_runs import estimator_runs
from css_common.drawn_mission import drawn
from css_common.mission import load_mission, mission_from_text
from css_monte_carlo import worst_case
from css_monte_carlo.case_missions import share_surroundings
from css_monte_carlo.commands.monte_carlo import main
from css_monte_carlo.direct_flight import fly_directly
from css_monte_carlo.mission_flight import MissionFlight
from css_monte_carlo.sensitivity import _indices, sensitivities
from css_monte_carlo.study import Configuration, run_study
from css_monte_carlo.worst_case import find_worst

COARSE = ("mission.period=1.0", "mission.duration=240.0")
DISPERSED = (
    "dispersions.dynamics.spacecraft.inertia.each=normal:0.1",
    "dispersions.css_array.noise=uniform:0.0:0.1",
    "dispersions.css_array.scale_common_error=uniform:0.0:0.2",
)
CONFIGURATION = Configuration("ekf", True)
CASES = 6


def mission(*overrides):
    return load_mission("okeefe_2013", [*COARSE, *overrides])


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("studies") / "dispersed"
    return run_study(mission(*DISPERSED), [CONFIGURATION], CASES, folder, threads=2)


def test_a_case_is_the_flight_of_the_mission_file_in_the_folder(study):
    """As `fly STUDY/mission.yaml --case N` has it."""
    for row in study.cases.to_pylist()[::3]:
        flown = drawn(load_mission(study.folder / "mission.yaml", [f"mission.case={row['case']}"])).mission
        assert flown.node("css_array").values.noise == row["drawn.css_array.noise"]
        (run,) = [run for run in estimator_runs(fly_directly(flown)) if run["estimator"] == "ekf"]
        assert run["heading_error_mean_deg"] == pytest.approx(row["heading_error_mean_deg"], rel=1e-9)


def test_draws_are_columns_and_differ(study):
    noise = study.cases["drawn.css_array.noise"].to_numpy()
    inertia = np.array(study.cases["drawn.dynamics.spacecraft.inertia"].to_pylist()).reshape(CASES, 3, 3)
    assert len(set(noise)) == CASES and np.all((noise > 0.0) & (noise < 0.1))
    np.testing.assert_array_equal(inertia, inertia.transpose(0, 2, 1))


def test_parts_of_a_study_have_the_same_rows(study, tmp_path):
    part = run_study(mission(*DISPERSED), [CONFIGURATION], 2, tmp_path / "part", first_case=3, threads=1)
    assert part.cases.to_pylist() == study.cases.to_pylist()[3:5]


def test_other_dispersions_are_another_study(study):
    with pytest.raises(StudyError, match="holds a study with other parameters"):
        run_study(mission(*DISPERSED[:2]), [CONFIGURATION], CASES, study.folder)


def test_surroundings_are_shared_where_nothing_changes_them():
    assert share_surroundings(mission(*DISPERSED).dispersions)
    for other in (
        "orbit.raan_deg=uniform:0:9",
        "css_array.albedo.factor=uniform:1:2",
        "dynamics.shadow=choice:conical:cylindrical",
    ):
        assert not share_surroundings(mission(f"dispersions.{other}").dispersions)
    flight = MissionFlight(mission(*DISPERSED), "ekf")
    shared, alone = flight.around_case(2), MissionFlight(drawn(mission(*DISPERSED, "mission.case=2")).mission, "ekf")
    assert shared.surroundings is flight.surroundings
    for here, there in zip(shared.surroundings.block(0, 40)[:-1], alone.surroundings.block(0, 40)[:-1], strict=True):
        np.testing.assert_array_equal(here, there)


def test_the_worst_flight_is_the_one_that_its_file_flies(study):
    worst = find_worst(mission(*DISPERSED), CONFIGURATION, study, 24, threads=2)
    values = study.cases["heading_error_mean_deg"].to_pylist()
    assert worst.value is not None and worst.value >= max(values) == worst.in_study and worst.flights <= 30
    (run,) = [r for r in estimator_runs(fly_directly(load_mission(worst.mission))) if r["estimator"] == "ekf"]
    assert run["heading_error_mean_deg"] == pytest.approx(worst.value, rel=1e-9)
    with pytest.raises(StudyError, match="--worst: speed given"):
        find_worst(mission(*DISPERSED), CONFIGURATION, study, 24, "speed")


def test_the_worst_flight_of_a_mission_that_steps_node_by_node(tmp_path):
    """An event that the compiled loop has no place for: the search flies it too, and finds what its file flies."""
    event = ", events: {held: {time: 20.0, node: mrp_control, action: deactivate}}"
    text = f"/**: {{ros__parameters: {{extends: okeefe_2013, mission: {{duration: 30.0, period: 1.0}}{event}}}}}"
    stepped = mission_from_text(text, "held", DISPERSED)
    found = run_study(stepped, [CONFIGURATION], CASES, tmp_path / "s", threads=2)
    quantity = "rate_final_deg_s"
    worst = find_worst(stepped, CONFIGURATION, found, 12, quantity, threads=2)
    assert worst.flights > 0 and worst.value is not None
    assert worst.value >= max(found.cases[quantity].to_pylist()) == worst.in_study
    (run,) = [r for r in estimator_runs(fly_directly(load_mission(worst.mission))) if r["estimator"] == "ekf"]
    assert run[quantity] == pytest.approx(worst.value, rel=1e-9)


def test_ctrl_c_ends_the_search_with_the_worst_so_far(tmp_path, capsys, monkeypatch):
    flown, fly = [], worst_case._Search._fly

    def interrupted(search, x):
        flown.append(x)
        if len(flown) == 3:
            os.kill(os.getpid(), signal.SIGINT)
        return fly(search, x)

    monkeypatch.setattr(worst_case._Search, "_fly", interrupted)
    folder = tmp_path / "s"
    arguments = [
        "okeefe_2013",
        "--cases",
        "6",
        "--duration",
        "120",
        "--set",
        "mission.period=1.0",
        "--out",
        str(folder),
    ]
    options = [
        "--disperse",
        "css_array.noise=uniform:0:0.1",
        "--worst",
        "--worst-flights",
        "500",
        "--gyro",
        "on",
        "off",
    ]
    assert main([*arguments, *options, "--no-report", "--json"]) == 130
    printed = capsys.readouterr()
    told = " ".join(printed.out.split())
    assert re.search(r"worst heading_error_mean_deg found: .* in the study; \d+ flights more, interrupted", told)
    assert "Traceback" not in printed.err
    (worst,) = json.loads(printed.out.splitlines()[-1])["worst"]  # of the second configuration none was looked for
    assert worst["interrupted"] and worst["flights"] < 100 and worst["value"] >= worst["worst_of_study"]
    assert worst["mission"] == str(folder / "worst_ekf_gyro.yaml") and load_mission(worst["mission"]).name


def test_indices_of_a_known_function():
    """Of y = x1 + 2 x2 the shares are 1/5 and 4/5, that of the draws of the case 0."""
    base = 512
    settings = ("sampling.method=saltelli", f"sampling.cases={base}")
    two = ("dispersions.css_array.noise=uniform:0:1", "dispersions.css_array.bias=uniform:0:1")
    designed = mission(*two, *settings)
    rows = [drawn(designed.with_overrides([f"mission.case={row}"])).values for row in range(5)]
    assert len(rows) == 5
    from css_common.sampling import groups_of, saltelli_rows

    points = saltelli_rows(groups_of(designed.dispersions), base, designed.values.mission.seed)
    found = _indices(designed, {}, "y", points[:, 0] + 2.0 * points[:, 1])
    first = {index.parameter: index for index in found.indices}
    # by name: bias, then noise
    assert first["css_array.bias"].first == pytest.approx(0.2, abs=0.03)
    assert first["css_array.noise"].total == pytest.approx(0.8, abs=0.06)
    assert first["draws of the case"].total == 0.0
    assert abs(first["css_array.noise"].first - 0.8) < 2.0 * first["css_array.noise"].first_half


def test_the_command_prints_what_matters(tmp_path, capsys):
    arguments = ["okeefe_2013", "--cases", "16", "--duration", "400", "--set", "mission.period=1.0", "--json", "--out"]
    dispersed = ["--disperse", "css_array.noise=uniform:0:0.1", "--sensitivity", "heading_error_mean_deg"]
    assert main([*arguments, str(tmp_path / "s"), *dispersed]) == 0
    printed = capsys.readouterr().out
    result = json.loads(printed.splitlines()[-1])
    assert result["cases"] == 16 * 4 and "draws of the case" in printed
    (found,) = result["sensitivity"]
    assert [i["parameter"] for i in found["indices"]] != [] and found["base_points"] == 16
    low, high = result["configurations"][0]["interval_95"]["heading_error_mean_deg"]
    assert low < result["configurations"][0]["heading_error_mean_deg"] < high


@pytest.mark.parametrize(
    ("options", "error"),
    [
        (["--sampling", "lhs"], "--sampling: the mission disperses nothing"),
        (["--sensitivity"], "--sensitivity: the mission disperses nothing"),
        (["--disperse", "css_array.noise"], "is no override"),
        (["--disperse", "css_array.noise=uniform:0:0.1", "--sensitivity", "--sampling", "lhs"], "no --sampling"),
    ],
)
def test_what_cannot_be_is_said(options, error, capsys, tmp_path):
    assert main(["okeefe_2013", "--out", str(tmp_path / "s"), *options]) == 2
    assert error in capsys.readouterr().err


def test_a_study_of_another_design_has_no_indices(study):
    with pytest.raises(StudyError, match="drawn by random"):
        sensitivities(study)
