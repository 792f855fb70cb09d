# SPDX-License-Identifier: Apache-2.0
"""What people type after `monte-carlo`: results, and one line for what is wrong."""

import json

import pytest

from css_monte_carlo.commands.monte_carlo import main

SHORT = ["okeefe_2013", "--duration", "30", "--set", "mission.period=1.0", "--cases", "3"]


def test_json_on_the_last_line(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "100")
    folder = tmp_path / "s"
    arguments = ["--estimators", "ekf", "wavg", "--gyro", "on", "off", "--sweep", "css_array.noise=0,0.1"]
    assert main([*SHORT, *arguments, "--out", str(folder), "--json"]) == 0
    lines = capsys.readouterr().out.splitlines()
    result = json.loads(lines[-1])
    assert list(result) == [
        "mission",
        "cases",
        "steps",
        "wall_s",
        "cpu_s",
        "cpu_ns_per_case_step",
        "configurations",
        "health",
        "out",
        "warnings",
        "page",
    ]
    assert (result["mission"], result["cases"], result["steps"], result["out"]) == ("okeefe_2013", 3, 30, str(folder))
    flown = [(row["estimator"], row["gyro"], *row["overrides"]) for row in result["configurations"]]
    assert flown == [
        (estimator, gyro, f"css_array.noise={noise}")
        for noise in ("0", "0.1")
        for estimator in ("ekf", "wavg")
        for gyro in ("on", "off")
    ]
    files = ["cases.parquet", "mission.yaml", "percentiles.parquet", "report.html", "study.json"]
    assert sorted(file.name for file in folder.iterdir()) == files
    rows = [line.split()[:3] for line in lines[:-1] if line.split()[:1] in (["ekf"], ["wavg"])]
    assert rows == [[name, gyro, noise] for name in ("ekf", "wavg") for gyro in ("on", "off") for noise in ("0", "0.1")]


def test_a_mean_over_some_of_the_cases_says_over_how_many(tmp_path, capsys, monkeypatch):
    """Those that have not acquired the Sun have no error after it: a mean without them looks better than it is."""
    monkeypatch.setenv("COLUMNS", "100")
    folder = tmp_path / "s"
    arguments = ["okeefe_2013", "--duration", "100", "--set", "mission.period=1.0", "--cases", "6"]
    assert main([*arguments, "--estimators", "wavg", "--out", str(folder), "--json"]) == 0
    lines = capsys.readouterr().out.splitlines()
    (row,) = json.loads(lines[-1])["configurations"]
    known = row["cases_with_value"]["heading_error_mean_deg"]
    assert 0 < known < 6
    assert known == round(6 * row["power_positive_fraction"])
    assert row["cases_with_value"]["power_positive_fraction"] == 6
    (told,) = (line for line in lines if line.startswith(f"only {known} of 6 cases of wavg gyro on have a value of "))
    assert "heading_error_mean_deg" in told and "converging_mean_s" not in told
    assert f", of {known} of 6 cases" in (folder / "report.html").read_text(encoding="utf-8")


def test_a_mission_of_attitude_filters_is_a_study_like_every_other(tmp_path, capsys):
    arguments = ["cubesat_vmm", "--duration", "330", "--cases", "3", "--guess", "20", "--json"]
    assert main([*arguments, "--sweep", "gyro.noise_deg_s=0.03,0.3", "--out", str(tmp_path / "s")]) == 0
    lines = capsys.readouterr().out.splitlines()
    rows = json.loads(lines[-1])["configurations"]
    flown = [(row["estimator"], row["gyro"], *row["overrides"]) for row in rows]
    filters = ("attitude_vector", "attitude_voltage")
    assert flown == [(name, "on", f"gyro.noise_deg_s={noise}") for noise in ("0.03", "0.3") for name in filters]
    assert all(row["first_attitude_s"] == 0.0 and row["steps_without_estimate"] == 0.0 for row in rows)
    quiet, noisy = rows[1]["attitude_error_mean_deg"], rows[3]["attitude_error_mean_deg"]
    assert 0.1 < quiet < noisy
    assert "heading_error_mean_deg" not in rows[0]
    assert any("attitude_voltage" in line for line in lines[:-1])
    assert main([*arguments, "--estimators", "attitude_vectr", "--out", str(tmp_path / "t")]) == 2
    assert "did you mean attitude_vector?" in capsys.readouterr().err


