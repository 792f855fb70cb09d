# SPDX-License-Identifier: Apache-2.0
"""Analysis where there is no ROS: no verb of it asks for ROS, and each leaves the same bytes as with it."""

import ast
import json
import os
import subprocess
from pathlib import Path

import pytest
from listing import ROOT
from without_ros import ROS, packages_laid_out, run

from bootstrap.verbs import VERBS

# two of them compile the loop of a study, when nobody has before
pytestmark = pytest.mark.timeout(900)

ANALYSIS = {name: verb for name, verb in VERBS.items() if verb.package and not verb.ros}
SAMPLES = ROOT / "docs" / "samples"
REFERENCE = ROOT / "bags" / "reference"
OF_THE_CLOCK = {"wall_s", "cpu_s", "cpu_ns_per_case_step", "estimates_per_cpu_s", "realtime_factor"}
"""Keys of results that tell how long it took."""


@pytest.fixture(scope="module")
def without(tmp_path_factory):
    """Packages laid out as where there is no ROS, and ROS out of reach."""
    return packages_laid_out(tmp_path_factory.mktemp("without"))


@pytest.fixture
def both(without, tmp_path):
    """Run a verb with ROS and without, each in a folder of its own; their outputs, with the folders as they are."""

    def run_both(verb, *arguments, expected=(0,)):
        outputs = []
        for name, run_one in (
            ("with", lambda *a, cwd: run(ROOT / "install", os.environ, *a, cwd=cwd)),
            ("without", without.run),
        ):
            folder = tmp_path / name
            folder.mkdir(exist_ok=True)
            done = run_one(verb, *arguments, cwd=folder)
            assert done.returncode in expected, done.stderr
            outputs.append(done.stdout.replace(str(folder), ""))
        return outputs

    return run_both


def files(folder: Path) -> dict[str, bytes]:
    """Contents of all files below a folder by their paths in it."""
    return {str(file.relative_to(folder)): file.read_bytes() for file in sorted(folder.rglob("*")) if file.is_file()}


def assert_same_files(tmp_path, *expected):
    left, here = files(tmp_path / "with"), files(tmp_path / "without")
    assert here.keys() == left.keys()
    assert [name for name in left if left[name] != here[name]] == []
    assert {name for name in expected if name not in here} == set()


def result(output: str):
    """The JSON object on the last line of an output, without times."""
    return without_times(json.loads(output.splitlines()[-1]))


def without_times(value):
    if isinstance(value, dict):
        return {key: without_times(inner) for key, inner in value.items() if key not in OF_THE_CLOCK}
    return [without_times(inner) for inner in value] if isinstance(value, list) else value


def test_ros_is_out_of_reach(without):
    code = (
        "import sys; from css_msgs.msg import SunEstimate as S; print(S.__base__.__name__, S.RATE_GYRO); import rclpy"
    )
    done = subprocess.run(
        [without.project.python, "-c", code], env=without.env, capture_output=True, text=True, check=False
    )
    assert done.stdout == "MessageClass 1\n"
    assert "there is no ROS here" in done.stderr


def imported_packages(file: Path) -> set[str]:
    """Packages that a module imports anywhere, in functions too; not what is for type checkers alone."""
    found = set()
    waiting: list[ast.AST] = [ast.parse(file.read_text(encoding="utf-8"))]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            continue
        if isinstance(node, ast.Import):
            found |= {alias.name.partition(".")[0] for alias in node.names}
        if isinstance(node, ast.ImportFrom) and node.module:
            found.add(node.module.partition(".")[0])
        waiting += ast.iter_child_nodes(node)
    return found


