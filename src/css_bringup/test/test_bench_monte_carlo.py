# SPDX-License-Identifier: Apache-2.0
"""The comparison with Basilisk, with stand-ins for the three programs it starts: installer, peer and Monte Carlo.

The stand-ins are processes that obey the documented command lines; Basilisk itself is not needed.
"""

import json
import os
import re
import sys
from pathlib import Path

import numpy as np
import pytest

from css_bringup.basilisk import Basilisk, PeerFlight, complaint, install_failure, version_in
from css_bringup.basilisk_scenario import basilisk_scenario, write_zonal_earth
from css_bringup.commands import bench
from css_bringup.json_process import MeasurementError, number, run_for_object
from css_bringup.monte_carlo_bench import Measurement, figures, measure, our_measurement
from css_common.command import FAILED, USAGE
from css_common.mission import load_mission
from css_environment.eclipse import conical_illumination
from css_environment.reflectivity import read_reflectivity, zonal_reflectivity

ROOT = Path(__file__).parents[3]

UV = """#!{python}
import os, sys
open("{log}", "a").write(" ".join(sys.argv[1:]) + "\\n")
if sys.argv[1] == "venv":
    os.makedirs(sys.argv[-1] + "/bin")
    os.symlink({python!r}, sys.argv[-1] + "/bin/python")
"""
PEER = """
import json, sys
scenario = json.load(open(sys.argv[1]))
open("{log}", "a").write("peer " + " ".join(sys.argv[2:]) + "\\n")
albedo = "--albedo" in sys.argv
steps = round(scenario["duration"] / scenario["period"])
print("noise")
print(json.dumps(dict(steps=steps, cpu_s=steps * (200e-6 if albedo else 20e-6), heading_error_mean_deg=2.0,
                      heading_known=1.0, pointing=1.0, albedo_max=0.2 if albedo else 0.0)))
"""
MONTE_CARLO = """#!{python}
import json, sys
open("{log}", "a").write("ours " + " ".join(sys.argv[1:]) + "\\n")
ns = 500.0 if "css_array.albedo.enabled=true" in sys.argv else 250.0
print("progress")
print(json.dumps(dict(mission=sys.argv[1], cases=3, steps=10, cpu_ns_per_case_step=ns,
                      configurations=[dict(estimator="wavg", gyro="on", heading_error_mean_deg=4.9)])))
"""


@pytest.fixture
def workspace(tmp_path, monkeypatch):
    """A project folder and an installed css_monte_carlo, both of stand-ins; `calls` lists what was started."""

    class Workspace:
        home, calls_file = tmp_path / "project", tmp_path / "calls"

        def write(self, file, text, mode=0o644):
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text.replace("{python!r}", repr(sys.executable)).replace("{python}", sys.executable)
                            .replace("{log}", str(self.calls_file)))  # fmt: skip
            file.chmod(mode)

        @property
        def calls(self):
            return self.calls_file.read_text().splitlines()

        uv = home / ".venv" / "bin" / "uv"
        peer = home / "benchmarks" / "basilisk_flight.py"
        monte_carlo = tmp_path / "prefix" / "lib" / "css_monte_carlo" / "monte_carlo"

    made = Workspace()
    made.write(made.uv, UV, 0o755)
    made.write(made.peer, PEER)
    made.write(made.monte_carlo, MONTE_CARLO, 0o755)
    made.write(made.home / "benchmarks" / "requirements-basilisk.lock", "bsk==2.12.1 \\\n    --hash=sha256:00\n")
    made.write(tmp_path / "prefix" / "share" / "ament_index" / "resource_index" / "packages" / "css_monte_carlo", "")
    monkeypatch.setenv("SUNPOINT_HOME", str(made.home))
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{tmp_path / 'prefix'}:{os.environ['AMENT_PREFIX_PATH']}")
    monkeypatch.chdir(ROOT)  # missions are found in config/ here
    return made


def run(*arguments):
    return bench.main(["monte-carlo", *arguments])


