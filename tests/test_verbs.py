# SPDX-License-Identifier: Apache-2.0
"""Every verb of ./sunpoint and every node answers --help, from its installed executable."""

import os
import signal
import subprocess
from pathlib import Path

import pytest

from bootstrap.verbs import VERBS
from css_common.testing import installed

ROOT = Path(__file__).parents[1]
NODES = sorted(
    (file.parts[-3], file.stem) for file in ROOT.glob("src/*/*/nodes/[a-z]*.py") if not file.stem.startswith("_")
)

JUST_DONE = {"bench", "budget", "completion", "coverage", "docs", "export", "layout", "monte-carlo", "slit-analyse"}
"""Verbs of which exit code 0 says no more than that; the others' help says what has come of it."""

SLOW = {"numba", "scipy", "rclpy", "matplotlib", "pyarrow", "rosbags", "mcap"}


def _help(package: str, executable: str, verb: str = "") -> str:
    command = [str(installed(package, executable)), "--help"]
    typed = {"SUNPOINT_VERB": f"{verb}:{executable}"} if verb else {}
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=100, check=False, env={**os.environ, **typed}
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize("file", sorted(ROOT.glob("src/*/*/nodes/*.py")) + sorted(ROOT.glob("src/*/*/commands/*.py")))
def test_an_executable_has_no_second_door(file):
    assert "__main__" not in file.read_text(), "what is installed guards its start and its end, `python -m` does not"


@pytest.mark.parametrize("verb", sorted(name for name, verb in VERBS.items() if verb.package))
def test_verb_explains_itself_under_the_name_that_was_typed(verb):
    entry = VERBS[verb]
    told = _help(entry.package, entry.executable, verb)
    lines = told.splitlines()
    assert told.startswith(f"usage: ./sunpoint {verb} [-h]")
    examples = lines[lines.index("examples:") + 1 : lines.index("exit codes:") - 1]
    assert examples and all(line.startswith(f"  ./sunpoint {verb}") for line in examples)
    meanings = dict(line.split(maxsplit=1) for line in lines[lines.index("exit codes:") + 1 :])
    codes = list(meanings)
    assert (meanings["0"] == "done") == (verb in JUST_DONE)
    assert codes == sorted(codes, key=int) and {"0", "2", "130"} <= set(codes) <= {"0", "1", "2", "130"}
    assert max(map(len, lines)) <= 120


@pytest.mark.parametrize("verb", sorted(name for name, verb in VERBS.items() if verb.package))
def test_verb_loads_nothing_that_takes_long_before_its_options_are_read(verb):
    entry = VERBS[verb]
    done = subprocess.run(
        [installed(entry.package, entry.executable), "--help"],
        capture_output=True, text=True, timeout=100, check=True, env=os.environ | {"PYTHONPROFILEIMPORTTIME": "1"},
    )  # fmt: skip
    loaded = {line.rpartition("|")[2].strip().partition(".")[0] for line in done.stderr.splitlines()}
    assert "argparse" in loaded
    assert loaded.isdisjoint(SLOW)


@pytest.mark.parametrize(
    ("verb", "package", "executable"),
    [("record", "css_recording", "recorder"), ("import-csv", "css_telemetry", "import_csv")],
)
def test_without_a_verb_the_name_is_that_of_ros2_run(verb, package, executable):
    told = _help(package, executable, f"{verb}x:other")
    assert told.startswith(f"usage: ros2 run {package} {executable} [-h]")


@pytest.mark.parametrize(("package", "executable"), NODES)
def test_node_explains_itself(package, executable):
    assert len(_help(package, executable).splitlines()) > 5


SOME = [
    ("css_estimation", "ekf"),
    ("css_recording", "recorder"),
    ("css_bringup", "fly"),
    ("css_monte_carlo", "coverage"),
]


@pytest.mark.parametrize(("package", "executable"), SOME)
def test_help_that_nobody_reads_is_no_error(package, executable):
    process = subprocess.Popen(
        [installed(package, executable), "--help"], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    assert process.stdout is not None
    process.stdout.close()
    _, err = process.communicate(timeout=100)
    assert (process.returncode, err) == (0, b"")


@pytest.mark.parametrize("library", ["numpy", "llvmlite"])
@pytest.mark.parametrize(("package", "executable"), SOME)
def test_an_interrupt_while_libraries_load_says_nothing(package, executable, library):
    arguments = ["--ros-args"] if executable == "ekf" else ["--help"]
    process = subprocess.Popen(
        [installed(package, executable), *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    loaded = Path(f"/proc/{process.pid}/maps")
    while process.poll() is None and library not in loaded.read_text():
        pass
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=100)
    assert process.returncode in (-signal.SIGINT, 130, 0)
    assert err == b""