def test_verbs_load_without_ros_or_say_that_they_need_it(without):
    """One that does not has to be declared in `bootstrap.verbs` (`ros=True`)."""
    modules = [
        f"{verb.package}.{room}.{verb.executable}" for verb in ANALYSIS.values() for room in ("commands", "verbs")
    ]
    assert len(modules) >= 14
    code = f"import sys, {', '.join(modules)}; print(*(getattr(m, '__file__', '') for m in sys.modules.values()))"
    done = subprocess.run(
        [without.project.python, "-c", code], env=without.env, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    ours = [Path(file) for file in done.stdout.split() if file.startswith(str(ROOT)) and "site-packages" not in file]
    assert len(ours) > 200
    there = {folder.name for folder in (ROOT / "src/css_msgs/common_interfaces").iterdir()} | {"css_msgs"}
    late = [f"{file}: {name}" for file in ours for name in imported_packages(file) if ROS.fullmatch(name)]
    assert [line for line in late if line.rpartition(" ")[2] not in there] == []


def test_imported_and_replayed_recordings(both, tmp_path):
    both("import-csv", SAMPLES / "my_cells.csv", SAMPLES / "my_layout.yaml", "-o", "mine")
    outputs = both("replay", "mine", "--estimators", "wavg", "--out", "replayed", "--json")
    assert result(outputs[0]) == result(outputs[1])
    assert_same_files(tmp_path, "mine/mine_0.mcap", "replayed/replayed_0.mcap")


def test_a_flight_with_every_kind_of_message_is_mended_and_replayed(both, tmp_path):
    both("recover", REFERENCE, "--output", "mended")
    outputs = both("replay", "mended", "--estimators", "ekf", "--out", "replayed", "--json")
    assert result(outputs[0]) == result(outputs[1])
    assert_same_files(tmp_path, "mended/mended_0.mcap", "replayed/replayed_0.mcap")


def test_studies(both, tmp_path):
    study = ("--cases", "2", "--duration", "20", "--estimators", "ekf")
    outputs = both("monte-carlo", "okeefe_2013", *study, "--out", "study", "--json")
    assert result(outputs[0]) == result(outputs[1])
    assert_same_files(tmp_path, "study/cases.parquet", "study/percentiles.parquet")


def test_a_mission_of_ones_own(both, tmp_path):
    outputs = both("new", "mysat", "--size", "0.1,0.1,0.2", "--mass", "2.6", "--yes", "--json", expected=(0, 1))
    assert result(outputs[0]) == result(outputs[1])
    assert_same_files(tmp_path, "mysat.yaml")


def test_verdicts_on_cells(both):
    outputs = both("check", REFERENCE, "--json", expected=(0, 1))
    assert result(outputs[0]) == result(outputs[1])
    assert result(outputs[0])["cells"]


@pytest.mark.parametrize(
    ("verb", "arguments"),
    [("coverage", ["okeefe_2013"]), ("slit-analyse", [SAMPLES / "my_pulses.csv", "--inclination-deg", "30"])],
)
def test_tables(both, verb, arguments):
    outputs = both(verb, *arguments, "--json")
    assert result(outputs[0]) == result(outputs[1])


def test_pages_of_recordings(both, tmp_path):
    outputs = both("report", REFERENCE, "-o", "page.html", "--json")
    assert result(outputs[0]) == result(outputs[1])
    assert_same_files(tmp_path, "page.html")


def test_pages_of_papers(both, tmp_path):
    outputs = both("reproduce", "esprit", "--quick", "--cases", "2", "--out", "page", "--json")
    assert result(outputs[0]) == result(outputs[1])
    assert len(result(outputs[0])["rows"]) > 5
    assert files(tmp_path / "with").keys() == files(tmp_path / "without").keys()


def test_calibrations(both, tmp_path):
    # 1: a recording of three minutes tells little, and the heading is no better for it
    outputs = both("calibrate", REFERENCE, "--out", "cells.yaml", "--json", expected=(0, 1))
    assert result(outputs[0]) == result(outputs[1])
    assert len(result(outputs[0])["parameters"]) > 10
    assert_same_files(tmp_path, "cells.yaml")


SUNNY = ("--set", "mission.duration=600", "--set", "orbit.true_anomaly_deg=60")


def test_layouts(both, tmp_path):
    outputs = both("layout", "okeefe_2013", *SUNNY, "--out", "found", "--json", "--cells", "2-3")
    assert result(outputs[0]) == result(outputs[1])
    assert_same_files(tmp_path, "found/okeefe_2013_2_cells.yaml", "found/okeefe_2013_3_cells.yaml")


def test_flight_code(both, tmp_path):
    outputs = both("export", "okeefe_2013", "--components", "mrp_control", "-o", "code", "--json")
    assert result(outputs[0]) == result(outputs[1])
    assert_same_files(tmp_path)
    assert any(name.endswith(".h") for name in files(tmp_path / "without"))


@pytest.mark.parametrize("options", [(REFERENCE,), ("okeefe_2013", *SUNNY, "--quick")], ids=["recording", "mission"])
def test_budgets(both, options):
    outputs = both("budget", *options, "--json", expected=(0, 1))
    assert result(outputs[0]) == result(outputs[1])
    assert result(outputs[0])["heading"]["sources"]