def error_line(capfd):
    printed = capfd.readouterr().err.strip()
    assert len(printed.splitlines()) == 1, printed
    return printed


def test_both_sides_are_measured_in_one_run_and_interleaved(workspace, capfd):
    assert run("--json", "--repeats", "2", "--cases", "3", "--duration", "400") == 0
    out = capfd.readouterr().out
    assert json.loads(out.splitlines()[-1]) == {
        "albedo": {"ours_ns": 500.0, "peer_ns": 200_000.0, "ratio": 400.0},
        "no_albedo": {"ours_ns": 250.0, "peer_ns": 20_000.0, "ratio": 80.0},
    }
    assert "Basilisk 2.12.1" in out and "4.90" in out and "2.00" in out
    made, installed, *flights = workspace.calls
    assert made == f"venv --python {sys.executable} {workspace.home / '.cache' / 'basilisk'}"
    assert "--require-hashes" in installed and installed.endswith("benchmarks/requirements-basilisk.lock")
    ours = "ours okeefe_2013 --cases 3 --estimators wavg --gyro on --duration 400.0 --set css_array.albedo.enabled="
    once = ["peer --albedo --estimator wls", f"{ours}true", "peer --no-albedo --estimator wls", f"{ours}false"]
    assert len(flights) == 8
    assert all(flight.startswith(start) for flight, start in zip(flights, 2 * once, strict=True))


def test_basilisk_is_installed_once_and_again_when_the_lock_file_changes(workspace):
    assert run("--repeats", "1") == 0
    assert run("--repeats", "1", "--estimator", "ekf", "--peer-estimator", "okeefe") == 0
    assert sum(call.startswith("venv") for call in workspace.calls) == 1
    assert workspace.calls[-2] == "peer --no-albedo --estimator okeefe"
    assert "--estimators ekf" in workspace.calls[-1]
    workspace.write(workspace.home / "benchmarks" / "requirements-basilisk.lock", "bsk==2.12.2\n")
    assert run("--repeats", "1") == 0
    assert sum(call.startswith("venv") for call in workspace.calls) == 2


def test_an_environment_left_half_made_is_made_anew(workspace):
    half = workspace.home / ".cache" / "basilisk"
    workspace.write(half / "bin" / "python", "half")
    assert not Basilisk(workspace.home).installed
    assert run("--repeats", "1") == 0
    assert Basilisk(workspace.home).installed


# what uv 0.13 prints in these cases
OFFLINE = """error: Failed to fetch: https://pypi.org/simple/bsk/
  cause: error sending request for url (https://pypi.org/simple/bsk/)
  cause: dns error
"""
OFFLINE_CACHE = """error: No solution found when resolving dependencies
  cause: Because bokeh was not found in the cache and you require bokeh==3.9.0, ... are unsatisfiable.

hint: Packages were unavailable because the network was disabled.
"""
OLD_PYTHON = """error: No solution found when resolving dependencies
  cause: Because bokeh==3.9.0 requires Python >=3.10 and you require bokeh==3.9.0, ... are unsatisfiable.
"""