def test_the_seed_changes_the_cases(tmp_path, capsys):
    means = []
    for seed in ("1", "2"):
        assert main([*SHORT, "--seed", seed, "--out", str(tmp_path / seed), "--json"]) == 0
        result = json.loads(capsys.readouterr().out.splitlines()[-1])
        means.append(result["configurations"][0]["converging_mean_s"])
    assert means[0] != means[1]


WRONG = {
    "mission": (["nowhere"], "mission nowhere: unknown"),
    "key": (["--set", "ekf.gat=1"], "override ekf.gat: unknown; did you mean ekf.gate?"),
    "swept key": (["--sweep", "css_array.nois=1,2"], "override css_array.nois: unknown; did you mean css_array.noise?"),
    "sweep without values": (["--sweep", "css_array.noise"], "--sweep css_array.noise: expected KEY=V1,V2,..."),
    "swept value": (["--sweep", "css_array.noise=1,x"], "override css_array.noise: 'x' given, expected a number"),
    "estimator": (["--estimators", "kalman"], "css_estimation/kalman"),
    "cases": (["--cases", "0"], "--cases: 0 given, expected at least 1"),
    "first case": (["--first-case", "-1"], "--first-case: -1 given, expected at least 0"),
    "too many cases": (["--first-case", "4294967295"], "expected cases below 2**32"),
    "threads": (["--threads", "0"], "--threads: 0 given, expected at least 1"),
    "guess": (["--guess", "200"], "--guess: 200 given, expected 0 to 180 [deg]"),
    "sample": (["--sample", "0"], "--sample: 0 given, expected seconds above 0"),
    "duration": (["--duration", "-5"], "mission.duration: -5.0 given, expected above 0 and at most 3.2e+08 [s]"),
    "seed": (["--seed", "-1"], "mission.seed: -1 given, expected at least 0"),
    "estimator with a typo": (["--estimators", "efk"], "did you mean css_estimation/ekf?"),
    "name of a file": (["--sweep", "mission.name=../x,b"], "mission.name: '../x' given, expected a name for files"),
    "folder": (["--out", "/proc/nowhere"], "/proc/nowhere: cannot be written"),
}


NOTHING_TO_FLY = {
    "no node of graph.nodes owns simulated time, nothing can fly": "css_sim/css_array, css_estimation/ekf",
    "no node of graph.nodes estimates Sun or attitude, nothing to measure": "css_sim/dynamics, css_sim/css_array",
}


@pytest.mark.parametrize("reason", NOTHING_TO_FLY)
def test_mission_without_a_plant_or_an_estimator_is_said_before_anything_starts(reason, tmp_path, capsys):
    file = tmp_path / "lacking.yaml"
    file.write_text(f"/**: {{ros__parameters: {{extends: cubesat_vmm, graph: {{nodes: [{NOTHING_TO_FLY[reason]}]}}}}}}")
    for arguments in ([], ["--estimators", "ekf"], ["--gyro", "off"]):
        assert main([str(file), "--out", str(tmp_path / "s"), *arguments]) == 2
        err = capsys.readouterr().err
        assert err == f"monte_carlo: error: {file}: {reason}\n"
        assert not (tmp_path / "s").exists()


@pytest.mark.parametrize("what", WRONG)
def test_one_line_and_code_2_for_what_is_wrong(what, tmp_path, capsys):
    arguments, reason = WRONG[what]
    folder = tmp_path / "s"
    mission = [] if what == "mission" else SHORT
    out = [] if what == "folder" else ["--out", str(folder)]
    assert main([*mission, *out, *arguments]) == 2
    err = capsys.readouterr().err
    assert err.startswith("monte_carlo: error: ") and reason in err
    assert err.count("\n") == 1
    assert not folder.exists(), "nothing is left that looks like a study"