@pytest.mark.parametrize(
    ("output", "said"),
    [
        (OFFLINE, "no network"),
        (OFFLINE_CACHE, "no network"),
        (OLD_PYTHON, f"no packages for Python {sys.version.split()[0]}"),
        ("error: Hash mismatch for bsk\n  cause: expected 1\n", "Hash mismatch for bsk cause: expected 1"),
        ("", "said nothing"),
    ],
)
def test_a_failed_installation_says_why_in_one_line(workspace, capfd, output, said):
    assert said in install_failure("2.12.1", output)
    workspace.write(workspace.uv, f"#!/bin/sh\ncat >&2 <<'END'\n{output}END\nexit 2\n", 0o755)
    assert run() == FAILED
    line = error_line(capfd)
    assert said in line and "Basilisk 2.12.1 could not be installed" in line
    assert "log/bench/basilisk.log" in line
    assert not Basilisk(workspace.home).installed


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("raise ModuleNotFoundError(\"No module named 'Basilisk'\")", "No module named 'Basilisk'; remove "),
        ("print('text')", "Basilisk ended with 'text', expected a JSON object"),
        ("print('[1, 2]')", "expected a JSON object"),
        ("import sys; sys.exit(3)", "failed with exit code 3: without a word"),
    ],
)
def test_a_peer_that_fails_is_one_line(workspace, capfd, body, said):
    workspace.write(workspace.peer, body)
    assert run() == FAILED
    assert said in error_line(capfd)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"heading_error_mean_deg": 35.0}, "does not know the Sun: mean heading error 35.0 deg"),
        ({"heading_error_mean_deg": None}, "give a longer --duration"),
        ({"pointing": 0.5}, "points at the Sun only 50 % of the time"),
        ({"albedo_max": 0.0}, "at most 0.000 of albedo"),
        ({"cpu_s": 0.0}, "give a longer --duration"),
        ({"cpu_s": "fast"}, "gave 'fast' for cpu_s, expected a number"),
    ],
)
def test_the_speed_of_a_flight_that_does_not_work_is_refused(workspace, capfd, changes, said):
    good = {"steps": 10, "cpu_s": 1.0, "heading_error_mean_deg": 2.0, "pointing": 1.0, "albedo_max": 0.2}
    workspace.write(workspace.peer, f"import json\nprint(json.dumps({good | changes!r}))")
    assert run() == FAILED
    assert said in error_line(capfd)


def test_albedo_must_be_where_it_is_asked_for():
    flight = PeerFlight(1.0, 2.0, 1.0, 0.2)
    assert complaint(flight, True) == "" and complaint(flight._replace(albedo_max=0.0), False) == ""
    assert complaint(flight, False) and complaint(flight._replace(albedo_max=0.0), True)


def test_a_missing_monte_carlo_and_a_missing_peer_are_one_line(workspace, capfd):
    workspace.peer.unlink()
    assert run() == FAILED
    assert "basilisk_flight.py" in error_line(capfd)
    workspace.monte_carlo.unlink()
    assert run() == USAGE
    assert "css_monte_carlo has no executable monte_carlo" in error_line(capfd)


@pytest.mark.parametrize("arguments", [["--duration", "0"], ["--duration", "nan"]])
def test_a_wrong_duration_is_one_line(workspace, capfd, arguments):
    assert run(*arguments) == USAGE
    assert "mission.duration" in error_line(capfd)


@pytest.mark.parametrize("count", ["0", "-3", "1.5", "many"])
def test_counts_are_whole_numbers_from_1_on(count, capfd):
    with pytest.raises(SystemExit) as end:
        run("--cases", count)
    assert end.value.code == USAGE
    assert f"{count} given, expected a whole number from 1 on" in capfd.readouterr().err


def test_the_figures_are_medians_of_each_kind():
    times = iter([900.0, 10.0, 500.0, 40.0, 700.0, 20.0])
    sides = {
        "peer": lambda albedo: Measurement(1e5 if albedo else 1e4, 2.0),
        "ours": lambda _: Measurement(next(times), 5.0),
    }
    heard = []
    measured = measure(sides, 3, lambda kind, side: heard.append((kind, side)))
    assert heard[:4] == [("albedo", "peer"), ("albedo", "ours"), ("no_albedo", "peer"), ("no_albedo", "ours")]
    assert figures(measured) == {
        "albedo": {"ours_ns": 700.0, "peer_ns": 1e5, "ratio": 142.9},
        "no_albedo": {"ours_ns": 20.0, "peer_ns": 1e4, "ratio": 500.0},
    }


@pytest.mark.parametrize(
    ("result", "said"),
    [
        ({}, "None for cpu_ns_per_case_step"),
        ({"cpu_ns_per_case_step": float("nan")}, "nan for cpu_ns_per_case_step"),
        ({"cpu_ns_per_case_step": True}, "True for cpu_ns_per_case_step"),
        ({"cpu_ns_per_case_step": 500.0}, "configuration"),
        ({"cpu_ns_per_case_step": 500.0, "configurations": [{}, {}]}, "configuration"),
        ({"cpu_ns_per_case_step": 500.0, "configurations": [{"heading_error_mean_deg": None}]}, "no flight reaches"),
        ({"cpu_ns_per_case_step": 500.0, "configurations": [{"heading_error_mean_deg": 40.0}]}, "mean nothing"),
        ({"cpu_ns_per_case_step": 0.0, "configurations": [{"heading_error_mean_deg": 4.0}]}, "mean nothing"),
    ],
)
def test_a_study_without_figures_is_refused(result, said):
    with pytest.raises(MeasurementError, match=re.escape(said)):
        our_measurement(result)


def test_a_program_that_is_not_there_is_named(tmp_path):
    with pytest.raises(MeasurementError, match=r"peer does not start: .*nothing: No such file"):
        run_for_object("peer", [tmp_path / "nothing"])
    assert number("peer", {"a": 2}, "a") == 2.0


def test_the_lock_file_pins_every_package_by_hash():
    lock = (ROOT / "benchmarks" / "requirements-basilisk.lock").read_text()
    assert version_in(lock) == "2.12.1"
    pinned = re.findall(r"^[\w.-]+==\S+(.*(?:\n    .*)*)", lock, re.MULTILINE)
    assert len(pinned) > 1 and all("--hash=sha256:" in text for text in pinned)
    with pytest.raises(MeasurementError):
        version_in("numpy==2.4.6")


def test_basilisk_reads_the_earth_that_flies_here(tmp_path):
    file = tmp_path / "earth.csv"
    write_zonal_earth(file)
    lines = file.read_text().splitlines()
    assert len(lines) == 36 and {line.count(",") for line in lines} == {71}
    np.testing.assert_allclose(read_reflectivity(file).mean, zonal_reflectivity().mean, atol=1e-6)
    assert float(lines[0].split(",")[0]) > float(lines[-1].split(",")[0])  # Antarctica outshines the Arctic


def test_the_scenario_is_the_mission(tmp_path):
    mission = load_mission("okeefe_2013", ["mission.case=3"])
    scenario = json.loads(json.dumps(basilisk_scenario(mission, tmp_path / "earth.csv"), allow_nan=False))
    r_n, v_n, sun = (np.array(scenario[key]) for key in ("r_n", "v_n", "sun_position_n"))
    assert np.linalg.norm(r_n) == pytest.approx(6_778_137.0)
    normal = np.cross(r_n, v_n)
    assert normal[2] / np.linalg.norm(normal) == pytest.approx(np.cos(np.radians(45.0)))
    assert np.linalg.norm(sun) == pytest.approx(1.014 * 149.6e9, rel=1e-3)  # first of June, a month before aphelion
    assert conical_illumination(tuple(r_n), tuple(sun / np.linalg.norm(sun)), float(np.linalg.norm(sun))) == 1.0
    dcm_en = np.array(scenario["dcm_en"])
    np.testing.assert_allclose(dcm_en @ dcm_en.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(dcm_en[2], (0, 0, 1), atol=2e-3)  # the axis has precessed for 13 years
    assert np.degrees(np.abs(scenario["omega_bn_b"])).max() <= 2.0
    assert (scenario["k"], scenario["p"], scenario["ki"]) == (0.148, 0.9, 1e-4)
    assert scenario["deadband"] == pytest.approx(np.radians(15.0))
    other = basilisk_scenario(mission.with_overrides(["mission.case=4"]), tmp_path / "earth.csv")
    assert tuple(scenario["sigma_bn"]) != other["sigma_bn"]


def test_the_peer_asks_for_nothing_else(tmp_path):
    script = (ROOT / "benchmarks" / "basilisk_flight.py").read_text()
    asked = set(re.findall(r'scenario\["(\w+)"\]', script))
    assert asked == set(basilisk_scenario(load_mission("okeefe_2013"), tmp_path))
